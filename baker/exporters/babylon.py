"""Babylon.js: scene.glb, the EXR pages, and a module that puts the two together."""

from __future__ import annotations

from pathlib import Path

from baker.core.export import EXPORTS
from baker.exporters.common import place_bake, template, write_readme, write_text


class BabylonExport:
    """Files the export `babylon`."""

    needs: tuple[str, ...] = ("irradiance",)

    def write(self, bake: Path, target: Path) -> None:
        """Write the folder."""
        place_bake(bake, target)
        write_text(target / "lightmap.js", template("babylon", "lightmap.js"))
        write_readme(
            target,
            "Lightmaps for Babylon.js",
            steps=(
                "Serve this folder and load it with the module beside this file (Babylon.js 7 or newer with",
                "its glTF loader): `import { loadBake } from './babylon/lightmap.js';`",
                "`await loadBake(BABYLON, 'babylon/', scene);` The file's lights are baked in, so off.",
                "ZIP pages need fflate, which Babylon.js fetches from a CDN: serve it yourself with",
                "`{ fflate: 'URL of fflate/umd/index.js' }`, or bake with `exr_compression='piz'`.",
            ),
            scale="EXR holds irradiance E in lx; unlit materials show albedo x E / pi, in cd/m2. "
            "`{ exposure: x }` multiplies all of it.",
            uv="TEXCOORD_1, which is `coordinatesIndex = 1`.",
            rows="v = 0 is the EXR's first row, but Babylon.js hands rows out from below: v is turned over.",
        )


EXPORTS.register("babylon")(BabylonExport())
