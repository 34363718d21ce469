"""Plain glTF: scene.glb with lightmap uv, and the AO inside as occlusion texture. Any viewer reads it."""

from __future__ import annotations

from pathlib import Path

from baker.core.export import EXPORTS
from baker.exporters.common import SCENE_NAME, link_file, write_readme


class GltfExport:
    """Files the export `gltf`."""

    needs: tuple[str, ...] = ()

    def write(self, bake: Path, target: Path) -> None:
        """Write the folder."""
        link_file(bake / SCENE_NAME, target / SCENE_NAME)
        write_readme(
            target,
            "Plain glTF",
            steps=(
                "Load scene.glb into anything that reads glTF 2.0; AO, if baked, is its occlusion texture.",
                "glTF has no light maps: for the irradiance take the export of your engine, or `unlit`.",
            ),
            scale="AO is the open share of the hemisphere, 255 = open; it dims indirect light only.",
            uv="TEXCOORD_1 is the lightmap uv; the occlusion texture reads it (`texCoord` 1).",
            rows="v = 0 is the first row of the image, as everywhere in glTF.",
        )


EXPORTS.register("gltf")(GltfExport())
