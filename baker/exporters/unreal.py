"""Unreal Engine: pages, scene, and an editor script that builds a material function on uv set 1.

Unreal cannot import lightmaps, so the light is the emission of an unlit material:
emissive colour = base colour * page(TexCoord[1] * scale + offset) / pi.
"""

from __future__ import annotations

from pathlib import Path

from baker.core.export import EXPORTS
from baker.exporters.common import place_named_bake, template, write_readme, write_text


class UnrealExport:
    """Files the export `unreal`."""

    needs: tuple[str, ...] = ("irradiance",)

    def write(self, bake: Path, target: Path) -> None:
        """Write the folder."""
        place_named_bake(bake, target)
        write_text(target / "import_lightmaps.py", template("unreal", "import_lightmaps.py"))
        write_readme(
            target,
            "Lightmaps for Unreal Engine",
            steps=(
                "Switch the Python Editor Script plugin on, then Tools > Execute Python Script on",
                "import_lightmaps.py. It imports pages and scene to /Game/Baker, makes the material function",
                "MF_BakerLightmap and the unlit material M_BakerLightmap, and one instance for each object.",
                "Exposure is the parameter `Exposure`; auto exposure of the level has the last word.",
            ),
            scale="EXR holds irradiance E in lx; the material shows base colour x E / pi, in cd/m2.",
            uv="TEXCOORD_1, which is UV channel 1 (TexCoord[1]).",
            rows="v = 0 is the first row in Unreal, too: nothing is turned over.",
        )


EXPORTS.register("unreal")(UnrealExport())
