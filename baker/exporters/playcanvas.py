"""Writes files for PlayCanvas: scene.glb, the pages as Radiance HDR, and a module that loads both.

PlayCanvas has no reader of EXR files. The module finds an object by its mesh, because PlayCanvas changes
repeated names. Therefore each object gets a mesh of its own; instances still share vertices and indices.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from baker.core.export import EXPORTS
from baker.encodings.hdr import HdrEncoding, hdr_file
from baker.exporters.common import (
    DESCRIPTION_NAME,
    decode_page,
    describe,
    place_scene,
    read_manifest,
    separate_meshes,
    template,
    write_json,
    write_readme,
    write_text,
)

# Header attributes of a page that the Radiance file repeats.
_KEPT = ("colourSpace", "quantity", "software", "unit")


class PlayCanvasExport:
    """The export `playcanvas`."""

    needs: tuple[str, ...] = ("irradiance",)

    def write(self, bake: Path, target: Path) -> None:
        """Write the files of the export into `target`."""
        manifest = read_manifest(bake)
        description = describe(manifest)
        meshes: dict[int, int] = {}

        def separate(document: dict[str, Any]) -> bool:
            before = len(document["meshes"])
            meshes.update(separate_meshes(document, manifest))
            return len(document["meshes"]) > before

        place_scene(bake, target, separate)
        for page in description["pages"]:
            page["file"] = _write_page(bake, page["file"], target)
        write_json(target / DESCRIPTION_NAME, _with_meshes(description, meshes))
        write_text(target / "lightmap.js", template("playcanvas", "lightmap.js"))
        write_readme(
            bake,
            target,
            "Lightmaps for PlayCanvas",
            steps=(
                "Serve this folder, and load it with lightmap.js (PlayCanvas engine 2):",
                "`import { loadBake } from './playcanvas/lightmap.js';`",
                "`const { entity } = await loadBake(pc, app, 'playcanvas/'); app.root.addChild(entity);`",
                "lightmap.js switches the lights of scene.glb off, because the pages contain their light.",
            ),
            scale="The pages contain irradiance E in lx; lightmap.js multiplies by 1 / pi, and materials "
            "show albedo x E / pi in cd/m2. The option `{ exposure: x }` multiplies all light by x.",
            uv="TEXCOORD_1, which is `lightMapUv = 1`.",
            rows="v = 0 is the first row, in the file and in PlayCanvas.",
        )


EXPORTS.register("playcanvas")(PlayCanvasExport())


def _write_page(bake: Path, file: str, target: Path) -> str:
    """Write a page as Radiance HDR, in lx, and return its name."""
    image = decode_page(bake, file)
    path = (target / file).with_suffix(HdrEncoding.suffix)
    path.write_bytes(hdr_file(image.pixels, {key: image.header[key] for key in _KEPT if key in image.header}))
    return path.name


def _with_meshes(description: dict[str, Any], meshes: dict[int, int]) -> dict[str, Any]:
    """Return the description with the mesh of each object; `meshes` maps nodes to indices of meshes."""
    return {
        **description,
        "objects": [{**entry, "mesh": meshes[entry["node"]]} for entry in description["objects"]],
    }
