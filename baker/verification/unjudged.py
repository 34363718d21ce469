"""Surface that is not judged, in square metres: without measured texels, or filled from neighbours."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baker.core.geometry import Geometry
from baker.core.lightmap import TexelStatus
from baker.io.bake.read_bake import StoredBake
from baker.metrics.texel_area import texel_places
from baker.pathtracer.scene import Reference
from baker.verification.points import Pages
from baker.verification.surroundings import visible

# Invalid texels that are looked at, to tell how many of them can be seen; places in each that give its area.
_LOOKED, _PLACES = 400, 4


@dataclass(frozen=True)
class Unjudged:
    """Areas in m2.

    Attributes
    ----------
    total : float
        All surface, fronts.
    invalid : float
        Texels that the bake filled from neighbours, as buried.
    visible : float
        Of these, what can be seen from the air between surfaces: it should have light of its own.
    uncovered : float
        Surface on texels that hold nothing measured.
    """

    total: float
    invalid: float
    visible: float
    uncovered: float


def measure_unjudged(
    reference: Reference,
    bake: StoredBake,
    geometry: Geometry,
    pages: Pages,
    air: NDArray[np.float64],
    seed: int,
) -> Unjudged:
    """Measure what no judged texel stands for.

    Parameters
    ----------
    air : (m, 3) float64
        Points in the air.
    """
    size = bake.atlas.resolution
    on = pages.owner >= 0
    invalid = np.flatnonzero((on & (bake.status == TexelStatus.INVALID)).reshape(-1))
    lost = np.flatnonzero((on & ~pages.covered & (bake.status != TexelStatus.INVALID)).reshape(-1))
    area = texel_places(geometry, invalid, size, _PLACES, seed).surface
    share = 0.0
    if len(invalid) and len(air):
        random = np.random.Generator(np.random.PCG64([seed, 13]))
        some = np.sort(random.permutation(len(invalid))[:_LOOKED])
        places = texel_places(geometry, invalid[some], size, _PLACES, seed)
        seen = visible(reference, air, places.position[:, 0], places.face_normal[:, 0]).any(axis=0)
        share = float((seen * area[some]).sum() / max(area[some].sum(), 1e-30))
    return Unjudged(
        total=float(geometry.area.sum(dtype=np.float64)),
        invalid=float(area.sum()),
        visible=share * float(area.sum()),
        uncovered=float(texel_places(geometry, lost, size, _PLACES, seed).surface.sum()),
    )
