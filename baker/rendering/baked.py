"""Computes the radiance of surfaces lit by a bake, with bilinear lookups of the lightmaps as in engines."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from baker.core.errors import InputError
from baker.core.geometry import Geometry, world_geometry
from baker.core.scene import SceneWarning
from baker.io.bake.read_bake import SCENE_NAME, StoredBake, read_bake
from baker.io.load import load_scene
from baker.io.scene_hash import scene_sha256
from baker.pathtracer.first_hit import FirstHits
from baker.pathtracer.scene import EMISSION, SHINES, Reference
from baker.pathtracer.vertex import multiply_emission_texture
from baker.trace.jit import kernel, scratch
from baker.trace.kernel_cache import keep_kernels

keep_kernels(__file__, "baker.trace", "baker.kernels", "baker.pathtracer")

_new_value, _new_rgba = scratch((3,), np.float64), scratch((4,), np.float64)


@dataclass(frozen=True)
class BakedLight:
    """A finished bake as the light of a picture.

    Attributes
    ----------
    bake : StoredBake
        The bake, read from its output folder.
    geometry : Geometry
        World geometry of the baked scene, with the lightmap uv of the bake.
    """

    bake: StoredBake
    geometry: Geometry

    @classmethod
    def read(cls, folder: Path) -> BakedLight:
        """Read an output folder.

        Raises
        ------
        InputError
            If the folder contains no bake, or the bake has no irradiance.
        """
        bake = read_bake(folder)
        if "irradiance" not in bake.maps:
            raise InputError("the bake holds no irradiance to light the scene with", file=str(folder))
        return cls(bake, world_geometry(bake.scene, bake.atlas))

    def radiance(self, reference: Reference, hits: FirstHits) -> NDArray[np.float64]:
        """Return the radiance (n, 3), cd/m2, from n first hits towards the camera.

        It is 0 for rays without a hit, and for hits on backs of one-sided surfaces.
        """
        light = np.zeros((len(hits.triangle), 3))
        lit = np.flatnonzero(hits.lit)
        triangle, bary = hits.triangle[lit], hits.bary[lit]
        weight = np.stack([1 - bary.sum(axis=1), bary[:, 0], bary[:, 1]], axis=1)
        uv = np.einsum("nk,nka->na", weight, self.geometry.uv[self.geometry.triangle[triangle]].astype(float))
        irradiance = bilinear(self.bake.maps["irradiance"], self.geometry.page[triangle], uv)
        receives = np.array([layout.receives for layout in self.bake.atlas.layouts], bool)
        irradiance[~receives[self.geometry.instance[triangle]]] = 0.0
        light[lit] = hits.albedo[lit] * irradiance / math.pi
        surface = reference.surfaces.row
        emitting = np.flatnonzero(hits.lit & (surface[hits.triangle, SHINES] > 0))
        add_emission(emitting, surface, hits.triangle, hits.bary, reference.shading, light)
        return light


@kernel
def add_emission(chosen, surface, triangle, bary, shading, light):  # type: ignore[no-untyped-def]
    """Add the emitted radiance of the hits `chosen` to `light`.

    chosen : (m,) int64, indices of hits; surface : (T, 32) float32, see `Surfaces.row`
    triangle : (n,) int32, triangle of each hit; bary : (n, 2) float64, barycentrics of each hit
    light : (n, 3) float64, in and out, cd/m2
    """
    value, rgba = _new_value(), _new_rgba()
    for i in chosen:
        for c in range(3):
            value[c] = surface[triangle[i], EMISSION + c]
        multiply_emission_texture(shading, triangle[i], bary[i, 0], bary[i, 1], value, rgba, False)
        for c in range(3):
            light[i, c] += value[c]


def other_scene(bake: StoredBake, scene: Path, *, allow_outside: bool) -> list[SceneWarning]:
    """Return one warning if a scene file differs from the baked file, else an empty list.

    `allow_outside` decides whether files outside the folder of the scene may be read.

    Raises
    ------
    InputError
        If the file cannot be read.
    """
    own = bake.folder / SCENE_NAME
    known = bake.manifest.get("input", {}).get("sha256")
    if scene.exists() and scene.samefile(own):
        return []
    if scene_sha256(scene, allow_outside=allow_outside) == known:
        return []
    load_scene(scene, allow_outside=allow_outside)
    message = f"'{scene}' is not what '{bake.folder}' was baked from; the picture shows the baked scene"
    return [SceneWarning("other-scene", message)]


def bilinear(
    pages: NDArray[np.float32], page: NDArray[np.int32], uv: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the values (n, C) of pages (P, H, W, C) at n points, interpolated bilinearly.

    page : (n,) int32, page of each point; uv : (n, 2) float64, page uv of each point, v = 0 at the first row
    """
    height, width = pages.shape[1:3]
    # Clip before the conversion to integers, because uv far outside the page would overflow.
    x, y = (np.clip(uv[:, axis] * size - 0.5, -1, size) for axis, size in ((0, width), (1, height)))
    left, top = np.floor(x).astype(np.int64), np.floor(y).astype(np.int64)
    total = np.zeros((len(uv), pages.shape[3]))
    for down in range(2):
        for right in range(2):
            row, column = np.clip(top + down, 0, height - 1), np.clip(left + right, 0, width - 1)
            weight = np.abs(1 - down - (y - top)) * np.abs(1 - right - (x - left))
            total += weight[:, None] * pages[page, row, column]
    return total
