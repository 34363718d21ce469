"""Finds the emissive triangles, and the mean radiance of each triangle or of parts of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baker.checks.world_triangles import WorldTriangles
from baker.core.scene import Texture

# Triangles with an emissive texture are subdivided into parts. Upper limit of the number of parts of all
# these triangles minus the number of these triangles.
_MOST_PARTS = 2048


@dataclass(frozen=True)
class Emission:
    """E emitting surfaces: triangles without emissive texture, and parts of triangles with emissive texture.

    Attributes
    ----------
    triangle : (E,) int64
        Index of the triangle in `WorldTriangles`.
    inside : (E, 3) float64
        Position and size of the part in the triangle: barycentrics (b1, b2) of the part's corner 0, and edge
        length of the part divided by that of the triangle. (0, 0, 1) is the whole triangle. See
        `baker.lights.emissive_texture.Parts`.
    radiance : (E, 3) float64, cd/m2
        Mean over the part.
    area : (E,) float64, m2
        Area of the part.
    """

    triangle: NDArray[np.int64]
    inside: NDArray[np.float64]
    radiance: NDArray[np.float64]
    area: NDArray[np.float64]


def find_emission(world: WorldTriangles) -> Emission:
    """Return the emitting triangles and parts of triangles; parts whose texture is black are left out."""
    materials = world.materials
    factor = np.array([m.emission for m in materials], np.float64).reshape(-1, 3)
    emits = np.flatnonzero((factor.max(axis=1, initial=0.0) > 0)[world.material] & (world.area > 0))
    textured = np.array([m.emission_texture is not None for m in materials], bool)[world.material[emits]]
    untextured, image = emits[~textured], emits[textured]
    triangle, inside = untextured, np.tile([0.0, 0.0, 1.0], (len(untextured), 1))
    radiance = factor[world.material[untextured]]
    if len(image):
        # Import these modules only for files with emissive textures, because they compile kernels.
        from baker.kernels.textures import PackImage, pack_textures
        from baker.lights.emissive_texture import EmissiveTextures, cut

        used = [int(k) for k in np.unique(world.material[image])]
        textures = [t for k in used if (t := materials[k].emission_texture) is not None]
        number = np.searchsorted(used, world.material[image])
        pack = pack_textures([PackImage(t.image, t.wrap, t.nearest) for t in textures])
        uv = np.zeros((len(image), 3, 2))
        for k, texture in enumerate(textures):
            uv[number == k] = _image_uv(world, image[number == k], texture)
        shone = EmissiveTextures(pack, number, factor[world.material[image]], uv)
        parts = cut(shone, world.area[image], np.zeros(len(image)), _MOST_PARTS)
        triangle = np.concatenate([triangle, image[parts.owner]])
        inside, radiance = np.concatenate([inside, parts.inside]), np.concatenate([radiance, parts.mean])
    return Emission(triangle, inside, radiance, world.area[triangle] * inside[:, 2] ** 2)


def _image_uv(world: WorldTriangles, triangle: NDArray[np.int64], texture: Texture) -> NDArray[np.float64]:
    """Return the texture uv of the corners of n triangles, (n, 3, 2) float64.

    The uv are 0 on primitives that lack the texture's uv set.
    """
    out = np.zeros((len(triangle), 3, 2))
    for k in np.unique(world.instance[triangle]):
        own = np.flatnonzero(world.instance[triangle] == k)
        instance = world.instances[k]
        facts = world.meshes[instance.mesh]
        sets = [p.texcoord.get(texture.texcoord) for p in facts.source.primitives]
        known = [
            np.zeros((len(p.position), 2)) if uv is None or len(uv) != len(p.position) else uv
            for p, uv in zip(facts.source.primitives, sets, strict=True)
        ]
        corner = facts.triangle[world.face[triangle[own]]]
        if np.linalg.det(instance.world_from_object[:3, :3]) < 0:
            corner = corner[:, ::-1]
        given = np.array([uv is not None for uv in sets])[facts.primitive[world.face[triangle[own]]]]
        uv = np.concatenate(known)[corner].astype(np.float64)
        uv = np.where(np.isfinite(uv), uv, 0.0)
        moved = uv @ texture.transform[:, :2].T + texture.transform[:, 2]
        out[own] = np.where(given[:, None, None], moved, 0.0)
    return out
