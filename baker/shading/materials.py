"""Builds `Shading`: factors and textures of all materials; image uv and colour of each lightmap vertex."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from baker.core.geometry import Geometry
from baker.core.scene import LARGEST_UV, Scene, Texture
from baker.kernels.shading import Shading
from baker.kernels.textures import PackImage, pack_textures
from baker.shading.alpha import build_alpha

# Largest base colour. A valid base colour is at most 1; with much larger ones, sums over bounces overflow.
LARGEST_ALBEDO = 100.0


def resolve_materials(scene: Scene, geometry: Geometry, *, reflections: bool = False) -> Shading:
    """Pack the textures of all materials, and compute the image uv of every lightmap vertex.

    Parameters
    ----------
    scene : Scene
        Materials and meshes.
    geometry : Geometry
        Triangles of the scene.
    reflections : bool
        Whether to include metallic-roughness textures, which bakes do not use.

    Returns
    -------
    Shading
        Materials for kernels.
    """
    images: list[PackImage] = []
    numbers: dict[tuple[int, tuple[str, str], bool, bool], int] = {}

    def number(texture: Texture | None, linear: bool = False, sharp: bool = False) -> int:
        if texture is None:
            return -1
        # Use nearest filtering for emission only. For base colour, the difference is not visible in a bake.
        sharp = sharp and texture.nearest
        key = (id(texture.image), texture.wrap, linear, sharp)
        if key not in numbers:
            numbers[key] = len(images)
            images.append(PackImage(texture.image, texture.wrap, sharp, linear))
        return numbers[key]

    base = np.array([m.base_colour[:3] for m in scene.materials], np.float64).reshape(-1, 3)
    base[np.array([not m.reflects for m in scene.materials], bool)] = 0.0
    base_texture = np.array([number(m.base_colour_texture) for m in scene.materials], np.int32)
    emission_texture = np.array([number(m.emission_texture, sharp=True) for m in scene.materials], np.int32)
    glossy = [m.metallic_roughness_texture if reflections else None for m in scene.materials]
    reflection_texture = np.array([number(texture, linear=True) for texture in glossy], np.int32)
    pack = pack_textures(images)
    base_uv = corner_uv(scene, geometry, [m.base_colour_texture for m in scene.materials])
    return Shading(
        pack=pack,
        base=np.minimum(base, LARGEST_ALBEDO).astype(np.float32),
        emission=np.array([m.emission for m in scene.materials], np.float32).reshape(-1, 3),
        base_texture=base_texture,
        emission_texture=emission_texture,
        base_uv=base_uv,
        emission_uv=corner_uv(scene, geometry, [m.emission_texture for m in scene.materials]),
        colour=np.ascontiguousarray(vertex_colour(scene, geometry)[:, :3]),
        triangle=geometry.triangle,
        material=geometry.material,
        alpha=build_alpha(scene, geometry, pack, base_texture, base_uv),
        metallic=np.array([m.metallic for m in scene.materials], np.float32),
        roughness=np.array([m.roughness for m in scene.materials], np.float32),
        reflection_texture=reflection_texture,
        reflection_uv=corner_uv(scene, geometry, glossy),
    )


def corner_uv(scene: Scene, geometry: Geometry, textures: list[Texture | None]) -> NDArray[np.float32]:
    """Return the image uv of each lightmap vertex.

    Parameters
    ----------
    scene : Scene
        Meshes.
    geometry : Geometry
        Triangles of the scene.
    textures : list of Texture or None
        Texture of each material.

    Returns
    -------
    (V, 2) float32
        Image uv, 0 for vertices without a texture; (1, 2) if no material has a texture.
    """
    if all(texture is None for texture in textures):
        return np.zeros((1, 2), np.float32)
    uv = np.zeros((len(geometry.position), 2), np.float32)
    bound = np.searchsorted(geometry.instance, np.arange(len(scene.instances) + 1))
    for index, instance in enumerate(scene.instances):
        mesh = scene.meshes[instance.mesh]
        span = slice(bound[index], bound[index + 1])
        for material in np.unique(geometry.material[span]):
            texture = textures[material]
            if texture is None or texture.texcoord >= len(mesh.texcoord):
                continue
            coordinate = mesh.texcoord[texture.texcoord]
            if coordinate is None:
                continue
            vertex = np.unique(geometry.triangle[span][geometry.material[span] == material])
            source = coordinate[geometry.vertex_source[vertex]].astype(np.float64)
            with np.errstate(over="ignore", invalid="ignore"):
                image_uv = source @ texture.transform[:, :2].T + texture.transform[:, 2]
            uv[vertex] = np.clip(np.nan_to_num(image_uv), -LARGEST_UV, LARGEST_UV)
    return uv


def vertex_colour(scene: Scene, geometry: Geometry) -> NDArray[np.float32]:
    """Return the vertex colours of lightmap vertices.

    Parameters
    ----------
    scene : Scene
        Meshes.
    geometry : Geometry
        Triangles of the scene.

    Returns
    -------
    (V, 4) float32
        Linear RGB and alpha, 1 without vertex colours; shape (1, 4) if no mesh has vertex colours.
    """
    if all(scene.meshes[i.mesh].colour is None for i in scene.instances):
        return np.ones((1, 4), np.float32)
    colour = np.ones((len(geometry.position), 4), np.float32)
    bound = np.searchsorted(geometry.instance, np.arange(len(scene.instances) + 1))
    for index, instance in enumerate(scene.instances):
        source = scene.meshes[instance.mesh].colour
        if source is not None:
            vertex = np.unique(geometry.triangle[bound[index] : bound[index + 1]])
            colour[vertex] = source[geometry.vertex_source[vertex]]
    return colour
