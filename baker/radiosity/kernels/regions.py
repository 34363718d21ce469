# mypy: disable-error-code="no-untyped-def"
"""Finds regions of charts: connected components of the graph of linked texels, see `radiosity.sides`."""

from __future__ import annotations

from baker.trace.jit import kernel


@kernel
def join_linked(link, root):
    """Find the smallest node in the connected component of each node (union-find).

    link : (m, 2) int32, pairs of connected nodes
    root : (n,) int32, 0 to n - 1 on entry; on return, the smallest node of each node's component
    """
    for m in range(len(link)):
        a, b = link[m, 0], link[m, 1]
        while root[a] != a:
            root[a] = root[root[a]]
            a = root[a]
        while root[b] != b:
            root[b] = root[root[b]]
            b = root[b]
        if a < b:
            root[b] = a
        else:
            root[a] = b
    for i in range(len(root)):
        # The roots of smaller nodes are already final, and root[i] is at most i.
        root[i] = root[root[i]]


@kernel
def flood_regions(chart, region, queue):
    """Assign to each texel without a region the region of the nearest texel of its chart.

    Distances are numbers of steps between texels that share an edge, within the chart. A texel from which no
    such path leads to a region keeps -1.

    chart : (H, W) int32, chart of each texel of a page, -1 for empty texels
    region : (H, W) int32, region of each texel; on entry, -1 for texels without a region
    queue : (H * W,) int64, working memory
    """
    height, width = chart.shape
    end = 0
    for r in range(height):
        for c in range(width):
            if region[r, c] >= 0:
                queue[end] = r * width + c
                end += 1
    first = 0
    while first < end:
        r, c = queue[first] // width, queue[first] % width
        first += 1
        for turn in range(4):
            rr = r + (turn - 1 if turn % 2 == 0 else 0)
            cc = c + (turn - 2 if turn % 2 == 1 else 0)
            if rr < 0 or rr >= height or cc < 0 or cc >= width:
                continue
            if region[rr, cc] < 0 and chart[rr, cc] >= 0 and chart[rr, cc] == chart[r, c]:
                region[rr, cc] = region[r, c]
                queue[end] = rr * width + cc
                end += 1


@kernel
def neighbour_pairs(pixel, back, chart, lookup, back_entry, size, chosen, both, pair):
    """Write pairs of entries of one chart whose texels share an edge. Both are fronts, or both are backs.

    pixel (n,) int64, back (n,) bool, chart (n,) int32 : see `TexelBuffer`
    lookup (P * H * W,) int32, back_entry (n_front,) int32 : see `TexelBuffer`
    size : int, width and height of a page, texels
    chosen : (n,) bool
    both : bool, if True, both entries of a pair are chosen, else at least one
    pair : (2 n, 2) int32 output, entries
    Returns the number of pairs.
    """
    found = 0
    for i in range(len(pixel)):
        if both and not chosen[i]:
            continue
        rest = pixel[i] % (size * size)
        for turn in range(2):
            # Turn 0: the pixel to the right; turn 1: the pixel in the next row.
            if (rest % size if turn == 0 else rest // size) == size - 1:
                continue
            beside = pixel[i] + (1 if turn == 0 else size)
            j = lookup[beside]
            if j < 0 or pixel[j] != beside:
                continue
            if back[i]:
                j = back_entry[j]
                if j < 0:
                    continue
            if chart[j] != chart[i]:
                continue
            if (chosen[i] and chosen[j]) if both else (chosen[i] or chosen[j]):
                pair[found, 0], pair[found, 1] = i, j
                found += 1
    return found
