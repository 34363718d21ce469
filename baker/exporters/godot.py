"""Writes for Godot: pages as layers of a texture, and scripts that show them as LightmapGI or with a shader.

Godot 4 multiplies a lightmap by the albedo and not by 1 / pi. It scales a lightmap by an exposure only if the
camera has attributes. Therefore the pages hold E / pi x exposure. Pages are stacked in one image, as Godot
stacks its own lightmaps; page i of an image becomes layer i of the texture. An object's uv in its page is
TEXCOORD_1 x size + position of the `Rect2` given to `LightmapGIData.add_user`, with v = 0 at the first row.

Based on: Godot 4.6 sources, `scene/3d/lightmap_gi.cpp` and the fragment shaders of its renderers.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from baker.core.export import EXPORTS
from baker.encodings.exr import encode_exr
from baker.exporters.common import (
    DESCRIPTION_NAME,
    EXPOSURE_KEY,
    SCENE_NAME,
    decode_page,
    named_scene,
    template,
    write_json,
    write_readme,
    write_scene,
    write_text,
)

# Scripts and shaders, copied from the templates.
FILES = (
    "import_scene.gd",
    "lightmap_gi.gd",
    "fallback/lightmaps.gd",
    "fallback/lightmap.gdshader",
    "godot3/lightmaps.gd",
    "godot3/lightmap.shader",
)
# Largest number of rows of an image, the limit of Godot's class Image.
MAX_ROWS = 16384

# Import settings of scene.glb in Godot 4. The script's path is relative to scene.glb (since Godot 4.4).
# `light_baking=1` keeps the second uv set; 2 would replace it. Without `naming_version`, Godot renames nodes
# as its version 4.0 did.
_IMPORT_SCENE = """\
[remap]

importer="scene"
importer_version=1
type="PackedScene"

[params]

meshes/light_baking=1
import_script/path="import_scene.gd"
gltf/naming_version=1
"""
# Import settings of an image with `slices` pages in Godot 4: `compress/mode=3` is "VRAM uncompressed", and
# `channel_pack=1` is "optimized", that is, linear. Mip levels would mix charts.
_IMPORT_LAYERS = """\
[remap]

importer="2d_array_texture"
type="CompressedTexture2DArray"

[params]

compress/mode=3
compress/channel_pack=1
mipmaps/generate=false
slices/horizontal=1
slices/vertical={slices}
"""
# Import settings of an image in Godot 3: uncompressed even if it is used in 3D, linear, without mip levels.
_IMPORT_3 = """\
[remap]

importer="texture"

[params]

compress/mode=3
flags/repeat=0
flags/filter=true
flags/mipmaps=false
flags/srgb=0
detect_3d=false
"""


class GodotExport:
    """The export `godot`."""

    needs: tuple[str, ...] = ("irradiance",)

    def write(self, bake: Path, target: Path) -> None:
        """Write the files of the export into `target`."""
        document, named, binary = named_scene(bake)
        # Remove occlusion textures: Godot would darken the lightmaps by them, but lightmaps contain occlusion
        # already.
        for material in document.get("materials", []):
            material.pop("occlusionTexture", None)
        write_scene(target, document, binary)
        description = godot_description(named)
        exposure = description["exposure"]
        write_json(target / DESCRIPTION_NAME, description)
        write_text(target / f"{SCENE_NAME}.import", _IMPORT_SCENE)
        for name in FILES:
            (target / name).parent.mkdir(exist_ok=True)
            write_text(target / name, template("godot", name))
        # Godot 4 must not import the files for Godot 3.
        write_text(target / "godot3" / ".gdignore", "")
        for texture, pages in zip(description["textures"], _groups(named["pages"]), strict=True):
            name = texture["file"]
            _write_layers(bake, [page["file"] for page in pages], target / name, exposure)
            write_text(target / f"{name}.import", _IMPORT_LAYERS.format(slices=len(pages)))
            write_text(target / "godot3" / f"{name}.import", _IMPORT_3)
        write_readme(
            bake,
            target,
            "Lightmaps for Godot",
            steps=(
                "Copy the folder into the project of Godot 4.4 or newer and add scene.glb to your scene:",
                "the import adds a LightmapGI with these lightmaps. In Godot 4.2 and 4.3, select scene.glb,",
                "set Import Script to import_scene.gd in the Import dock, and press Reimport.",
                "fallback/ has a shader for renderers without LightmapGI, godot3/ has one for Godot 3.",
            ),
            scale=f"The pages contain E / pi x {exposure:g} (`exposure`); Godot multiplies them by albedo.",
            uv="TEXCOORD_1, which is UV2.",
            rows="v = 0 is the first row of a page, as in Godot; v is not flipped.",
        )


EXPORTS.register("godot")(GodotExport())


def godot_description(description: dict[str, Any]) -> dict[str, Any]:
    """Return the content of `lightmap.json` with images, and with layer and scale of the pages."""
    groups = _groups(description["pages"])
    files = [f"lightmap_{number}.exr" for number in range(len(groups))]
    return {
        **description,
        "quantity": "irradiance / pi x exposure",
        "unit": "1",
        "exposure": description[EXPOSURE_KEY] or 1.0,
        "textures": [{"file": file, "slices": len(group)} for file, group in zip(files, groups, strict=True)],
        "pages": [
            {**page, "file": file, "slice": number, "slices": len(group)}
            for file, group in zip(files, groups, strict=True)
            for number, page in enumerate(group)
        ],
    }


def _groups(pages: list[dict[str, Any]]) -> list[list[dict[str, Any]]]:
    """Divide the pages, which have one size, into groups that fit into one image each."""
    most = MAX_ROWS // pages[0]["height"]
    return [pages[first : first + most] for first in range(0, len(pages), most)]


def _write_layers(bake: Path, files: list[str], target: Path, exposure: float) -> None:
    """Write pages one below the other as half floats, scaled to E / pi x exposure."""
    images = [decode_page(bake, file).pixels for file in files]
    pixels = (np.concatenate(images).astype(np.float64) * exposure / math.pi).astype(np.float32)
    header = {
        "quantity": "irradiance E / pi x exposure, without the receiver's albedo",
        "unit": "1",
        "exposure": f"{exposure:g}",
    }
    encode_exr(target, pixels, header=header)
