"""Finds triangles that must not be baked: unusable vertices, no area, or duplicates."""

from __future__ import annotations

from collections import Counter

import numpy as np
from numpy.typing import NDArray

from baker.topology.unique_rows import FEW, byte_rows, mix, unique_rows

# Largest absolute coordinate of a usable vertex. The limit of Embree is 1.8e18.
LARGEST_COORDINATE = 1e18
# Limit of the height of a triangle divided by its longest edge. Up to this limit, the triangle is treated as
# having no area. The limit is about the relative spacing of float32 numbers, so the plane of such a triangle
# is undefined.
_FLATTEST = 1e-7
# Number of triangles whose vectors are in the processor's cache.
_BLOCK = 1 << 14


def in_range(
    triangle: NDArray[np.int64], low: NDArray[np.int64], high: NDArray[np.int64]
) -> NDArray[np.bool_]:
    """Return which triangles have only vertex indices within the triangle's range.

    Parameters
    ----------
    triangle : (T, 3) int64
        Vertex indices of each triangle.
    low, high : (T,) int64
        Range of each triangle's indices: `low` to `high` - 1.

    Returns
    -------
    (T,) bool
        Whether all three indices are in the range.
    """
    a, b, c = triangle.T
    within: NDArray[np.bool_] = np.asarray(
        (np.minimum(np.minimum(a, b), c) >= low) & (np.maximum(np.maximum(a, b), c) < high)
    )
    return within


def usable_vertices(position: NDArray[np.float32]) -> NDArray[np.bool_]:
    """Return which positions are finite and not too large for Embree.

    Parameters
    ----------
    position : (V, 3) float32, metres
        Positions of the vertices.

    Returns
    -------
    (V,) bool
        Whether no coordinate is NaN, infinite or beyond `LARGEST_COORDINATE`.
    """
    # Comparisons with NaN are false, so this test also rejects NaN.
    x, y, z = (np.abs(position[:, k]) <= LARGEST_COORDINATE for k in range(3))
    usable: NDArray[np.bool_] = np.asarray(x & y & z)
    return usable


def zero_area(position: NDArray[np.float32], triangle: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Return which triangles have no area, because their corners are at one point or on one line.

    Parameters
    ----------
    position : (V, 3) float32, metres
        Vertices; those that a triangle uses must be finite.
    triangle : (T, 3) int64
        Vertex indices of each triangle.

    Returns
    -------
    (T,) bool
        Whether the height is at most 1e-7 times the longest edge.
    """
    found = np.zeros(len(triangle), bool)
    for start in range(0, len(triangle), _BLOCK):
        block = slice(start, start + _BLOCK)
        found[block] = _zero_area(position, triangle[block])
    return found


def _zero_area(position: NDArray[np.float32], triangle: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Return `zero_area` of a few triangles; each array below has one component of all vectors."""
    a, b, c = (np.ascontiguousarray(position[triangle[:, k]].T, np.float64) for k in range(3))
    ab, ac, bc = b - a, c - a, c - b
    # Divide by the largest component, so that squares of tiny or huge edges do not underflow or overflow.
    longest = np.abs(np.concatenate([ab, ac, bc])).max(axis=0)
    scale = 1.0 / np.where(longest > 0, longest, 1.0)
    ab, ac, bc = ab * scale, ac * scale, bc * scale
    squared = np.maximum(np.maximum(_squared(ab), _squared(ac)), _squared(bc))
    normal = np.stack([ab[k - 2] * ac[k - 1] - ab[k - 1] * ac[k - 2] for k in range(3)])
    flat = np.sqrt(_squared(normal)) <= _FLATTEST * squared
    found: NDArray[np.bool_] = np.asarray(flat | (longest == 0))
    return found


def _squared(vector: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the squared lengths (n,) of vectors (3, n)."""
    x, y, z = vector
    squared: NDArray[np.float64] = x * x + y * y + z * z
    return squared


def face_normal(position: NDArray[np.float32], triangle: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return the normals of triangles; the length of a normal is twice the triangle's area.

    Parameters
    ----------
    position : (V, 3) float32, metres
        Vertices.
    triangle : (T, 3) int64
        Vertex indices of each triangle, counter-clockwise.

    Returns
    -------
    (T, 3) float64, m2
        Cross products of the two edges at corner 0.
    """
    a, b, c = (position[triangle[:, k]].astype(np.float64) for k in range(3))
    return _cross(b - a, c - a)


def _cross(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the cross products (n, 3) of vectors a and b (n, 3), faster than `np.cross`."""
    out = np.zeros_like(a)
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        out[:, k] = a[:, i] * b[:, j] - a[:, j] * b[:, i]
    return out


def duplicates(
    position: NDArray[np.float32],
    triangle: NDArray[np.int64],
    material: NDArray[np.int32],
    double_sided: NDArray[np.bool_],
) -> NDArray[np.bool_]:
    """Return which triangles are duplicates of an earlier triangle, by position.

    A triangle is a duplicate if an earlier triangle has the same three corner positions and the same winding.
    The two triangles may start at different corners. If an earlier triangle has the same positions and the
    opposite winding, the triangle is a duplicate only if both have the same material and this material is
    double-sided.

    Parameters
    ----------
    position : (V, 3) float32, metres
        Vertices; those that a triangle uses must be finite.
    triangle : (T, 3) int64
        Vertex indices of each triangle.
    material : (T,) int32
        Material of each triangle.
    double_sided : (T,) bool
        Whether the material of each triangle is double-sided.

    Returns
    -------
    (T,) bool
        Whether the triangle is a duplicate.
    """
    repeated = np.zeros(len(triangle), bool)
    candidate = _same_key(position, triangle)
    if not len(candidate):
        return repeated
    # + 0 makes -0 equal to 0.
    used = position[triangle[candidate]].reshape(-1, 3) + np.float32(0.0)
    corner = unique_rows([used], len(used))[1].reshape(-1, 3)
    first = corner.argmin(axis=1)
    row = np.arange(len(corner))
    a, b, c = (corner[row, (first + k) % 3] for k in range(3))
    winding = b > c
    low, high = np.minimum(b, c), np.maximum(b, c)

    # Sort by corners, then winding, then index. In each run of equal corners and winding, all but the first
    # triangle are duplicates.
    order = np.lexsort((candidate, winding, high, low, a))
    face = np.stack([a, low, high], axis=1)[order]
    wound = winding[order]
    same_face = np.zeros(len(order), bool)
    same_face[1:] = (face[1:] == face[:-1]).all(axis=1)
    same = same_face.copy()
    same[1:] &= wound[1:] == wound[:-1]
    repeated[candidate[order[same]]] = True

    # For each set of corners, at most one triangle of each winding is left. If both have one double-sided
    # material, the later triangle is a duplicate.
    left, left_face = order[~same], face[~same]
    pair = np.flatnonzero((left_face[1:] == left_face[:-1]).all(axis=1))
    one, two = candidate[left[pair]], candidate[left[pair + 1]]
    double = (material[one] == material[two]) & double_sided[one]
    repeated[np.maximum(one, two)[double]] = True
    return repeated


def _same_key(position: NDArray[np.float32], triangle: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the indices, ascending, of triangles that share a hash of their corner positions."""
    if len(triangle) <= FEW:
        rows = byte_rows(position[triangle.ravel()] + np.float32(0.0))
        keys = [tuple(sorted(rows[k : k + 3])) for k in range(0, len(rows), 3)]
        times = Counter(keys)
        return np.array([k for k, key in enumerate(keys) if times[key] > 1], np.int64)
    total = _corner_hash(position, triangle)
    ordered = np.sort(total)
    twice = ordered[1:][ordered[1:] == ordered[:-1]]
    if not len(twice):
        return np.zeros(0, np.int64)
    return np.flatnonzero(np.isin(total, twice))


def _corner_hash(position: NDArray[np.float32], triangle: NDArray[np.int64]) -> NDArray[np.uint64]:
    """Return a hash (T,) of the corner positions of each triangle, in any order."""
    with np.errstate(invalid="ignore"):
        bits = (position + np.float32(0.0)).view(np.uint32).astype(np.uint64)  # + 0 makes -0 equal to 0
    key = np.zeros(len(bits), np.uint64)
    for k in range(3):
        key = mix(key ^ bits[:, k])
    total: NDArray[np.uint64] = key[triangle[:, 0]] + key[triangle[:, 1]] + key[triangle[:, 2]]
    return total


def sound_groups(
    position: NDArray[np.float32], triangle: NDArray[np.int64], group: NDArray[np.int64], n_groups: int
) -> NDArray[np.bool_]:
    """Return which groups of triangles certainly have no unusable triangle and no duplicates.

    The test of all groups together takes less time than the tests of each group, if the groups are small.

    Parameters
    ----------
    position : (V, 3) float32, metres
        Vertices of all groups.
    triangle : (T, 3) int64
        Vertex indices of each triangle, in range.
    group : (T,) int64
        Group of each triangle.
    n_groups : int
        Number of groups, N.

    Returns
    -------
    (N,) bool
        False for groups with such a triangle. It may also be False for others.
    """
    sound = np.ones(n_groups, bool)
    usable = usable_vertices(position)
    good = usable[triangle].all(axis=1)
    sound[group[~good]] = False
    triangle, group = triangle[good], group[good]
    sound[group[zero_area(position, triangle)]] = False
    key = _corner_hash(position, triangle) + mix(group.astype(np.uint64))
    order = np.argsort(key)
    twice = order[1:][key[order][1:] == key[order][:-1]]
    sound[group[twice]] = False
    return sound
