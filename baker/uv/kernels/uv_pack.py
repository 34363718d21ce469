# mypy: disable-error-code="no-untyped-def"
"""Places chart outlines in a page: conservative outlines, then first fit from the lowest row up.

An outline is one span of texels per row. The search for free space jumps from occupied run to occupied run,
so its cost hardly depends on the size of the page.

Based on: Lévy, Petitjean, Ray, Maillot, *Least Squares Conformal Maps for Automatic Texture Atlas
Generation*, 2002 (packing along outlines); here with runs per row, so that holes are filled, too.
"""

from __future__ import annotations

import math

from baker.trace.jit import inner, kernel, larger, smaller


@kernel
def outline_spans(corner, first_triangle, shape, scale, first_row, low, high):
    """Write the span of texels that each row of each shape touches.

    Parameters
    ----------
    corner : (T, 3, 2) float64, metres, each shape's lower corner at 0
    first_triangle : (S + 1,) int64
        Triangles `first_triangle[s]` to `first_triangle[s + 1]` belong to shape s.
    shape : (S,) int64
        Shapes to write.
    scale : (S, 2) float64, texels per metre along u and v
    first_row : (S + 1,) int64
        Rows of shape s in `low` and `high`.
    low, high : (R,) int32
        Out: first and last texel touched; texel k spans k - 0.5 to k + 0.5. Preset to (big, -1).
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
                    # Where the edge crosses the two borders of the row.
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

    next_used, next_free : (H, W + 1) int16, see `place_items`; in and out.
    """
    width = next_used.shape[1] - 1
    after = next_free[y, end + 1] if end + 1 < width else width
    for x in range(start, end + 1):
        next_used[y, x] = x
        next_free[y, x] = after
    # Extend the used run to the left.
    x = start - 1
    while x >= 0 and next_used[y, x] == x:
        next_free[y, x] = after
        x -= 1
    # Point the free run to the left at the new texels.
    x = start - 1
    while x >= 0 and next_used[y, x] > start:
        next_used[y, x] = start
        x -= 1


@inner
def _find(next_used, next_free, low, high, row0, n_rows, margin, y_start):
    """Return the lowest, then leftmost position (x, y) at which an outline fits, or (-1, -1).

    next_used, next_free : (H, W + 1) int16, see `place_items`.
    low, high : (R,) int32, see `outline_spans`; the outline has `n_rows` rows from `row0` on.
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
            # If row r is blocked, move x past the used run and test all rows again.
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
    """Place items one after the other; stop at the first that does not fit.

    Parameters
    ----------
    next_used, next_free : (H, W + 1) int16
        The page: next used and next free column at or after each column.
        On an empty page the first is W everywhere and the second each column itself.
    order : (N,) int64
        Items to place, in this order.
    item_shape : (I,) int64
    first_row, low, high : outlines, see `outline_spans`
    gap : int
        Empty texels between outlines.
    margin : int
        Empty texels along the page border.
    lowest : (S,) int64
        Lowest row at which each shape may fit; in and out, kept between calls.
    position : (I, 2) int32
        Out: column and row of the outline's lower corner, in texels.

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
        # Mark the outline, dilated by `gap`, as used.
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
