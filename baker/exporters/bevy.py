"""Writes for Bevy: pages, scene, and a plugin in one file that adds `Lightmap` components to the objects.

Bevy shows `lightmap * lightmap_exposure * diffuse colour * view exposure`. The lightmap is E, so
`lightmap_exposure = 1 / pi` gives the radiance albedo * E / pi in cd/m2.

Based on: bevy_pbr, lightmap/lightmap.wgsl and render/pbr_functions.wgsl.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from baker.core.export import EXPORTS
from baker.exporters.common import place_named_bake, template, write_readme, write_text


class BevyExport:
    """The export `bevy`."""

    needs: tuple[str, ...] = ("irradiance",)

    def write(self, bake: Path, target: Path) -> None:
        """Write the files of the export into `target`."""
        description = place_named_bake(bake, target)
        rows = "".join(f"    {_row(entry)},\n" for entry in description["objects"])
        pages = "".join(f'    "{page["file"]}",\n' for page in description["pages"])
        source = template("bevy", "baker_lightmaps.rs")
        source = source.replace("    /* pages */\n", pages).replace("    /* objects */\n", rows)
        write_text(target / "baker_lightmaps.rs", source)
        write_readme(
            bake,
            target,
            "Lightmaps for Bevy",
            steps=(
                "Copy the folder to assets/bevy and baker_lightmaps.rs into your crate (Bevy 0.16 or newer,",
                'feature "exr"): `app.add_plugins(BakerLightmapsPlugin { folder: "bevy".into() })`.',
                "Spawn scene.glb as usual, but without its lights, because the pages contain their light.",
                "Adjust the camera's `Exposure` to the scene, because the pages are in photometric units.",
            ),
            scale="The pages contain irradiance E in lx; `lightmap_exposure` = 1 / pi shows albedo x E / pi.",
            uv="TEXCOORD_1, which is Mesh::ATTRIBUTE_UV_1.",
            rows="v = 0 is the first row of the image, as in Bevy; v is not flipped.",
        )


EXPORTS.register("bevy")(BevyExport())


def _row(entry: dict[str, Any]) -> str:
    """Return the Rust struct literal of an object; `min` and `max` are the corners of Bevy's `uv_rect`."""
    (su, sv), (ou, ov) = entry["uv_scale"], entry["uv_offset"]
    low, high = f"[{ou!r}, {ov!r}]", f"[{ou + su!r}, {ov + sv!r}]"
    return f'Baked {{ name: "{entry["name"]}", page: {entry["page"]}, min: {low}, max: {high} }}'
