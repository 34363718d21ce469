"""three.js: scene.glb, the EXR pages, and a module that puts the two together."""

from __future__ import annotations

from pathlib import Path

from baker.core.export import EXPORTS
from baker.exporters.common import place_bake, template, write_readme, write_text


class ThreeExport:
    """Files the export `three`."""

    needs: tuple[str, ...] = ("irradiance",)

    def write(self, bake: Path, target: Path) -> None:
        """Write the folder."""
        place_bake(bake, target)
        write_text(target / "lightmap.js", template("three", "lightmap.js"))
        write_readme(
            target,
            "Lightmaps for three.js",
            steps=(
                "Serve this folder and load it with the module beside this file (three.js r151 or newer):",
                "`const { gltf } = await loadBake('three/'); scene.add(gltf.scene);`",
                "The lights of the file are baked in and so are hidden; AO is in the light and so is off.",
                "Materials become matte; with `{ matte: false }` they stay what they are (1.5 % darker).",
            ),
            scale="EXR holds irradiance E in lx, `lightMap` takes just that: shown is albedo x E / pi, in "
            "cd/m2. `{ exposure: x }` multiplies all of it.",
            uv="TEXCOORD_1, which is `uv1`; a texture needs `channel = 1`.",
            rows="v = 0 is the EXR's first row, but EXRLoader hands rows out from below: v is turned over.",
        )


EXPORTS.register("three")(ThreeExport())
