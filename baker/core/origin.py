"""Chooses the origin of a bake's coordinates near the objects, because float32 is most accurate near 0.

Transforms to world space are float64. Positions that are traced or rasterised are float32 and relative to
this origin. The origin is 0 for scenes that lie around 0.

The spacing of float32 numbers is about 2^-23 of their absolute value. An object of size s at distance d from
the origin loses max(log2(d / s) - `_UNCOUNTED_BITS`, 0) bits of its coordinates. A candidate for the origin
is rated by the weighted sum of the lost bits of all objects. The weight of an object is the square root of
its number of triangles. Candidates are the point 0 and the centres of up to `_CANDIDATES` objects. The
candidate with the smallest sum is chosen and rounded. A centre is chosen only if it saves more than
`_MIN_GAIN` bits per object, as a weighted mean, compared with 0.

A terrain or a backdrop around all other objects loses no bits for an origin among them. A single distant
object usually has less weight than the other objects together.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

# Number of bits that an object may lose without being counted.
_UNCOUNTED_BITS = 3.0
# Number of bits per object, as a weighted mean. An origin other than 0 is used if it saves more bits.
_MIN_GAIN = 2.0
# Largest number of objects whose centres are candidates. Half of them are the objects with most triangles,
# the others are evenly spaced in the list of objects. An object that is chosen twice is one candidate.
_CANDIDATES = 64
# A mesh with more vertices is sampled: between this number and twice this number of vertices are read.
_VERTICES = 1 << 15


def scene_origin(
    position: Sequence[NDArray[np.float32]],
    triangles: Sequence[int],
    placed: Sequence[tuple[int, NDArray[np.float64]]],
) -> NDArray[np.float64]:
    """Return the point that the positions of a bake are relative to.

    Parameters
    ----------
    position : sequence of (V, 3) float32, metres, object space
        Vertices of each mesh.
    triangles : sequence of int
        Number of triangles of each mesh.
    placed : sequence of (int, (4, 4) float64)
        Index of the mesh, and world_from_object, of each object.

    Returns
    -------
    origin : (3,) float64, metres, world
        The origin, (0, 0, 0) if no other candidate saves enough bits.
    """
    shapes = [_median_and_spread(vertices) for vertices in position]
    centre, size, weight = np.zeros((len(placed), 3)), np.zeros(len(placed)), np.zeros(len(placed))
    for k, (mesh, world_from_object) in enumerate(placed):
        middle, half = shapes[mesh]
        linear = world_from_object[:3, :3]
        centre[k] = linear @ middle + world_from_object[:3, 3]
        size[k] = 2.0 * float(np.linalg.norm(np.abs(linear) @ half))
        weight[k] = np.sqrt(triangles[mesh])
    usable = (size > 0) & np.isfinite(centre).all(axis=1)
    centre, size, weight = centre[usable], size[usable], weight[usable]
    zero = np.zeros(3)
    # Return early for most scenes, because no origin can save more bits than are lost with the origin 0.
    lost = _lost_bits(zero, centre, size)
    if not weight.sum() > 0 or weight @ lost <= _MIN_GAIN * weight.sum():
        return zero
    heaviest = np.argsort(-weight, kind="stable")[: _CANDIDATES // 2]
    spread = np.linspace(0, len(weight) - 1, _CANDIDATES // 2).astype(np.int64)
    candidates = np.unique(np.concatenate([heaviest, spread]))
    total = np.array([weight @ _lost_bits(centre[k], centre, size) for k in candidates])
    best = candidates[int(total.argmin())]
    if weight @ lost - total.min() <= _MIN_GAIN * weight.sum():
        return zero
    # Round to multiples of a power of two near the object's size, so that the subtraction of the origin keeps
    # the trailing zero bits of coordinates.
    grid = 2.0 ** np.floor(np.log2(size[best]))
    return np.asarray(np.round(centre[best] / grid) * grid, np.float64)


def _lost_bits(
    point: NDArray[np.float64], centre: NDArray[np.float64], size: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return (n,) float64: the bits beyond `_UNCOUNTED_BITS` that each object loses with the origin `point`.

    point : (3,) float64, metres; centre : (n, 3) float64, metres; size : (n,) float64, metres
    The distance of an object is the largest absolute component of `centre - point`.
    """
    distance = np.abs(centre - point).max(axis=1)
    return np.asarray(np.maximum(np.log2(np.maximum(distance / size, 1e-9)) - _UNCOUNTED_BITS, 0.0))


def _median_and_spread(position: NDArray[np.float32]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the median (3,) of a mesh's vertices and their median absolute deviation (3,), both by axis.

    A few distant triangles do not affect medians. If the deviation is 0 along all three axes because most
    vertices coincide, half the size of the bounding box is returned instead. A mesh without vertices gives 0.
    """
    some = position[:: max(1, len(position) // _VERTICES)].astype(np.float64)
    if not len(some):
        return np.zeros(3), np.zeros(3)
    middle = column_medians(some)
    half = column_medians(np.abs(some - middle))
    if not half.any():
        half = 0.5 * np.ptp(some, axis=0)
    return middle, half


def column_medians(rows: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the median of each column, as `np.median`, which takes ten times as long for a few rows.

    Parameters
    ----------
    rows : (n, k) float64
        At least one row.

    Returns
    -------
    (k,) float64
        The medians; NaN for columns with NaN.
    """
    ordered = np.sort(rows, axis=0)  # NaN come last
    middle = (ordered[(len(rows) - 1) // 2] + ordered[len(rows) // 2]) / 2.0
    return np.where(np.isnan(ordered[-1]), np.nan, middle)
