"""Computes the FLIP error of the pages of bake a against the values of bake b at the same surface points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baker.comparison.match import ComparedSurfaces, TrianglePoints, match
from baker.core.geometry import Geometry
from baker.core.progress import Progress, report
from baker.core.stage import Stage
from baker.io.bake.read_bake import StoredBake
from baker.metrics.flip import flip_error
from baker.metrics.texel_area import look_up_uv, one_surface_point

# Largest number of rows and columns for which FLIP is computed. Rows and columns of larger pages are left
# out, because FLIP takes two seconds for 512 x 512 texels.
_LARGEST = 512


@dataclass(frozen=True)
class FlipMeans:
    """Means of the FLIP error, 0 to 1.

    Attributes
    ----------
    channel : dict of str to float or None
        Mean over all compared texels, by channel; None if no texel is compared.
    object : dict of (str, int) to float
        Mean over the compared texels of an instance of a, by channel and instance.
    """

    channel: dict[str, float | None]
    object: dict[tuple[str, int], float]


def read(bake: StoredBake, geometry: Geometry, points: TrianglePoints, name: str) -> NDArray[np.float64]:
    """Look up the map of channel `name` bilinearly at n surface points, (n, C) float64."""
    return look_up_uv(bake.maps[name], geometry.page[points.triangle], points.at(geometry, "uv"))


def page_flip(
    a: StoredBake,
    b: StoredBake,
    sides: ComparedSurfaces,
    compared: NDArray[np.bool_],
    names: list[str],
    seed: int,
    progress: Progress,
) -> FlipMeans:
    """Compute the FLIP error of all pages, and average it over texels with a matching surface point in b.

    Parameters
    ----------
    a, b : StoredBake
        The bakes. b is the reference.
    sides : ComparedSurfaces
        Their surfaces.
    compared : (P, H, W) bool
        Texels of a at which the bakes are compared.
    names : list of str
        The channels.
    seed : int
        Seed of the random point in each texel.
    progress : Progress
    """
    size, pages = a.atlas.resolution, a.atlas.n_pages
    step = -(-size // _LARGEST)
    total = {name: np.zeros((2, len(a.scene.instances))) for name in names}
    for number in range(pages):
        row, column = np.nonzero(compared[number, ::step, ::step])
        if not len(row):
            continue
        pixel = (number * size + row * step) * size + column * step
        points = TrianglePoints(*one_surface_point(sides.a, pixel.astype(np.int64), size, seed))
        other = match(sides, points)
        met = other.triangle >= 0
        row, column, points, other = row[met], column[met], points[met], other[met]
        owner = sides.a.instance[points.triangle]
        for i, name in enumerate(names):
            report(progress, Stage.PICTURES, (number + i / len(names)) / pages)
            side = -(-size // step)
            stored = np.zeros((side, side, a.maps[name].shape[3]), np.float32)
            reference = np.zeros((side, side, b.maps[name].shape[3]), np.float32)
            stored[row, column] = read(a, sides.a, points, name)
            reference[row, column] = read(b, sides.b, other, name)
            if np.array_equal(stored, reference):
                error = np.zeros((side, side), np.float32)
            else:
                error = flip_error(reference, stored)[0]
            count = len(a.scene.instances)
            total[name][0] += np.bincount(owner, error[row, column].astype(np.float64), count)
            total[name][1] += np.bincount(owner, minlength=count)
    return FlipMeans(
        {name: float(s.sum() / n.sum()) if n.any() else None for name, (s, n) in total.items()},
        {(name, int(i)): float(s[i] / n[i]) for name, (s, n) in total.items() for i in np.flatnonzero(n)},
    )
