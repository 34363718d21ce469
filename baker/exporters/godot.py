"""Writes for Godot 4 and 3: pages, scene, a shader, and a script that assigns the shader to objects."""

from __future__ import annotations

from pathlib import Path

from baker.core.export import EXPORTS
from baker.exporters.common import place_named_bake, template, write_readme, write_text

FILES = ("lightmap.gdshader", "lightmaps.gd", "import_scene.gd")
FILES_3 = ("lightmap.shader", "lightmaps.gd")
# Import settings of the pages for Godot 3 and 4. Pages are linear and have no mip levels, because mip levels
# would mix charts. Pages stay uncompressed even if they are used in 3D: `compress/mode=3` is "uncompressed"
# in Godot 3 and "VRAM uncompressed" in Godot 4.
_IMPORT = """\
[remap]

importer="texture"

[params]

compress/mode=3
compress/hdr_mode=0
compress/hdr_compression=0
flags/repeat=0
flags/filter=true
flags/mipmaps=false
flags/srgb=0
process/hdr_as_srgb=false
process/hdr_clamp_exposure=false
mipmaps/generate=false
detect_3d=false
detect_3d/compress_to=0
"""


class GodotExport:
    """The export `godot`."""

    needs: tuple[str, ...] = ("irradiance",)

    def write(self, bake: Path, target: Path) -> None:
        """Write the files of the export into `target`."""
        description = place_named_bake(bake, target)
        for page in description["pages"]:
            write_text(target / f"{page['file']}.import", _IMPORT)
        for name in FILES:
            write_text(target / name, template("godot", name))
        (target / "godot3").mkdir()
        # Godot 4 must not import the files for Godot 3.
        write_text(target / "godot3" / ".gdignore", "")
        for name in FILES_3:
            write_text(target / "godot3" / name, template("godot", f"godot3/{name}"))
        write_readme(
            bake,
            target,
            "Lightmaps for Godot",
            steps=(
                "Copy the folder into the project. Godot 4: attach lightmaps.gd to the root of the imported",
                "scene.glb, or set import_scene.gd as its import script. Godot 3 (GLES3 only,",
                "as GLES2 clamps at 1.0): move godot3/* up, delete import_scene.gd, attach lightmaps.gd.",
                "When you export a game, add *.json to the filter of non-resource files.",
            ),
            scale="The pages contain irradiance E in lx; the shader shows albedo x E / pi x `exposure`.",
            uv="TEXCOORD_1, which is UV2.",
            rows="v = 0 is the first row of the image, as in Godot; v is not flipped.",
        )


EXPORTS.register("godot")(GodotExport())
