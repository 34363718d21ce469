"""Assigns regions to invalid texels, which are later filled from neighbours of the same region.

Invalid texels are texels whose points are all inside geometry. Regions are the parts of a chart that other
surfaces separate (`radiosity.sides`). For example, a ceiling continues over a wall between a dark room and
the bright outside. The ceiling's texels above the wall are invalid. Engines interpolate between texel
centres, so a lookup on the ceiling of the room near the wall reads these texels. If they were filled with
light from outside, the ceiling would show a bright line.

A bilinear lookup at a point of a neighbouring texel reads the invalid texel with a certain weight. For each
region, these weights are summed over all valid points of the neighbours in the region. The invalid texel gets
the region with the largest sum. If all sums are 0, the texel gets the region of the nearest texel of its
chart that has a region.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from baker.core.texels import TexelBuffer
from baker.kernels.surface import N_POINTS, Surface, place_points
from baker.radiosity.kernels.regions import flood_regions

_EVERY = np.arange(N_POINTS, dtype=np.uint8)[None]
_RING = [(r, c) for r in (-1, 0, 1) for c in (-1, 0, 1) if r or c]


def lend_regions(
    texels: TexelBuffer, surface: Surface, region: NDArray[np.int32], valid_points: NDArray[np.uint16]
) -> None:
    """Assign regions to invalid texels.

    Parameters
    ----------
    texels : TexelBuffer
        All entries; only the front texels, which are stored in the page, are read.
    surface : Surface
        The same entries as arrays for kernels.
    region : (n_front,) int32
        Region of each front texel; changed in place where `valid_points` is 0.
    valid_points : (n_front,) uint16
        Bit k is set where point k of the texel is valid.
    """
    valid = valid_points != 0
    pixels = texels.resolution**2
    page_of = texels.pixel[: texels.n_front] // pixels
    for page in np.unique(page_of[~valid]):
        own = page_of == page
        chart = texels.page_image(texels.chart[: texels.n_front], fill=-1, page=int(page))
        image = texels.page_image(np.where(valid, region, -1), fill=-1, page=int(page))
        number = texels.page_image(np.arange(texels.n_front), fill=-1, page=int(page))
        invalid = np.argwhere((chart >= 0) & (image < 0))
        key, weight = _lookups(
            invalid, chart, image, _visible_points(texels, surface, valid_points, invalid, number)
        )
        _choose(invalid, image, key, weight)
        flood_regions(chart, image, np.zeros(pixels, np.int64))
        grown = image.reshape(-1)[texels.pixel[: texels.n_front][own] - page * pixels]
        region[own] = np.where(grown >= 0, grown, region[own])


def _ring_of(invalid: NDArray[np.int64], turn: tuple[int, int], size: int) -> tuple[NDArray[np.int64], ...]:
    """Return the rows (b,) and columns (b,) of one neighbour of each invalid texel, clipped to the page.

    invalid : (b, 2) int64, row and column of texels; turn : row and column offset of the neighbour
    """
    row, column = (np.clip(invalid[:, k] + turn[k], 0, size - 1) for k in (0, 1))
    return row, column


def _visible_points(
    texels: TexelBuffer,
    surface: Surface,
    valid_points: NDArray[np.uint16],
    invalid: NDArray[np.int64],
    number: NDArray[np.int64],
) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.bool_]]:
    """Return the points of the m valid texels that are neighbours of invalid texels.

    invalid : (b, 2) int64, row and column of the invalid texels of one page
    number : (H, W) int64, front entry of each pixel of the page, -1 for none

    Returns
    -------
    row_of : (H, W) int64, row of `point` and `seen` for each pixel, -1 for pixels that are not among the m
    point : (m, 16, 2) float64, column and row of the points relative to their texel's centre, texels
    seen : (m, 16) bool, whether each point is valid
    """
    near = [number[_ring_of(invalid, turn, texels.resolution)] for turn in _RING]
    chosen = np.unique(np.concatenate(near))
    chosen = chosen[chosen >= 0]
    chosen = chosen[valid_points[chosen] != 0]
    shape = (len(chosen), N_POINTS)
    point, normal = np.zeros((*shape, 3), np.float32), np.zeros((*shape, 3), np.float32)
    triangle, bary = np.zeros(shape, np.int32), np.zeros((*shape, 2), np.float32)
    every = np.full(len(texels.pixel), 0xFFFF, np.uint16)
    place_points(surface, every, chosen, _EVERY, point, normal, triangle, bary)
    weight = np.stack([1.0 - bary.sum(axis=2), bary[..., 0], bary[..., 1]], axis=2)
    uv = surface.uv[surface.triangle[triangle]].astype(np.float64)
    where = (weight[..., None] * uv).sum(axis=2) * texels.resolution
    row, column = np.divmod(texels.pixel[chosen] % texels.resolution**2, texels.resolution)
    row_of = np.full(number.shape, -1, np.int64)
    row_of[row, column] = np.arange(len(chosen))
    seen = (valid_points[chosen, None] >> np.arange(N_POINTS, dtype=np.uint16) & 1).astype(bool)
    return row_of, where - np.stack([column, row], axis=1)[:, None] - 0.5, seen


def _lookups(
    invalid: NDArray[np.int64],
    chart: NDArray[np.int32],
    image: NDArray[np.int32],
    visible: tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.bool_]],
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return pairs of an invalid texel and the region of a neighbour, and the summed weight of each pair.

    invalid : (b, 2) int64, row and column; chart, image : (H, W) int32, chart and region of each pixel
    visible : from `_visible_points`

    Returns
    -------
    pair : (k, 2) int64, row of `invalid`, and region
    weight : (k,) float64, bilinear weight of the invalid texel, summed over the valid points of its
        neighbours in that region
    """
    row_of, point, seen = visible
    n_regions = int(image.max(initial=0)) + 1
    keys, weights = [np.zeros(0, np.int64)], [np.zeros(0)]
    for turn in _RING:
        row, column = _ring_of(invalid, turn, len(chart))
        beside = row_of[row, column]
        same = chart[row, column] == chart[invalid[:, 0], invalid[:, 1]]
        use = np.flatnonzero((beside >= 0) & same)
        away = np.abs(point[beside[use]] + np.array([turn[1], turn[0]]))
        # Compute the bilinear weight of the invalid texel at each point.
        tent = np.maximum(1.0 - away, 0.0).prod(axis=2) * seen[beside[use]]
        keys.append(use * n_regions + image[row[use], column[use]])
        weights.append(tent.sum(axis=1))
    key, index = np.unique(np.concatenate(keys), return_inverse=True)
    total = np.asarray(np.bincount(index.reshape(-1), np.concatenate(weights), len(key)), np.float64)
    pair = np.stack(np.divmod(key, n_regions), axis=1)
    return pair, total


def _choose(
    invalid: NDArray[np.int64],
    image: NDArray[np.int32],
    pair: NDArray[np.int64],
    weight: NDArray[np.float64],
) -> None:
    """For each invalid texel, write the region with the largest positive weight to `image`.

    invalid : (b, 2) int64, row and column; image : (H, W) int32, region of each pixel
    pair (k, 2), weight (k,) : from `_lookups`
    """
    order = np.lexsort((pair[:, 1], -weight, pair[:, 0]))
    order = order[weight[order] > 0]
    first = np.unique(pair[order, 0], return_index=True)[1]
    best = pair[order[first]]
    image[invalid[best[:, 0], 0], invalid[best[:, 0], 1]] = best[:, 1]
