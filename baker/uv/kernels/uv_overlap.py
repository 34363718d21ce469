# mypy: disable-error-code="no-untyped-def"
"""Counts the samples of a uv layout that lie strictly inside more than one triangle."""

from __future__ import annotations

import math

from baker.trace.jit import kernel, larger, smaller


@kernel
def count_overlap(corner, group, base, stride, rows, slack, mark, covered, doubled):
    """Mark the samples that each triangle covers, and count those that were covered before.

    Sample (r, c) lies at (c + 0.5, r + 0.5). A triangle covers it if it lies inside by more than `slack`, so
    that triangles that share an edge do not overlap, even if the edge is rounded.

    Parameters
    ----------
    corner : (T, 3, 2) float64, in samples
    group : (T,) int64
        Grid and counters of each triangle.
    base, stride, rows : (G,) int64
        First entry of each group's grid in `mark`, its columns and its rows. Groups may share a grid.
    slack : float, in samples
    mark : (M,) uint8
        In and out: 0 free, 1 covered once, 2 more than once.
    covered, doubled : (G,) int64
        Out: samples covered by the group's triangles, and those of them found covered already.
    """
    for t in range(len(corner)):
        g = group[t]
        ax, ay = corner[t, 0, 0], corner[t, 0, 1]
        bx, by = corner[t, 1, 0], corner[t, 1, 1]
        cx, cy = corner[t, 2, 0], corner[t, 2, 1]
        turn = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        if turn == 0.0:
            continue
        if turn < 0.0:
            bx, by, cx, cy = cx, cy, bx, by
        # Signed distance to an edge is n . (p - a), n pointing inwards: cross product over the edge length.
        l0 = math.sqrt((bx - ax) ** 2 + (by - ay) ** 2)
        l1 = math.sqrt((cx - bx) ** 2 + (cy - by) ** 2)
        l2 = math.sqrt((ax - cx) ** 2 + (ay - cy) ** 2)
        if l0 == 0.0 or l1 == 0.0 or l2 == 0.0:
            continue
        # Visit the samples in the bounding box.
        r_low = larger(0, math.floor(smaller(smaller(ay, by), cy) - 0.5))
        r_high = smaller(rows[g] - 1, math.ceil(larger(larger(ay, by), cy) - 0.5))
        c_low = larger(0, math.floor(smaller(smaller(ax, bx), cx) - 0.5))
        c_high = smaller(stride[g] - 1, math.ceil(larger(larger(ax, bx), cx) - 0.5))
        for r in range(r_low, r_high + 1):
            y = r + 0.5
            row = base[g] + r * stride[g]
            for c in range(c_low, c_high + 1):
                x = c + 0.5
                if (
                    (bx - ax) * (y - ay) - (by - ay) * (x - ax) > slack * l0
                    and (cx - bx) * (y - by) - (cy - by) * (x - bx) > slack * l1
                    and (ax - cx) * (y - cy) - (ay - cy) * (x - cx) > slack * l2
                ):
                    covered[g] += 1
                    if mark[row + c] == 0:
                        mark[row + c] = 1
                    else:
                        mark[row + c] = 2
                        doubled[g] += 1


@kernel
def mark_charts(corner, chart, owner):
    """Write chart + 1 into each free texel whose square a triangle enters.

    Parameters
    ----------
    corner : (T, 3, 2) float64, in texels; texel (r, c) spans c to c + 1 and r to r + 1
    chart : (T,) int32
    owner : (H, W) int32
        In and out: chart + 1, 0 where free.
    """
    height, width = owner.shape
    # A triangle that only touches the border of a texel does not enter it.
    slack = 1e-4
    for t in range(len(corner)):
        y_low = smaller(smaller(corner[t, 0, 1], corner[t, 1, 1]), corner[t, 2, 1])
        y_high = larger(larger(corner[t, 0, 1], corner[t, 1, 1]), corner[t, 2, 1])
        for r in range(
            larger(0, math.floor(y_low + slack)), smaller(height - 1, math.ceil(y_high - slack) - 1) + 1
        ):
            # Range of x in which the triangle crosses row r.
            x_low, x_high = 1e30, -1e30
            for k in range(3):
                ax, ay = corner[t, k, 0], corner[t, k, 1]
                m = k + 1 if k < 2 else 0
                bx, by = corner[t, m, 0], corner[t, m, 1]
                if r <= ay <= r + 1:
                    x_low, x_high = smaller(x_low, ax), larger(x_high, ax)
                for line in (r, r + 1):
                    if (ay < line) != (by < line):
                        x = ax + (bx - ax) * (line - ay) / (by - ay)
                        x_low, x_high = smaller(x_low, x), larger(x_high, x)
            c_low, c_high = (
                larger(0, math.floor(x_low + slack)),
                smaller(width - 1, math.ceil(x_high - slack) - 1),
            )
            for c in range(c_low, c_high + 1):
                if owner[r, c] == 0:
                    owner[r, c] = chart[t] + 1


@kernel
def count_close(owner, gap):
    """Return the number of texels with another owner's texel within `gap` rows and columns.

    owner : (H, W) int32, 0 where free.
    """
    height, width = owner.shape
    count = 0
    for r in range(height):
        for c in range(width):
            own = owner[r, c]
            if own == 0:
                continue
            found = False
            for y in range(larger(0, r - gap), smaller(height, r + gap + 1)):
                for x in range(larger(0, c - gap), smaller(width, c + gap + 1)):
                    if owner[y, x] != 0 and owner[y, x] != own:
                        found = True
                        break
                if found:
                    break
            if found:
                count += 1
    return count
