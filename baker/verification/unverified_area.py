"""Measures the area of surfaces that `verify` cannot compare, because the bake has no valid texel there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baker.core.geometry import Geometry
from baker.core.lightmap import TexelStatus
from baker.io.bake.read_bake import StoredBake
from baker.metrics.texel_area import surface_points
from baker.pathtracer.scene import Reference
from baker.verification.points import Pages
from baker.verification.surroundings import visible

# Largest number of invalid texels whose visibility is tested, and number of points in each texel.
_TESTED, _POINTS = 400, 4


@dataclass(frozen=True)
class UnverifiedArea:
    """Areas of the surface that is not compared, and of the whole surface, m2.

    Attributes
    ----------
    total : float
        Area of all triangles, one side only.
    invalid : float
        Area on invalid texels, which the bake filled from their neighbours.
    visible : float
        Part of `invalid` that is visible from points in the air. The bake should have computed its light.
    uncovered : float
        Area on texels for which the bake computed no value and which it did not mark as invalid (status EMPTY
        or DILATED).
    """

    total: float
    invalid: float
    visible: float
    uncovered: float


def measure_unverified_area(
    reference: Reference,
    bake: StoredBake,
    geometry: Geometry,
    pages: Pages,
    air: NDArray[np.float64],
    seed: int,
) -> UnverifiedArea:
    """Measure the areas of `UnverifiedArea`.

    Parameters
    ----------
    reference : Reference
        The scene of the path tracer.
    bake : StoredBake
        The verified bake.
    geometry : Geometry
        Triangles of the bake.
    pages : Pages
        The texels of all pages.
    air : (m, 3) float64, metres, relative to the geometry's origin
        Points in the air between surfaces, see `baker.verification.surroundings`.
    seed : int
        Seed of the random choice.

    Returns
    -------
    UnverifiedArea
        Areas in m2.
    """
    size = bake.atlas.resolution
    on = pages.owner >= 0
    invalid = np.flatnonzero((on & (bake.status == TexelStatus.INVALID)).reshape(-1))
    lost = np.flatnonzero((on & ~pages.covered & (bake.status != TexelStatus.INVALID)).reshape(-1))
    area = surface_points(geometry, invalid, size, _POINTS, seed).surface
    share = 0.0
    if len(invalid) and len(air):
        random = np.random.Generator(np.random.PCG64([seed, 13]))
        some = np.sort(random.permutation(len(invalid))[:_TESTED])
        points = surface_points(geometry, invalid[some], size, _POINTS, seed)
        seen = visible(reference, air, points.position[:, 0], points.face_normal[:, 0]).any(axis=0)
        share = float((seen * area[some]).sum() / max(area[some].sum(), 1e-30))
    return UnverifiedArea(
        total=float(geometry.area.sum(dtype=np.float64)),
        invalid=float(area.sum()),
        visible=share * float(area.sum()),
        uncovered=float(surface_points(geometry, lost, size, _POINTS, seed).surface.sum()),
    )
