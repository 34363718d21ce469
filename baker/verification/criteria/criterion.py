"""Defines the interface of criteria, which compute metrics, a table and remarks from a channel's data."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from baker.core.geometry import Geometry
from baker.io.bake.read_bake import StoredBake
from baker.metrics.groups import ComparedPoints
from baker.verification.points import EDGE, OUTLIER, SCARCE, STEEP, TEXEL, Pages, Points
from baker.verification.unverified_area import UnverifiedArea

# Smallest share of an interior texel's square that is covered by surface with valid points, see
# `ChannelData.interior`.
_MIN_COVERED = 0.75
# Share of a cosine-weighted hemisphere around the shading normal that lies below the facet. Above this share,
# a point counts as tilted.
_MAX_BELOW = 0.005


@dataclass(frozen=True)
class ChannelData:
    """Measurements of a channel at n points.

    Attributes
    ----------
    channel : str
        Name of the channel.
    bake : StoredBake
        The verified bake.
    geometry : Geometry
        Triangles of the bake.
    pages : Pages
        The texels of all pages.
    points : Points
        The n points.
    compared : ComparedPoints
        Stored and path-traced values at the points.
    unverified : UnverifiedArea
        Area of the surface without compared texels.
    noisy : (n,) bool
        Points whose reference is too noisy for a comparison.
    """

    channel: str
    bake: StoredBake
    geometry: Geometry
    pages: Pages
    points: Points
    compared: ComparedPoints
    unverified: UnverifiedArea
    noisy: NDArray[np.bool_]

    @cached_property
    def texels(self) -> NDArray[np.bool_]:
        """Return (n,) bool: the points that are randomly chosen texels."""
        return np.asarray(self.points.kind == TEXEL)

    @cached_property
    def interior(self) -> NDArray[np.bool_]:
        """Return (n,) bool: points outside gaps, not tilted, in texels covered to at least `_MIN_COVERED`.

        Deviations of light levels, regions, objects and charts are computed at these points only.
        """
        points = self.points
        covered = points.surface.area * points.valid_share >= _MIN_COVERED
        return np.asarray(~points.gap & covered & ~self.tilted)

    @cached_property
    def tilted(self) -> NDArray[np.bool_]:
        """Return (n,) bool: the points whose shading normal is tilted against the face normal (`_MAX_BELOW`).

        At these points, bake and reference differ: the bake includes light from below the facet, as on a
        curved surface, and the reference does not. If the shading normal is tilted by an angle t, the share
        (1 - cos t) / 2 of the cosine-weighted hemisphere around it lies below the facet.
        """
        surface = self.points.surface
        cosine = (surface.normal * surface.face_normal).sum(axis=2).mean(axis=1)
        return np.asarray(0.5 * (1.0 - cosine) > _MAX_BELOW)

    @cached_property
    def edges(self) -> NDArray[np.bool_]:
        """Return (n,) bool: the points at edges."""
        return np.asarray(self.points.kind == EDGE)

    @cached_property
    def outliers(self) -> NDArray[np.bool_]:
        """Return (n,) bool: the points that are texels which differ from all their neighbours."""
        return np.asarray(self.points.kind == OUTLIER)

    @cached_property
    def steep(self) -> NDArray[np.bool_]:
        """Return (n,) bool: the points that are texels with the largest gradients of light."""
        return np.asarray(self.points.kind == STEEP)

    @cached_property
    def scarce(self) -> NDArray[np.bool_]:
        """Return (n,) bool: the points that are additional texels of light levels with few random texels."""
        return np.asarray(self.points.kind == SCARCE)

    @property
    def stored(self) -> NDArray[np.float32]:
        """Return the channel's stored pages (P, H, W, C)."""
        return self.bake.maps[self.channel]


@dataclass(frozen=True)
class CriterionResult:
    """The result of a criterion for one channel.

    Attributes
    ----------
    metrics : dict of str to number or None
        Values of the metrics in `Criterion.metrics`, and possibly of further metrics, by name.
    remarks : dict of str to str
        Sentences by metric, each about the fault that the metric indicates.
    rows : list of dict
        Rows of a table, if the criterion has a table.
    """

    metrics: dict[str, Any]
    remarks: dict[str, str] = field(default_factory=dict)
    rows: list[dict[str, Any]] = field(default_factory=list)


class Criterion(NamedTuple):
    """The test for one kind of fault.

    Attributes
    ----------
    name : str
        Name of the criterion and of its table.
    metrics : tuple of str
        Names of the metrics that `evaluate` always returns.
    limits : dict of str to str
        Default limits on these metrics, by channel.
    evaluate : callable
        evaluate(data) returns the CriterionResult of a channel.
    """

    name: str
    metrics: tuple[str, ...]
    limits: dict[str, str]
    evaluate: Callable[[ChannelData], CriterionResult]
