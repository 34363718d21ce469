"""Chooses the origin of a bake's coordinates near the objects, because float32 is most accurate near 0.

Transforms to world space are float64. Positions that are traced or rasterised are float32 and relative to
this origin. The origin is 0 for scenes that lie around 0.

The spacing of float32 numbers is about 2^-23 of their absolute value. An object of size s at distance d from
the origin loses log2(d / s) of the 23 bits of its coordinates; `_UNCOUNTED_BITS` lost bits are ignored. The
origin minimises the weighted sum of lost bits over all objects. The weight of an object is the square root of
its number of triangles. A terrain or a backdrop around all other objects loses no bits for any origin inside
its extent. A single distant object usually has less weight than the other objects together.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

# Number of lost bits of an object that are ignored.
_UNCOUNTED_BITS = 3.0
# Smallest weighted mean of the bits per object that an origin other than 0 must save.
_MIN_GAIN = 2.0
# Number of candidate origins. Each candidate is the centre of an object. Half of these objects are those with
# most triangles; the others are evenly spaced in the list of objects.
_CANDIDATES = 64
# Approximate number of vertices that are read from a mesh with more vertices.
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
        The origin, 0 if no other point saves enough bits.
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
    # Return early for most scenes: no origin can save more bits than are lost with the origin 0.
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
    # Round to multiples of a power of two, so that integer coordinates stay exact.
    grid = 2.0 ** np.floor(np.log2(size[best]))
    return np.asarray(np.round(centre[best] / grid) * grid, np.float64)


def _lost_bits(
    point: NDArray[np.float64], centre: NDArray[np.float64], size: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return (n,) float64: the bits beyond `_UNCOUNTED_BITS` that each object loses with the origin `point`.

    point : (3,) float64, metres; centre : (n, 3) float64, metres; size : (n,) float64, metres
    """
    distance = np.abs(centre - point).max(axis=1)
    return np.asarray(np.maximum(np.log2(np.maximum(distance / size, 1e-9)) - _UNCOUNTED_BITS, 0.0))


def _median_and_spread(position: NDArray[np.float32]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the median (3,) of a mesh's vertices and their median distance (3,) from it along each axis.

    A few distant triangles do not affect medians. If all three median distances are 0 because most vertices
    coincide, half the size of the bounding box is returned instead.
    """
    some = position[:: max(1, len(position) // _VERTICES)].astype(np.float64)
    if not len(some):
        return np.zeros(3), np.zeros(3)
    middle = np.median(some, axis=0)
    half = np.median(np.abs(some - middle), axis=0)
    if not half.any():
        half = 0.5 * np.ptp(some, axis=0)
    return middle, half
