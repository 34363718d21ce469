# mypy: disable-error-code="no-untyped-def"
"""Finds pairs of triangles of a uv layout that cover the same samples of a regular grid."""

from __future__ import annotations

import numpy as np

from baker.trace.jit import kernel

# Indices into `counts`, which has these numbers:
# COVERED: samples that at least one triangle covers;
# COVERED_AGAIN: cases in which a triangle covers a sample that an earlier triangle covers;
# OVERLAPPING: triangles that share a sample with an earlier triangle;
# LISTED: pairs written to `pairs`.
COVERED, COVERED_AGAIN, OVERLAPPING, LISTED = 0, 1, 2, 3


@kernel
def cover_pairs(corner, slack, owner, pairs, counts):
    """Mark the samples that each triangle covers, and list pairs of triangles that share samples.

    Sample (r, c) is at x = c + 0.5, y = r + 0.5. A triangle covers a sample if the sample is inside and more
    than `slack` away from each side. Triangles with two equal corners cover no samples.

    Parameters
    ----------
    corner : (T, 3, 2) float64
        Corners (x, y) of each triangle, in sample spacings.
    slack : float
        Distance from a side up to which a sample is not covered, in sample spacings.
    owner : (H, W) int32
        In and out: 1 + index of the last triangle that covered each sample; 0 if none did.
    pairs : (K, 2) int64
        Out: the first K pairs (earlier triangle, later triangle) that share samples. Of several earlier
        triangles that cover a sample, only the last is paired with the later triangle. A pair may be listed
        more than once.
    counts : (4,) int64
        In and out: totals, see `COVERED` to `LISTED`.
    """
    height, width = owner.shape
    for t in range(len(corner)):
        ax, ay = corner[t, 0, 0], corner[t, 0, 1]
        bx, by = corner[t, 1, 0], corner[t, 1, 1]
        cx, cy = corner[t, 2, 0], corner[t, 2, 1]
        if (bx - ax) * (cy - ay) - (by - ay) * (cx - ax) < 0.0:
            bx, by, cx, cy = cx, cy, bx, by
        # Skip triangles with a side of length 0, because distances are divided by these lengths.
        l0 = np.sqrt((bx - ax) ** 2 + (by - ay) ** 2)
        l1 = np.sqrt((cx - bx) ** 2 + (cy - by) ** 2)
        l2 = np.sqrt((ax - cx) ** 2 + (ay - cy) ** 2)
        if l0 == 0.0 or l1 == 0.0 or l2 == 0.0:
            continue
        last = 0
        # Visit the samples in the bounding box.
        for r in range(max(0, int(min(ay, by, cy) - 0.5)), min(height - 1, int(max(ay, by, cy) + 0.5)) + 1):
            y = r + 0.5
            for c in range(
                max(0, int(min(ax, bx, cx) - 0.5)), min(width - 1, int(max(ax, bx, cx) + 0.5)) + 1
            ):
                x = c + 0.5
                # Compute the distance to the nearest side, positive inside the triangle.
                nearest = min(
                    ((bx - ax) * (y - ay) - (by - ay) * (x - ax)) / l0,
                    ((cx - bx) * (y - by) - (cy - by) * (x - bx)) / l1,
                    ((ax - cx) * (y - cy) - (ay - cy) * (x - cx)) / l2,
                )
                if not nearest > slack:
                    continue
                before = owner[r, c]
                if before == 0:
                    counts[COVERED] += 1
                else:
                    counts[COVERED_AGAIN] += 1
                    if last == 0:
                        counts[OVERLAPPING] += 1
                    if before != last and counts[LISTED] < len(pairs):
                        pairs[counts[LISTED], 0], pairs[counts[LISTED], 1] = before - 1, t
                        counts[LISTED] += 1
                    last = before
                owner[r, c] = t + 1
