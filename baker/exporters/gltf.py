"""Writes plain glTF files: scene.glb with lightmap uv and AO, and lightmaps.glb with MOZ_lightmap."""

from __future__ import annotations

from pathlib import Path

from baker.core.export import EXPORTS
from baker.exporters.common import SCENE_NAME, irradiance_pages, link_file, read_manifest, write_readme
from baker.exporters.moz_lightmap import lightmap_glb


class GltfExport:
    """The export `gltf`."""

    needs: tuple[str, ...] = ()

    def write(self, bake: Path, target: Path) -> None:
        """Write the files of the export into `target`."""
        manifest = read_manifest(bake)
        link_file(bake / SCENE_NAME, target / SCENE_NAME)
        steps = ["Load scene.glb into any program that reads glTF 2.0. Baked AO is its occlusion texture."]
        scale = "AO is the unoccluded share of the hemisphere, 255 is 1; it dims indirect light only."
        if irradiance_pages(manifest):
            glb, intensity = lightmap_glb(bake, manifest)
            (target / "lightmaps.glb").write_bytes(glb)
            steps += [
                "lightmaps.glb is for loaders of the extension MOZ_lightmap, such as Mozilla Hubs.",
                "Other programs ignore it: choose the export of your engine, or `unlit`.",
            ]
            scale += (
                f" In lightmaps.glb a texel of 1 (255 in the PNG) is an irradiance of {intensity:.6g} lx."
            )
        write_readme(
            bake,
            target,
            "Plain glTF",
            steps=tuple(steps),
            scale=scale,
            uv="TEXCOORD_1 is the lightmap uv; AO and MOZ_lightmap read it (`texCoord` 1).",
            rows="v = 0 is the first row of the image, as everywhere in glTF.",
        )


EXPORTS.register("gltf")(GltfExport())
