"""Writes for Bevy: pages, scene, and a plugin in one file that adds `Lightmap` components to the objects.

Bevy shows `page x lightmap_exposure x diffuse colour x exposure of the camera`. A page contains E / scale, so
`lightmap_exposure = scale / pi` gives the radiance albedo x E / pi in cd/m2. The scale is 1 unless the
brightest texel exceeds the limit of the format.

Based on: bevy_pbr, lightmap/lightmap.wgsl and render/pbr_functions.wgsl; bevy_camera, Exposure.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from baker.core.encoding import ENCODINGS, Encoding
from baker.core.export import EXPORTS
from baker.exporters.common import (
    DESCRIPTION_NAME,
    EXPOSURE_KEY,
    place_named_scene,
    read_manifest,
    template,
    write_json,
    write_page,
    write_readme,
    write_text,
)

# Encoding of the pages. Bevy reads EXR files as four floats per texel; RGB9E5 takes a quarter of that memory.
PAGE_ENCODING = "ktx2"
# Exposure value of Bevy's cameras, used if the bake suggests no exposure.
_EV100 = 9.7


class BevyExport:
    """The export `bevy`."""

    needs: tuple[str, ...] = ("irradiance",)

    def write(self, bake: Path, target: Path) -> None:
        """Write the files of the export into `target`."""
        manifest = read_manifest(bake)
        scale = page_scale(float(manifest["statistics"]["irradiance"]["max"]))
        description = place_named_scene(bake, target)
        for page in description["pages"]:
            path = (target / page["file"]).with_suffix(_page_encoding().suffix)
            quantity = f"irradiance E / {scale:g}, without the receiver's albedo"
            write_page(bake, page["file"], path, divisor=scale, quantity=quantity, unit="lx")
            page["file"] = path.name
        write_json(target / DESCRIPTION_NAME, {**description, "scale": scale})
        write_text(target / "baker_lightmaps.rs", _plugin(description, scale))
        write_readme(
            bake,
            target,
            "Lightmaps for Bevy",
            steps=(
                "Copy the folder to assets/bevy, and baker_lightmaps.rs into your crate. Bevy needs the",
                "features `ktx2`, `png` and `zstd_rust` (0.16: `zstd`). Spawn scene.glb, and add the plugin:",
                '`app.add_plugins(BakerLightmapsPlugin { folder: "bevy".into() })`. Spawn the camera with',
                "`Exposure { ev100: EV100 }` and `AmbientLight { brightness: 0.0, ..default() }`.",
            ),
            scale=f"E in lx = page x {scale:g}; the plugin sets `lightmap_exposure` = {scale:g} / pi.",
            uv="TEXCOORD_1, which is Mesh::ATTRIBUTE_UV_1.",
            rows="v = 0 is the first row of the image, as in Bevy; v is not flipped.",
        )


EXPORTS.register("bevy")(BevyExport())


def page_scale(brightest: float) -> float:
    """Return the power of two by which pages are divided so that the value `brightest` (lx) can be stored."""
    encoding = _page_encoding()
    _, limit = encoding.limits(encoding.options_type())
    return float(2.0 ** math.ceil(math.log2(max(brightest / limit, 1.0))))


def ev100(exposure: float | None) -> float:
    """Return the exposure value for which a Bevy camera multiplies luminance by `exposure`."""
    return round(-math.log2(1.2 * exposure), 4) if exposure else _EV100


def _page_encoding() -> Encoding[Any]:
    return ENCODINGS.require(PAGE_ENCODING, "encoding")


def _plugin(description: dict[str, Any], scale: float) -> str:
    """Return the source of the plugin."""
    inserted = {
        "/* scale */": repr(scale),
        "/* ev100 */": repr(ev100(description[EXPOSURE_KEY])),
        "    /* pages */\n": "".join(f'    "{page["file"]}",\n' for page in description["pages"]),
        "    /* objects */\n": "".join(f"    {_row(entry)},\n" for entry in description["objects"]),
    }
    source = template("bevy", "baker_lightmaps.rs")
    for mark, text in inserted.items():
        source = source.replace(mark, text)
    return source


def _row(entry: dict[str, Any]) -> str:
    """Return the Rust struct literal of an object; `min` and `max` are the corners of Bevy's `uv_rect`."""
    (su, sv), (ou, ov) = entry["uv_scale"], entry["uv_offset"]
    low, high = f"[{ou!r}, {ov!r}]", f"[{ou + su!r}, {ov + sv!r}]"
    who = f'node: {entry["node"]}, name: "{entry["name"]}"'
    return f"Baked {{ {who}, page: {entry['page']}, min: {low}, max: {high} }}"
