"""Writes files for Babylon.js: scene.glb, the EXR pages, and a module that loads both."""

from __future__ import annotations

from pathlib import Path

from baker.core.export import EXPORTS
from baker.exporters.common import place_web_bake, template, write_readme, write_text


class BabylonExport:
    """The export `babylon`."""

    needs: tuple[str, ...] = ("irradiance",)

    def write(self, bake: Path, target: Path) -> None:
        """Write the files of the export into `target`."""
        place_web_bake(bake, target)
        write_text(target / "lightmap.js", template("babylon", "lightmap.js"))
        write_readme(
            bake,
            target,
            "Lightmaps for Babylon.js",
            steps=(
                "Serve this folder, and load it with lightmap.js (Babylon.js 7 or newer, glTF loader):",
                "`import { loadBake } from './babylon/lightmap.js';`",
                "`await loadBake(BABYLON, 'babylon/', scene);`",
                "lightmap.js switches the lights of scene.glb off, because the pages contain their light.",
                "For ZIP pages, Babylon.js fetches fflate from a CDN; `{ fflate: URL }` names your copy.",
            ),
            scale="The pages contain irradiance E in lx; materials show albedo x E / pi in cd/m2. "
            "The option `{ exposure: x }` multiplies all light by x.",
            uv="TEXCOORD_1, which is `coordinatesIndex = 1`.",
            rows="v = 0 is the first row of each file. Babylon.js stores the rows of an EXR bottom-up, so "
            "lightmap.js replaces v by 1 - v. For the pages of the encodings `ktx2` (option "
            "`{ zstd: decoder }`) and `webp` (option `{ webp: true }`), v stays.",
        )


EXPORTS.register("babylon")(BabylonExport())
