"""Makes pages of polygonal charts with analytic light, and computes slowly what page kernels compute."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

Field = Callable[[int, NDArray, NDArray], NDArray]

SIZE = 128
# One convex polygon per chart, as (column, row) in texels, with positive signed area. The third polygon is
# aligned with the grid, and the fourth is thin.
POLYGONS = [
    np.array([[6.3, 10.1], [52.7, 4.6], [58.2, 50.9], [12.4, 56.3]]),
    np.array([[70.2, 8.4], [120.6, 22.3], [81.5, 58.8]]),
    np.array([[8.0, 70.0], [60.0, 70.0], [60.0, 120.0], [8.0, 120.0]]),
    np.array([[72.4, 74.9], [118.3, 92.2], [116.9, 96.0], [71.0, 78.6]]),
    np.array([[78.3, 100.4], [100.2, 94.7], [116.5, 108.9], [106.8, 122.1], [80.1, 118.0]]),
]
BRIGHTNESS = (1.0, 4.0, 0.25, 2.0, 0.6)


def distance_to_edges(polygon: NDArray, x: NDArray, y: NDArray) -> NDArray:
    """Return the signed distance in texels of (x, y) to a convex polygon's nearest edge, positive inside."""
    nearest = np.full(np.shape(x), np.inf)
    for a, b in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
        edge = (b - a) / np.linalg.norm(b - a)
        nearest = np.minimum(nearest, edge[0] * (y - a[1]) - edge[1] * (x - a[0]))
    return nearest


def smooth(k: int, x: NDArray, y: NDArray) -> NDArray:
    """Return light of chart k that varies by 50 % around the chart's brightness over tens of texels."""
    return BRIGHTNESS[k] * (1.0 + 0.5 * np.sin(x / 11.0 + k) * np.cos(y / 13.0 + 2 * k))


def contact(k: int, x: NDArray, y: NDArray) -> NDArray:
    """Return `smooth` with a shadow at the first edge of chart k: 80 % darker, decay length 6 texels."""
    a, b = POLYGONS[k][:2]
    edge = (b - a) / np.linalg.norm(b - a)
    distance = np.abs(edge[0] * (y - a[1]) - edge[1] * (x - a[0]))
    return smooth(k, x, y) * (1.0 - 0.8 * np.exp(-distance / 6.0))


def make_page(field: Field, n_sub: int = 8) -> tuple[NDArray, NDArray, NDArray]:
    """Return (value (H, W, 1), chart (H, W), centroid offset (H, W, 2)) of a page of all charts.

    A value is the mean of `field` over the covered part of the texel, from n_sub x n_sub points. A texel is
    covered if one of these points is inside the polygon. The offset of the covered part's centroid from the
    texel centre is in texels.
    """
    value = np.zeros((SIZE, SIZE, 1))
    chart = np.full((SIZE, SIZE), -1, np.int32)
    offset = np.zeros((SIZE, SIZE, 2))
    place = (np.arange(SIZE * n_sub) + 0.5) / n_sub
    x, y = np.meshgrid(place, place)
    centre = np.arange(SIZE) + 0.5

    def per_texel(a: NDArray) -> NDArray:
        return a.reshape(SIZE, n_sub, SIZE, n_sub).sum((1, 3))

    for k, polygon in enumerate(POLYGONS):
        inside = distance_to_edges(polygon, x, y) >= 0.0
        count = per_texel(inside.astype(float))
        hit = count > 0
        share = np.maximum(count, 1.0)
        chart[hit] = k
        value[hit, 0] = (per_texel(inside * field(k, x, y)) / share)[hit]
        offset[hit, 0] = (per_texel(inside * x) / share - centre[None, :])[hit]
        offset[hit, 1] = (per_texel(inside * y) / share - centre[:, None])[hit]
    return value.astype(np.float32), chart, offset.astype(np.float32)


def border_error(page: NDArray, field: Field, width: float) -> float:
    """Return the relative RMS error of bilinear lookups inside charts, within `width` texels of a border."""
    rng = np.random.default_rng(3)
    wrong = []
    for k, polygon in enumerate(POLYGONS):
        x = rng.uniform(polygon[:, 0].min(), polygon[:, 0].max(), 20000)
        y = rng.uniform(polygon[:, 1].min(), polygon[:, 1].max(), 20000)
        distance = distance_to_edges(polygon, x, y)
        near = (distance > 0.0) & (distance < width)
        x, y = x[near], y[near]
        wrong.append(lookup(page, x, y) / field(k, x, y) - 1.0)
    return float(np.sqrt(np.mean(np.concatenate(wrong) ** 2)))


def lookup(page: NDArray, x: NDArray, y: NDArray) -> NDArray:
    """Return the first channel of a page at texel coordinates (x, y), interpolated bilinearly."""
    column, row = np.floor(x - 0.5).astype(int), np.floor(y - 0.5).astype(int)
    u, v = x - 0.5 - column, y - 0.5 - row
    upper = page[row, column, 0] * (1 - u) + page[row, column + 1, 0] * u
    lower = page[row + 1, column, 0] * (1 - u) + page[row + 1, column + 1, 0] * u
    return upper * (1 - v) + lower * v


def squared_distance(mask: NDArray) -> NDArray:
    """Return the squared distance of each texel to the nearest set texel, computed by SciPy."""
    return np.rint(distance_transform_edt(~mask) ** 2).astype(int)


def slow_nearest(mask: NDArray) -> NDArray:
    """Return the same squared distances as `squared_distance`, by a loop over all set texels."""
    rows, columns = np.nonzero(mask)
    r, c = np.indices(mask.shape)
    return ((r[..., None] - rows) ** 2 + (c[..., None] - columns) ** 2).min(-1)


def slow_plane(value: NDArray, chart: NDArray, covered: NDArray, offset: NDArray, r: int, c: int) -> NDArray:
    """Return (value, slope along columns, slope along rows) of the plane fit at texel (r, c).

    The normal equations of the weighted least-squares problem are solved by NumPy.
    """
    rows, columns = np.nonzero(covered & (chart == chart[r, c]))
    near = (abs(rows - r) <= 2) & (abs(columns - c) <= 2)
    rows, columns = rows[near], columns[near]
    place = np.stack([columns - c, rows - r], -1) + offset[rows, columns] - offset[r, c]
    weight = 1.0 / (1.0 + (place**2).sum(-1))
    mean = (weight @ place) / weight.sum()
    flat = place - mean
    level = (weight @ value[rows, columns]) / weight.sum()
    normal = flat.T @ (weight[:, None] * flat) + 1e-3 * weight.sum() * np.eye(2)
    slope = np.linalg.solve(normal, flat.T @ (weight * (value[rows, columns] - level)))
    return np.array([level - slope @ mean, *slope])


def slow_rings(value: NDArray, chart: NDArray, known: NDArray) -> tuple[NDArray, NDArray]:
    """Fill charts from known texels outwards, one ring of neighbours at a time.

    Return the values and the mask of texels that have a value at the end.
    """
    value, known = value.astype(np.float64), known.copy()
    height, width = chart.shape
    while True:
        found = {}
        for r, c in zip(*np.nonzero((chart >= 0) & ~known), strict=True):
            around = [
                (1.0 if a == 0 or b == 0 else 0.5, value[r + a, c + b])
                for a in (-1, 0, 1)
                for b in (-1, 0, 1)
                if 0 <= r + a < height and 0 <= c + b < width
                if known[r + a, c + b] and chart[r + a, c + b] == chart[r, c]
            ]
            if around:
                found[r, c] = sum(w * v for w, v in around) / sum(w for w, _ in around)
        if not found:
            return value, known
        for where, v in found.items():
            value[where] = v.astype(np.float32)
            known[where] = True
