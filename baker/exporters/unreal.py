"""Writes files for Unreal Engine: pages, scene, and an editor script that builds a material function.

Unreal cannot import lightmaps, so the reflected light becomes the emission of an unlit material:

emissive colour = base colour * page(TexCoord[1] * scale + offset) / pi.
"""

from __future__ import annotations

from pathlib import Path

from baker.core.export import EXPORTS
from baker.exporters.common import place_named_bake, template, write_readme, write_text


class UnrealExport:
    """The export `unreal`."""

    needs: tuple[str, ...] = ("irradiance",)

    def write(self, bake: Path, target: Path) -> None:
        """Write the files of the export into `target`."""
        place_named_bake(bake, target)
        write_text(target / "import_lightmaps.py", template("unreal", "import_lightmaps.py"))
        write_readme(
            bake,
            target,
            "Lightmaps for Unreal Engine",
            steps=(
                "Enable the plugin Python Editor Script, and run import_lightmaps.py (Tools > Execute Python",
                "Script). It imports pages and scene to /Game/Baker, and creates the material function",
                "MF_BakerLightmap, the unlit material M_BakerLightmap and its instances for the objects.",
                "The parameter `Exposure` scales the light; the level's auto exposure is applied after it.",
            ),
            scale="The pages contain irradiance E in lx; the material shows base colour x E / pi, in cd/m2.",
            uv="TEXCOORD_1, which is UV channel 1 (TexCoord[1]).",
            rows="v = 0 is the first row of the image, as in Unreal; v is not flipped.",
        )


EXPORTS.register("unreal")(UnrealExport())
