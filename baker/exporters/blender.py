"""Blender: scene.glb, the EXR pages, and a script that imports both and wires the second uv map."""

from __future__ import annotations

from pathlib import Path

from baker.core.export import EXPORTS
from baker.exporters.common import place_named_bake, template, write_readme, write_text


class BlenderExport:
    """Files the export `blender`."""

    needs: tuple[str, ...] = ("irradiance",)

    def write(self, bake: Path, target: Path) -> None:
        """Write the folder."""
        place_named_bake(bake, target)
        write_text(target / "import_lightmaps.py", template("blender", "import_lightmaps.py"))
        write_readme(
            target,
            "Lightmaps for Blender",
            steps=(
                "`blender --python import_lightmaps.py`, or open the script in the text editor and run it.",
                "Materials become emission of what their surface sends out; the file's lights are left out.",
                "Set the view transform to Standard, or pictures go through Blender's film curve.",
                "Node i is named `..._n<i>`; the custom property `baker_node` says i, too.",
            ),
            scale="EXR holds irradiance E in lx; shown is base colour x E / pi as emission, in cd/m2.",
            uv="the second uv map (`UVMap.001`), which is TEXCOORD_1.",
            rows="Blender turns v over when it imports glTF, and its images begin below: nothing else to do.",
        )


EXPORTS.register("blender")(BlenderExport())
