"""Where the coordinates of a bake begin: float32 is finest around 0, so 0 lies among the scene's detail.

World positions are float64 in the scene; everything that is traced or rasterised is float32 and relative to
this origin. It is 0 for scenes that stand around 0 already.

A step of float32 is 2^-23 of the coordinate. An object of size s at distance d from the origin loses
log2(d / s) of its 23 bits; the first `_FREE` of them are not missed. The origin is where the sum of lost bits
over all objects is least: a backdrop, a terrain or a sky around everything loses none wherever the origin is,
and a stray object far away cannot outweigh the rest.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

# Bits lost that do not count; bits of the mean object that moving the origin away from 0 must win.
_FREE, _WORTH = 3.0, 2.0
# Places tried, half of them at the objects of most triangles; vertices looked at of a mesh.
_PLACES, _VERTICES = 64, 1 << 15


def scene_origin(
    position: Sequence[NDArray[np.float32]],
    triangles: Sequence[int],
    placed: Sequence[tuple[int, NDArray[np.float64]]],
) -> NDArray[np.float64]:
    """Return (3,) float64, metres, world: what world positions of a bake are relative to.

    Parameters
    ----------
    position : sequence of (V, 3) float32, metres
        Vertices of each mesh.
    triangles : sequence of int
        Triangles of each mesh.
    placed : sequence of (int, (4, 4) float64)
        Mesh and world matrix of each object.
    """
    shapes = [_middle_and_size(vertices) for vertices in position]
    centre, size, weight = np.zeros((len(placed), 3)), np.zeros(len(placed)), np.zeros(len(placed))
    for k, (mesh, world_from_object) in enumerate(placed):
        middle, half = shapes[mesh]
        linear = world_from_object[:3, :3]
        centre[k] = linear @ middle + world_from_object[:3, 3]
        size[k] = 2.0 * float(np.linalg.norm(np.abs(linear) @ half))
        weight[k] = np.sqrt(triangles[mesh])
    usable = (size > 0) & np.isfinite(centre).all(axis=1)
    centre, size, weight = centre[usable], size[usable], weight[usable]
    nowhere = np.zeros(3)
    # The usual scene, without further search: it cannot win as many bits as the origin has to.
    lost = _lost_bits(nowhere, centre, size)
    if not weight.sum() > 0 or weight @ lost <= _WORTH * weight.sum():
        return nowhere
    heaviest = np.argsort(-weight, kind="stable")[: _PLACES // 2]
    spread = np.linspace(0, len(weight) - 1, _PLACES // 2).astype(np.int64)
    places = np.unique(np.concatenate([heaviest, spread]))
    total = np.array([weight @ _lost_bits(centre[k], centre, size) for k in places])
    best = places[int(total.argmin())]
    if weight @ lost - total.min() <= _WORTH * weight.sum():
        return nowhere
    # On a grid of powers of two: coordinates that were whole or simple numbers stay so.
    grid = 2.0 ** np.floor(np.log2(size[best]))
    return np.asarray(np.round(centre[best] / grid) * grid, np.float64)


def _lost_bits(
    place: NDArray[np.float64], centre: NDArray[np.float64], size: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return (n,): bits of float32 that objects lose to their distance from a place, beyond `_FREE`."""
    distance = np.abs(centre - place).max(axis=1)
    return np.asarray(np.maximum(np.log2(np.maximum(distance / size, 1e-9)) - _FREE, 0.0))


def _middle_and_size(position: NDArray[np.float32]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the median (3,) of a mesh's vertices and their median distance (3,) from it along each axis.

    Medians: a few triangles left far away are not where the mesh is. Where most vertices are in one place,
    half the box.
    """
    some = position[:: max(1, len(position) // _VERTICES)].astype(np.float64)
    if not len(some):
        return np.zeros(3), np.zeros(3)
    middle = np.median(some, axis=0)
    half = np.median(np.abs(some - middle), axis=0)
    if not half.any():
        half = 0.5 * np.ptp(some, axis=0)
    return middle, half
