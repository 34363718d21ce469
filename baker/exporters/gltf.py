"""Writes a plain glTF file: scene.glb with lightmap uv, and baked AO as its occlusion texture."""

from __future__ import annotations

from pathlib import Path

from baker.core.export import EXPORTS
from baker.exporters.common import SCENE_NAME, link_file, write_readme


class GltfExport:
    """The export `gltf`."""

    needs: tuple[str, ...] = ()

    def write(self, bake: Path, target: Path) -> None:
        """Write the files of the export into `target`."""
        link_file(bake / SCENE_NAME, target / SCENE_NAME)
        write_readme(
            bake,
            target,
            "Plain glTF",
            steps=(
                "Load scene.glb into any program that reads glTF 2.0. Baked AO is its occlusion texture.",
                "glTF has no lightmaps: to use the irradiance, choose the export of your engine, or `unlit`.",
            ),
            scale="AO is the unoccluded share of the hemisphere, 255 is 1; it dims indirect light only.",
            uv="TEXCOORD_1 is the lightmap uv; the occlusion texture reads it (`texCoord` 1).",
            rows="v = 0 is the first row of the image, as everywhere in glTF.",
        )


EXPORTS.register("gltf")(GltfExport())
