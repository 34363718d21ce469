"""The interface of a criterion: the data of a channel in, metrics, a table and remarks out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from baker.core.geometry import Geometry
from baker.io.bake.read_bake import StoredBake
from baker.metrics.groups import ComparedPoints
from baker.verification.points import EDGE, OUTLIER, SCARCE, STEEP, TEXEL, Pages, Points
from baker.verification.unverified_area import UnverifiedArea

# Smallest share of a texel's square, covered by surface with valid points, of a texel that is no border.
_MIN_COVERED = 0.75
# Largest share of the light around a point that may come from below its facet.
_MAX_BELOW = 0.005


@dataclass(frozen=True)
class ChannelData:
    """Measurements of a channel at n points.

    Attributes
    ----------
    channel : str
        Its name.
    bake : StoredBake
        The verified bake.
    geometry : Geometry
        Its triangles.
    pages : Pages
        The texels of all pages.
    points : Points
        The compared points.
    compared : ComparedPoints
        Stored and path-traced values at all points.
    unverified : UnverifiedArea
        Surface without compared texels.
    noisy : (n,) bool
        Points whose reference did not reach the target standard error.
    """

    channel: str
    bake: StoredBake
    geometry: Geometry
    pages: Pages
    points: Points
    compared: ComparedPoints
    unverified: UnverifiedArea
    noisy: NDArray[np.bool_]

    @property
    def texels(self) -> NDArray[np.bool_]:
        """Return which points (n,) are randomly chosen texels."""
        return np.asarray(self.points.kind == TEXEL)

    @property
    def interior(self) -> NDArray[np.bool_]:
        """Return which points (n,) are not in gaps, not tilted, and mostly covered by valid surface.

        All others are compared as edges.
        """
        points = self.points
        covered = points.surface.area * points.valid_share >= _MIN_COVERED
        return np.asarray(~points.gap & covered & ~self.tilted)

    @property
    def tilted(self) -> NDArray[np.bool_]:
        """Return where (n,) shading and face normal differ so much that their irradiance differs.

        The reference has no light from below a facet; the bake has, as a curved surface would. Of a
        cosine-weighted hemisphere around a normal that is tilted by t this share is (1 - cos t) / 2.
        """
        surface = self.points.surface
        cosine = (surface.normal * surface.face_normal).sum(axis=2).mean(axis=1)
        return np.asarray(0.5 * (1.0 - cosine) > _MAX_BELOW)

    @property
    def edges(self) -> NDArray[np.bool_]:
        """Return which points (n,) lie at edges."""
        return np.asarray(self.points.kind == EDGE)

    @property
    def outliers(self) -> NDArray[np.bool_]:
        """Return which points (n,) are texels that differ from all their neighbours."""
        return np.asarray(self.points.kind == OUTLIER)

    @property
    def steep(self) -> NDArray[np.bool_]:
        """Return which points (n,) are texels where light changes most."""
        return np.asarray(self.points.kind == STEEP)

    @property
    def scarce(self) -> NDArray[np.bool_]:
        """Return which points (n,) are additional texels of light levels with few texels."""
        return np.asarray(self.points.kind == SCARCE)

    @property
    def stored(self) -> NDArray[np.float32]:
        """Return the channel's pages (P, H, W, C)."""
        return self.bake.maps[self.channel]


@dataclass(frozen=True)
class CriterionResult:
    """The result of a criterion for one channel.

    Attributes
    ----------
    metrics : dict of str to number or None
        By the names in `Criterion.metrics`.
    remarks : dict of str to str
        By name of a metric, a sentence about the fault that it indicates.
    rows : list of dict
        A table, worst first.
    """

    metrics: dict[str, Any]
    remarks: dict[str, str] = field(default_factory=dict)
    rows: list[dict[str, Any]] = field(default_factory=list)


class Criterion(NamedTuple):
    """The test for one kind of fault.

    Attributes
    ----------
    name : str
        Name of its table.
    metrics : tuple of str
        Names of the metrics that `evaluate` returns, always all.
    limits : dict of str to str
        Default limits on these metrics, by channel.
    evaluate : callable
        Computes the result of a channel.
    """

    name: str
    metrics: tuple[str, ...]
    limits: dict[str, str]
    evaluate: Callable[[ChannelData], CriterionResult]
