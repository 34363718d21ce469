"""Writes one GLB without lightmaps: the radiance of each surface is an unlit texture on TEXCOORD_0.

The GLB is for viewers on phones and in AR, which support neither a second uv set nor high dynamic range. Each
page becomes an sRGB PNG of `(albedo x E / pi + emission) x exposure`, clipped at 1. The exposure is chosen so
that 99 % of the covered texels are not clipped.

Based on: Khronos Group, KHR_materials_unlit.
"""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from baker.core.export import EXPORTS
from baker.core.geometry import world_geometry
from baker.core.parallel import thread_count
from baker.core.progress import silent
from baker.core.scene import Instance, Material, Mesh, Scene, Texture
from baker.core.texels import TexelBuffer
from baker.exporters.common import EXPOSURE_KEY, write_json, write_readme
from baker.finish.dilate import dilate
from baker.io.bake.read_bake import StoredBake, read_bake
from baker.io.gltf.build_document import new_document
from baker.io.gltf.packer import Json
from baker.io.png import encode_png, grey_levels, srgb_levels
from baker.radiosity.texels import build_texels
from baker.shading.materials import resolve_materials

# Share of the covered texels that must not be clipped, 0 to 1.
SHOWN = 0.99


class UnlitExport:
    """The export `unlit`."""

    needs: tuple[str, ...] = ("irradiance",)

    def write(self, bake: Path, target: Path) -> None:
        """Write the files of the export into `target`."""
        stored = read_bake(bake).with_texels()
        page, covered = radiance(stored)
        exposure = exposure_for(page[..., :3], covered)
        (target / "scene.glb").write_bytes(unlit_glb(stored, page, exposure))
        suggested = stored.manifest.get(EXPOSURE_KEY)
        described = {"version": 1, "scene": "scene.glb", "exposure": exposure, EXPOSURE_KEY: suggested}
        write_json(target / "lightmap.json", described)
        write_readme(
            bake,
            target,
            "One unlit GLB",
            steps=(
                "scene.glb needs no other file: light and colour are one texture (KHR_materials_unlit).",
                "All nodes are roots with world matrices; there are no animations, skins and lights.",
                "Viewers that do not support KHR_materials_unlit add their own light to the baked light.",
            ),
            scale=f"sRGB of (albedo x E / pi + emission) x {exposure:.6g}; 1 % of texels may be clipped.",
            uv="TEXCOORD_0 is the lightmap uv, the only uv set.",
            rows="v = 0 is the first row of the image, as everywhere in glTF.",
        )


EXPORTS.register("unlit")(UnlitExport())


def radiance(bake: StoredBake) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Return the radiance (cd/m2) and alpha of each texel, and the mask of covered texels.

    Returns
    -------
    page : (P, H, W, 4) float32
        Radiance in linear RGB, and alpha, dilated into the padding.
    covered : (P, H, W) bool
    """
    texels, albedo = _texel_colour(bake, bake.scene)
    emissive = _with_materials(bake.scene, tuple(_emissive_only(m) for m in bake.scene.materials))
    emission = _texel_colour(bake, emissive)[1]
    alpha = _texel_colour(bake, _with_materials(bake.scene, tuple(map(_alpha, bake.scene.materials))))[1]
    chart = texels.page_image(texels.chart[: texels.n_front], fill=-1)
    covered = chart >= 0
    light = texels.page_image(albedo) * bake.maps["irradiance"] / np.float32(math.pi)
    both = np.concatenate([light + texels.page_image(emission), texels.page_image(alpha)[..., :1]], axis=-1)
    rings = max(2 * bake.atlas.padding, 8)
    threads = thread_count(None)
    pages = [
        dilate(np.ascontiguousarray(value, np.float32), mask, number, rings, threads=threads)[0]
        for value, mask, number in zip(both, covered, chart, strict=True)
    ]
    return np.maximum(np.stack(pages), np.float32(0.0)), covered


def exposure_for(light: NDArray[np.float32], covered: NDArray[np.bool_]) -> float:
    """Return the factor with which 99 % of the covered texels are at most 1; 1 for a black scene."""
    brightest = light[covered].max(axis=1)
    top = float(np.quantile(brightest, SHOWN)) if len(brightest) else 0.0
    return 1.0 / top if top > 0.0 else 1.0


def unlit_glb(bake: StoredBake, page: NDArray[np.float32], exposure: float) -> bytes:
    """Return the GLB in which each surface has the texture of its page on TEXCOORD_0.

    Parameters
    ----------
    bake : StoredBake
    page : (P, H, W, 4) float32
        Radiance and alpha, see `radiance`.
    exposure : float
    """
    kinds: list[tuple[int, Material]] = []
    meshes: list[Mesh] = []
    instances: list[Instance] = []
    for instance, layout in zip(bake.scene.instances, bake.atlas.layouts, strict=True):
        mesh = bake.scene.meshes[instance.mesh]
        used, index = np.unique(mesh.material, return_inverse=True)
        wanted = [(layout.page, _kind(bake.scene.materials[m])) for m in used.tolist()]
        kinds += [kind for kind in dict.fromkeys(wanted) if kind not in kinds]
        renumbered = np.array([kinds.index(kind) for kind in wanted], np.int32)[index]
        # Each instance has a mesh of its own, because its uv are those of its page.
        instances.append(replace(instance, mesh=len(meshes)))
        meshes.append(replace(mesh, material=renumbered, texcoord=(None, None), colour=None))
    scene = replace(
        bake.scene,
        meshes=tuple(meshes),
        instances=tuple(instances),
        materials=tuple(m for _, m in kinds),
        lights=(),
        source=None,
    )
    packer, uses, _ = new_document(scene, bake.atlas)
    for use in uses:
        del use.primitive["attributes"]["TEXCOORD_1"]
    document = packer.document
    # Filter linearly, without mip levels, which would mix charts.
    document["samplers"] = [{"magFilter": 9729, "minFilter": 9729, "wrapS": 33071, "wrapT": 33071}]
    document["images"], document["textures"] = [], []
    for number, value in enumerate(page):
        opaque = all(m.alpha_mode == "OPAQUE" for p, m in kinds if p == number)
        pixels = srgb_levels(value[..., :3] * np.float32(exposure))
        if not opaque:
            pixels = np.concatenate([pixels, grey_levels(value[..., 3:])], axis=-1)
        view = packer.add_bytes(encode_png(pixels))
        document["images"].append({"bufferView": view, "mimeType": "image/png", "name": f"light_{number}"})
        document["textures"].append({"sampler": 0, "source": number})
    for (number, _), material in zip(kinds, document["materials"], strict=True):
        _unlight(material, number)
    document["extensionsUsed"] = ["KHR_materials_unlit"]
    document["asset"]["extras"] = {"baker": {"exposure": exposure}}
    return packer.glb()


def _unlight(material: Json, page: int) -> None:
    material["pbrMetallicRoughness"] = {
        "baseColorTexture": {"index": page},
        "metallicFactor": 0.0,
        "roughnessFactor": 1.0,
    }
    material["extensions"] = {"KHR_materials_unlit": {}}


def _kind(material: Material) -> Material:
    """Return a white material with the sidedness and alpha mode of `material`; the texture is added later."""
    return Material(
        name="unlit",
        base_colour=(1.0, 1.0, 1.0, 1.0),
        double_sided=material.double_sided,
        alpha_mode=material.alpha_mode,
        alpha_cutoff=material.alpha_cutoff,
    )


def _texel_colour(bake: StoredBake, scene: Scene) -> tuple[TexelBuffer, NDArray[np.float32]]:
    """Return the texel buffer, and the mean base colour of front-side texels, (n_front, 3) float32."""
    geometry = world_geometry(scene, bake.atlas)
    shading = resolve_materials(scene, geometry)
    texels, _ = build_texels(
        geometry, shading, bake.atlas, seed=0, threads=thread_count(None), progress=silent
    )
    return texels, texels.albedo[: texels.n_front]


def _with_materials(scene: Scene, materials: tuple[Material, ...]) -> Scene:
    """Return the scene with other materials and without vertex colours, which multiply base colours."""
    meshes = tuple(replace(mesh, colour=None) for mesh in scene.meshes)
    return replace(scene, materials=materials, meshes=meshes)


def _emissive_only(material: Material) -> Material:
    """Return a material whose base colour is the emission of `material`."""
    return Material(
        base_colour=(*material.emission, 1.0),
        base_colour_texture=material.emission_texture,
        double_sided=material.double_sided,
    )


def _alpha(material: Material) -> Material:
    """Return a material whose base colour is the alpha of `material`, as three equal channels."""
    share, texture = 1.0, None
    if material.alpha_mode != "OPAQUE":
        share = material.base_colour[3]
        texture = None if material.base_colour_texture is None else _alpha_image(material.base_colour_texture)
    return Material(
        base_colour=(share, share, share, 1.0),
        base_colour_texture=texture,
        double_sided=material.double_sided,
    )


def _alpha_image(texture: Texture) -> Texture:
    alpha = texture.image[..., 3:].astype(np.float32)
    if texture.image.dtype == np.uint8:
        alpha = alpha / np.float32(255.0)
    opaque = np.ones_like(alpha)
    return replace(texture, image=np.concatenate([alpha, alpha, alpha, opaque], axis=-1))
