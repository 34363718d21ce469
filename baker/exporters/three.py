"""Writes files for three.js: scene.glb, the EXR pages, and a module that loads both."""

from __future__ import annotations

from pathlib import Path

from baker.core.export import EXPORTS
from baker.exporters.common import place_web_bake, template, write_readme, write_text


class ThreeExport:
    """The export `three`."""

    needs: tuple[str, ...] = ("irradiance",)

    def write(self, bake: Path, target: Path) -> None:
        """Write the files of the export into `target`."""
        place_web_bake(bake, target)
        write_text(target / "lightmap.js", template("three", "lightmap.js"))
        write_readme(
            bake,
            target,
            "Lightmaps for three.js",
            steps=(
                "Serve this folder and load it with lightmap.js (three.js r151 or newer):",
                "`const { gltf } = await loadBake('three/'); scene.add(gltf.scene);`",
                "lightmap.js hides the lights of scene.glb and removes its AO maps, because the pages",
                "contain their effect. Materials become MeshLambertMaterial, which shows albedo x E / pi.",
                "`{ matte: false }` keeps the materials, which show about 1.5 % less than albedo x E / pi.",
            ),
            scale="The pages contain irradiance E in lx; used as `lightMap`, they give albedo x E / pi "
            "in cd/m2. The option `{ exposure: x }` multiplies all light by x.",
            uv="TEXCOORD_1, which is `uv1`; a texture needs `channel = 1`.",
            rows="v = 0 is the first row of each file. EXRLoader stores the rows bottom-up, so lightmap.js "
            "replaces v by 1 - v. For the pages of the encodings `ktx2` (option `{ ktx2: loader }`) "
            "and `webp` (option `{ webp: true }`), v stays.",
        )


EXPORTS.register("three")(ThreeExport())
