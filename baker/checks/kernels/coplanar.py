# mypy: disable-error-code="no-untyped-def"
"""Finds coplanar triangles of different objects that overlap."""

from __future__ import annotations

import numpy as np

from baker.trace.jit import inner, kernel


@kernel
def coplanar_partners(corner, low, high, first, owner, slack, partner):
    """For each triangle, write the index of one coplanar triangle that overlaps it and has another owner.

    Two triangles overlap if their projections on the normals of all six sides overlap by more than `slack`
    (separating axis theorem). Pairs of triangles that both have a partner already are not tested.

    Parameters
    ----------
    corner : (T, 3, 2) float64
        Corners of each triangle, 2D coordinates in its plane. Triangles are grouped by plane, and those of a
        plane are sorted by `low[:, 0]`.
    low, high : (T, 2) float64
        Lowest and highest corner of the bounding box of each triangle, in the same coordinates.
    first : (P + 1,) int64
        Index of the first triangle of each of P planes; the last entry is T.
    owner : (T,) int64
        Object of each triangle.
    slack : float
        Length of the overlap of two projections up to which they count as separate, in the unit of `corner`.
    partner : (T,) int64
        In and out: index of an overlapping triangle of another object, -1 if none is known.
    """
    for p in range(len(first) - 1):
        for i in range(first[p], first[p + 1]):
            for j in range(i + 1, first[p + 1]):
                if low[j, 0] >= high[i, 0] - slack:
                    break
                if owner[i] == owner[j] or (partner[i] >= 0 and partner[j] >= 0):
                    continue
                if low[j, 1] >= high[i, 1] - slack or low[i, 1] >= high[j, 1] - slack:
                    continue
                if not _apart(corner[i], corner[j], slack) and not _apart(corner[j], corner[i], slack):
                    partner[i] = j
                    partner[j] = i


@inner
def _apart(a, b, slack):
    """Return whether the line of a side of triangle `a` separates it from triangle `b`, up to `slack`.

    a, b : (3, 2) float64, corners; slack : see `coplanar_partners`
    """
    turn = (a[1, 0] - a[0, 0]) * (a[2, 1] - a[0, 1]) - (a[1, 1] - a[0, 1]) * (a[2, 0] - a[0, 0])
    sign = 1.0 if turn > 0.0 else -1.0
    for k in range(3):
        m = (k + 1) % 3
        dx, dy = sign * (a[m, 0] - a[k, 0]), sign * (a[m, 1] - a[k, 1])
        length = np.sqrt(dx * dx + dy * dy)
        inside = -1.0e300
        for c in range(3):
            inside = max(inside, dx * (b[c, 1] - a[k, 1]) - dy * (b[c, 0] - a[k, 0]))
        if inside <= slack * length:
            return True
    return False
