"""The interface of a judgement: evidence of a channel in, figures, a table and remarks out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from baker.core.geometry import Geometry
from baker.io.bake.read_bake import StoredBake
from baker.metrics.groups import Compared
from baker.verification.points import EDGE, SCARCE, STEEP, SUSPECT, TEXEL, Pages, Points
from baker.verification.unjudged import Unjudged

# Texels of which surface covers less, or less lies in the open, are borders.
_COVERED = 0.75
# Tilted: more of the light around a point than this comes from below its facet.
_TILTED = 0.005


@dataclass(frozen=True)
class Evidence:
    """What was measured of a channel.

    Attributes
    ----------
    channel : str
    bake : StoredBake
    geometry : Geometry
    pages : Pages
    points : Points
    compared : Compared
        Stored and path-traced values of all points.
    unjudged : Unjudged
    noisy : (n,) bool
        Points that stayed noisier than asked for.
    """

    channel: str
    bake: StoredBake
    geometry: Geometry
    pages: Pages
    points: Points
    compared: Compared
    unjudged: Unjudged
    noisy: NDArray[np.bool_]

    @property
    def texels(self) -> NDArray[np.bool_]:
        """Return which points are texels, chosen by chance."""
        return np.asarray(self.points.kind == TEXEL)

    @property
    def whole(self) -> NDArray[np.bool_]:
        """Return which points lie in no gap, on texels that open surface covers, and are not tilted.

        The rest counts as edges.
        """
        points = self.points
        covered = points.places.area * points.free >= _COVERED
        return np.asarray(~points.gap & covered & ~self.tilted)

    @property
    def tilted(self) -> NDArray[np.bool_]:
        """Return where the shading normal leans from the facet so far that the two see different light.

        The reference lets no light arrive from below a facet; the bake does, as a curved surface would. Of
        a cosine-weighted hemisphere around a normal that leans by t this is (1 - cos t) / 2.
        """
        places = self.points.places
        lean = (places.normal * places.face_normal).sum(axis=2).mean(axis=1)
        return np.asarray(0.5 * (1.0 - lean) > _TILTED)

    @property
    def edges(self) -> NDArray[np.bool_]:
        """Return which points lie at edges."""
        return np.asarray(self.points.kind == EDGE)

    @property
    def suspects(self) -> NDArray[np.bool_]:
        """Return which points are texels that stand out."""
        return np.asarray(self.points.kind == SUSPECT)

    @property
    def steep(self) -> NDArray[np.bool_]:
        """Return which points are texels where light changes most."""
        return np.asarray(self.points.kind == STEEP)

    @property
    def scarce(self) -> NDArray[np.bool_]:
        """Return which points are texels of light levels that have few."""
        return np.asarray(self.points.kind == SCARCE)

    @property
    def stored(self) -> NDArray[np.float32]:
        """Return the channel's pages (P, H, W, C)."""
        return self.bake.maps[self.channel]


@dataclass(frozen=True)
class Judged:
    """What a judgement found in one channel.

    Attributes
    ----------
    figures : dict
        By the names that the judgement promises.
    remarks : dict of figure to str
        A sentence that says what is wrong, for figures that are far from what a sound bake shows.
    rows : list of dict
        A table, worst first.
    """

    figures: dict[str, Any]
    remarks: dict[str, str] = field(default_factory=dict)
    rows: list[dict[str, Any]] = field(default_factory=list)


class Judgement(NamedTuple):
    """A kind of fault.

    name : of its table; figures : names that `judge` gives, all of them always; limits : by channel, what
    the figures are held against by default; judge : evidence in, what was found out.
    """

    name: str
    figures: tuple[str, ...]
    limits: dict[str, str]
    judge: Callable[[Evidence], Judged]
