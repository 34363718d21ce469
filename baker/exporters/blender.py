"""Writes for Blender: scene.glb, the EXR pages, and a script that imports both and sets up materials."""

from __future__ import annotations

import math
from pathlib import Path

from baker.core.export import EXPORTS
from baker.exporters.common import (
    EXPOSURE_KEY,
    place_named_bake,
    read_manifest,
    template,
    write_readme,
    write_text,
)


class BlenderExport:
    """The export `blender`."""

    needs: tuple[str, ...] = ("irradiance",)

    def write(self, bake: Path, target: Path) -> None:
        """Write the files of the export into `target`."""
        place_named_bake(bake, target)
        write_text(target / "import_lightmaps.py", template("blender", "import_lightmaps.py"))
        exposure = read_manifest(bake).get(EXPOSURE_KEY)
        stops = f", and its Exposure to {math.log2(exposure):.1f}" if exposure else ""
        write_readme(
            bake,
            target,
            "Lightmaps for Blender",
            steps=(
                "Run `blender --python import_lightmaps.py`, or run the script in Blender's text editor.",
                "Materials are replaced by emission of the baked radiance; the file's lights are hidden.",
                f"Set the view transform to Standard (Blender's default applies a film curve){stops}.",
                "Node i is named `..._n<i>`, and its custom property `baker_node` is i.",
            ),
            scale="The pages contain irradiance E in lx; the materials emit base colour x E / pi, in cd/m2.",
            uv="the second uv map (`UVMap.001`), which is TEXCOORD_1.",
            rows="Blender replaces v by 1 - v on import and stores images bottom-up, so no flip is needed.",
        )


EXPORTS.register("blender")(BlenderExport())
