# mypy: disable-error-code="no-untyped-def"
"""Rasterises chart outlines conservatively, and places them in a page by first fit, from the lowest row up.

A shape is a set of triangles, and an item is one placed copy of a shape. The outline of a shape consists of
one span of texels for each row. In each row of the page, the search for free space skips whole runs of used
texels, so its time depends on the number of runs and not on the width of the page.

Based on: Lévy, Petitjean, Ray, Maillot, *Least Squares Conformal Maps for Automatic Texture Atlas
Generation*, 2002 (packing along outlines). Unlike that method, this one also uses free space below outlines.
"""

from __future__ import annotations

import math

from baker.trace.jit import inner, kernel, larger, smaller


@kernel
def outline_spans(corner, first_triangle, shape, scale, first_row, low, high):
    """Write, for each row of each shape, the first and the last texel that the shape touches.

    Parameters
    ----------
    corner : (T, 3, 2) float64, metres
        Corners of the triangles of all shapes. The lower left corner of the bounding box of each shape is
        at (0, 0).
    first_triangle : (S + 1,) int64
        Shape s has the triangles `first_triangle[s]` to `first_triangle[s + 1]` - 1.
    shape : (n,) int64
        Indices of the shapes to rasterise.
    scale : (S, 2) float64, texels per metre
        Scale of each shape along u and v.
    first_row : (S + 1,) int64
        The rows of shape s are the elements `first_row[s]` to `first_row[s + 1]` - 1 of `low` and `high`.
    low, high : (R,) int32
        In: a large number (`low`) and -1 (`high`). Out: columns of the first and of the last texel that the
        shape touches in this row. Texel k spans k - 0.5 to k + 0.5.
    """
    for s in shape:
        row0 = first_row[s]
        n_rows = first_row[s + 1] - row0
        su, sv = scale[s, 0], scale[s, 1]
        for t in range(first_triangle[s], first_triangle[s + 1]):
            y_low = smaller(smaller(corner[t, 0, 1], corner[t, 1, 1]), corner[t, 2, 1]) * sv
            y_high = larger(larger(corner[t, 0, 1], corner[t, 1, 1]), corner[t, 2, 1]) * sv
            r_low = larger(0, math.ceil(y_low - 0.5))
            r_high = smaller(n_rows - 1, math.floor(y_high + 0.5))
            for r in range(r_low, r_high + 1):
                bottom, top = r - 0.5, r + 0.5
                x_low, x_high = 1e30, -1e30
                for k in range(3):
                    ax, ay = corner[t, k, 0] * su, corner[t, k, 1] * sv
                    m = k + 1 if k < 2 else 0
                    bx, by = corner[t, m, 0] * su, corner[t, m, 1] * sv
                    if bottom <= ay <= top:
                        x_low, x_high = smaller(x_low, ax), larger(x_high, ax)
                    # Intersect the edge with the two borders of the row.
                    for border in (bottom, top):
                        if (ay < border) != (by < border):
                            x = ax + (bx - ax) * (border - ay) / (by - ay)
                            x_low, x_high = smaller(x_low, x), larger(x_high, x)
                if x_high < x_low:
                    continue
                c_low, c_high = math.ceil(x_low - 0.5), math.floor(x_high + 0.5)
                low[row0 + r] = smaller(low[row0 + r], larger(c_low, 0))
                high[row0 + r] = larger(high[row0 + r], c_high)


@inner
def _fill(next_used, next_free, y, start, end):
    """Mark texels `start` to `end` of row `y` as used.

    next_used, next_free : (H, W + 1) int16, in and out, see `place_items`
    """
    width = next_used.shape[1] - 1
    after = next_free[y, end + 1] if end + 1 < width else width
    for x in range(start, end + 1):
        next_used[y, x] = x
        next_free[y, x] = after
    # Update `next_free` of the used run to the left.
    x = start - 1
    while x >= 0 and next_used[y, x] == x:
        next_free[y, x] = after
        x -= 1
    # Update `next_used` of the free run to the left.
    x = start - 1
    while x >= 0 and next_used[y, x] > start:
        next_used[y, x] = start
        x -= 1


@inner
def _find(next_used, next_free, low, high, row0, n_rows, margin, y_start):
    """Return the lowest and then leftmost position (x, y) at which an outline fits, or (-1, -1).

    next_used, next_free : (H, W + 1) int16, see `place_items`
    low, high : (R,) int32, see `outline_spans`; the outline is elements `row0` to `row0 + n_rows` - 1
    margin : number of empty texels along the page border; y_start : lowest row to test
    """
    height = next_used.shape[0]
    width = next_used.shape[1] - 1
    most = 0
    for r in range(n_rows):
        most = larger(most, high[row0 + r])
    for y in range(y_start, height - margin - n_rows + 1):
        x = margin
        r, checked = 0, 0
        while x + most < width - margin:
            # If row r overlaps a used run, move x past that run and test all rows again.
            a, b = low[row0 + r], high[row0 + r]
            if b >= a:
                used = next_used[y + r, x + a]
                if used <= x + b:
                    x = next_free[y + r, used] - a
                    checked = 0
                    continue
            checked += 1
            if checked == n_rows:
                return x, y
            r = r + 1 if r + 1 < n_rows else 0
    return -1, -1


@kernel
def place_items(next_used, next_free, order, item_shape, first_row, low, high, gap, margin, lowest, position):
    """Place items one after the other, and stop at the first item that does not fit.

    Parameters
    ----------
    next_used, next_free : (H, W + 1) int16
        In and out. `next_used[y, x]` is the column of the first used texel of row y at column x or to the
        right of it, and `next_free[y, x]` that of the first free texel; W if there is none. On an empty page,
        `next_used` is W and `next_free` is x.
    order : (N,) int64
        Indices of the items to place, in this order.
    item_shape : (I,) int64
        Shape of each item.
    first_row, low, high : arrays
        Outlines of the shapes, see `outline_spans`.
    gap : int
        Number of empty texels between outlines.
    margin : int
        Number of empty texels along the page border.
    lowest : (S,) int64
        In and out: lowest row at which each shape may still fit.
    position : (I, 2) int32
        Out: column and row of the texel at the lower left corner of each item's bounding box.

    Returns
    -------
    int
        Number of items placed.
    """
    height = next_used.shape[0]
    width = next_used.shape[1] - 1
    for n in range(len(order)):
        item = order[n]
        s = item_shape[item]
        row0, n_rows = first_row[s], first_row[s + 1] - first_row[s]
        x, y = _find(next_used, next_free, low, high, row0, n_rows, margin, lowest[s])
        if x < 0:
            return n
        lowest[s] = y
        position[item, 0], position[item, 1] = x, y
        # Mark the outline, dilated by `gap` texels, as used.
        for r in range(-gap, n_rows + gap):
            if not 0 <= y + r < height:
                continue
            a, b = 1 << 30, -1
            for k in range(larger(0, r - gap), smaller(n_rows, r + gap + 1)):
                if high[row0 + k] >= low[row0 + k]:
                    a, b = smaller(a, low[row0 + k]), larger(b, high[row0 + k])
            if b >= a:
                _fill(next_used, next_free, y + r, larger(0, x + a - gap), smaller(width - 1, x + b + gap))
    return len(order)
