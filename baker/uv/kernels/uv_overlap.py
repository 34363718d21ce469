# mypy: disable-error-code="no-untyped-def"
"""Counts samples of a uv layout that are inside more than one triangle, and texels close to other charts."""

from __future__ import annotations

import math

from baker.trace.jit import kernel, larger, smaller


@kernel
def count_overlap(corner, group, base, stride, rows, slack, mark, covered, doubled):
    """Mark the samples that each triangle covers, and count the samples that were covered before.

    Sample (r, c) of a grid is at (c + 0.5, r + 0.5), in units of the sample spacing. A triangle covers a
    sample if the sample is inside and more than `slack` away from each edge. So triangles that share an edge
    do not overlap, even if the vertices of the edge are rounded.

    Parameters
    ----------
    corner : (T, 3, 2) float64, sample spacings
        Corners of the triangles.
    group : (T,) int64
        Group of each triangle, which determines its grid and counters.
    base, stride, rows : (G,) int64
        For the grid of each group: index in `mark` of its first sample, number of columns, and number of
        rows. Groups may share a grid.
    slack : float, sample spacings
        Smallest distance of a covered sample from the edges.
    mark : (M,) uint8
        In and out, for each sample: 0 free, 1 covered once, 2 covered more than once.
    covered, doubled : (G,) int64
        Out: number of samples that the group's triangles cover, and number of these samples that were covered
        before.
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
        # The signed distance of a sample from an edge is a cross product divided by the length of the edge.
        # The tests below compare the cross product with `slack` times the length instead.
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
    """Write the chart number of each triangle, plus 1, to each free texel whose square the triangle enters.

    Parameters
    ----------
    corner : (T, 3, 2) float64, texels
        Corners of the triangles. Texel (r, c) spans c to c + 1 along u and r to r + 1 along v.
    chart : (T,) int32
        Chart of each triangle.
    owner : (H, W) int32
        In and out: chart of each texel plus 1; 0 for free texels.
    """
    height, width = owner.shape
    # Smallest distance, texels, by which a triangle that enters a texel extends into it.
    slack = 1e-4
    for t in range(len(corner)):
        y_low = smaller(smaller(corner[t, 0, 1], corner[t, 1, 1]), corner[t, 2, 1])
        y_high = larger(larger(corner[t, 0, 1], corner[t, 1, 1]), corner[t, 2, 1])
        for r in range(
            larger(0, math.floor(y_low + slack)), smaller(height - 1, math.ceil(y_high - slack) - 1) + 1
        ):
            # Compute the range of x in which the triangle crosses row r.
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
    """Return the number of covered texels that have a texel of another chart within `gap` rows and columns.

    owner : (H, W) int32, see `mark_charts`
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
