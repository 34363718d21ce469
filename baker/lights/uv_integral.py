# mypy: disable-error-code="no-untyped-def"
"""Computes exact means of a texture over triangles in uv space, of any size.

    integral of f over a triangle = closed integral of F(x, y) dy along its edges,   dF / dx = f     (Green)

f is the filtered texture, and x and y are in texels. Along an edge, between two borders of texels, F is a
polynomial of degree 3 at most, so Simpson's rule is exact. F is computed from running sums along each row of
texels. The computing time is proportional to the number of texels that the *edges* cross, not to the area.

Based on: Green's theorem; Crow, Summed-area tables for texture mapping, 1984 (the running sums).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from baker.kernels.textures import wrapped
from baker.trace.jit import inner, kernel, larger, scratch, smaller

# Distance, texels, between the stored running sums of a row. Sums at other texels are computed from the
# stored sums on demand.
BLOCK = 32
# Number of components of f: red, green, blue, and the weighted sum of their squares.
N_SUMS = 4
# Limit of area / (longest edge)^2 of a triangle. Up to this limit, the triangle is treated as degenerate: it
# is integrated along its longest edge.
_THIN = 1.0e-9
# Limit of the largest side of a triangle's uv bounding box, texels. Up to this limit, the spread of a
# bilinear texture is estimated from sixteen points.
_FEW_CELLS = 3.0
# Limit of |integral| divided by the sum of the magnitudes of its terms. Up to this limit, an integral is
# treated as rounding error and set to 0.
_ROUNDING = 1.0e-12
# Spread (variance / mean^2) that a triangle gets if its mean is positive but the texture is black at all
# sixteen points.
_UNSEEN = 15.0
_four, _prefix, _texel = scratch((4,), np.float64), scratch((4,), np.float64), scratch((4,), np.float64)
_row_terms = scratch((2, 3, 4), np.float64)
_corner_memory, _totals, _sizes = (scratch(shape, np.float64) for shape in ((3, 2), (4,), (4,)))


class RowSums(NamedTuple):
    """Running sums along the rows of one texture at one resolution.

    block : (H, W // 32 + 1, 4) float64; item [j, b] is the sum over the texels 0 to 32 b - 1 of row j, of R,
        G, B and the weighted sum of their squares
    weight : (4,) float64, factors of R^2, G^2 and B^2 in the sum of squares; then 1 if column 3 of the pixels
        is the variance inside each texel, else 0
    texture : int, number of the texture in its `TexturePack`
    """

    block: NDArray[np.float64]
    weight: NDArray[np.float64]
    texture: int


@kernel
def fill_row_sums(pixels, offset, weight, block):
    """Write `block`, see `RowSums`, for the texture whose texels begin at `pixels[offset]`.

    Texels are added in the same order as in `_sum_before`. So the running sums before and after black texels
    are equal bit for bit.

    pixels : (H * W, 4) float32; offset : index of the first texel; weight : (4,) float64, see `RowSums`
    """
    h, n_blocks = block.shape[0], block.shape[1]
    w = len(pixels) // h
    sums = _four()
    for j in range(h):
        for c in range(4):
            sums[c] = 0.0
        for i in range(w):
            if i % BLOCK == 0:
                for c in range(4):
                    block[j, i // BLOCK, c] = sums[c]
            _add_texel(pixels, offset + j * w + i, weight, sums)
        if w % BLOCK == 0:
            for c in range(4):
                block[j, n_blocks - 1, c] = sums[c]


@inner
def _add_texel(pixels, at, weight, sums):
    """Add R, G, B and the weighted sum of squares of texel `at` to `sums` (4,) float64.

    pixels : (H * W, 4) float32; weight : (4,) float64, see `RowSums`
    """
    square = weight[3] * np.float64(pixels[at, 3])
    for c in range(3):
        value = np.float64(pixels[at, c])
        sums[c] += value
        square += weight[c] * value * value
    sums[3] += square


@inner
def _sum_before(pixels, w, weight, block, j, i, out):
    """Write the sums of texels 0 to i - 1 of row j, with 0 <= i <= w, to `out` (4,) float64.

    pixels : (H * W, 4) float32; weight, block : see `RowSums`
    """
    b = i // BLOCK
    for c in range(4):
        out[c] = block[j, b, c]
    for k in range(b * BLOCK, i):
        _add_texel(pixels, j * w + k, weight, out)


@inner
def _read(pixels, w, weight, j, i, out):
    """Write R, G, B and the weighted sum of squares of texel i of row j to `out` (4,) float64.

    pixels : (H * W, 4) float32; weight : (4,) float64, see `RowSums`
    """
    for c in range(4):
        out[c] = 0.0
    _add_texel(pixels, j * w + i, weight, out)


@inner
def _running(pixels, w, weight, block, mode, j, i, out, spare):
    """Write the sums of row j from column 0 to column i - 1, for any integer i, to `out` (4,) float64.

    The wrap mode continues the row outside the texture. For negative i, the result is minus the sum of
    columns i to -1.

    pixels : (H * W, 4) float32; weight, block : see `RowSums`; mode : see `TexturePack.wrap`
    spare : (4,) float64, working memory
    """
    if mode == 2:
        inside = smaller(larger(i, 0), w)
        _sum_before(pixels, w, weight, block, j, inside, out)
        if i != inside:
            _read(pixels, w, weight, j, 0 if i < 0 else w - 1, spare)
            for c in range(4):
                out[c] += (i - inside) * spare[c]
        return
    period = w if mode == 0 else 2 * w
    turns = i // period
    rest = i - turns * period
    back = rest > w
    _sum_before(pixels, w, weight, block, j, 2 * w - rest if back else rest, out)
    if turns != 0 or back:
        _sum_before(pixels, w, weight, block, j, w, spare)
        wholes = turns if mode == 0 else 2 * turns
        for c in range(4):
            out[c] = wholes * spare[c] + (2.0 * spare[c] - out[c] if back else out[c])


@inner
def _value(pixels, w, h, weight, wrap, nearest, x, y, out, spare):
    """Write R, G, B of the filtered texture at (x, y), and the weighted sum of their squares, to `out` (4,).

    x, y : texels. With bilinear filtering, whole numbers are texel centres; with nearest filtering, texel
        borders
    pixels : (H * W, 4) float32; weight : (4,) float64, see `RowSums`; wrap : (3,) int64
    spare : (4,) float64, working memory
    """
    i, j = np.int64(math.floor(x)), np.int64(math.floor(y))
    if nearest:
        _read(pixels, w, weight, wrapped(j, h, wrap[1]), wrapped(i, w, wrap[0]), out)
        return
    for c in range(4):
        out[c] = 0.0
    for b in range(2):
        for a in range(2):
            share = (x - i if a else 1.0 - (x - i)) * (y - j if b else 1.0 - (y - j))
            _read(pixels, w, weight, wrapped(j + b, h, wrap[1]), wrapped(i + a, w, wrap[0]), spare)
            within = spare[3]
            for c in range(3):
                out[c] += share * spare[c]
                within -= weight[c] * spare[c] * spare[c]
            out[3] += share * weight[3] * within
    for c in range(3):
        out[3] += weight[c] * out[c] * out[c]


@inner
def _load_cell(pixels, w, h, weight, block, wrap, nearest, first, i, j, terms, a, b):
    """Write the coefficients of F in cell (i, j), the square from (i, j) to (i + 1, j + 1).

    terms : (2, 3, 4) float64 output; for each of the rows j and j + 1: the integral from column `first` to
        column i, the texel in column i, and the texel in column i + 1
    pixels : (H * W, 4) float32; weight, block : see `RowSums`; wrap : (3,) int64
    a, b : (4,) float64, working memory
    """
    for r in range(1 if nearest else 2):
        line = wrapped(j + r, h, wrap[1])
        _running(pixels, w, weight, block, wrap[0], line, i, a, b)
        for c in range(4):
            terms[r, 0, c] = a[c]
        _running(pixels, w, weight, block, wrap[0], line, first, a, b)
        for c in range(4):
            terms[r, 0, c] -= a[c]
        _read(pixels, w, weight, line, wrapped(i, w, wrap[0]), a)
        for c in range(4):
            terms[r, 1, c] = terms[r, 2, c] = a[c]
        if not nearest:
            # Convert the sum to an integral between texel centres, by the trapezoidal rule.
            _read(pixels, w, weight, line, wrapped(first, w, wrap[0]), b)
            for c in range(4):
                terms[r, 0, c] += 0.5 * (a[c] - b[c])
            _read(pixels, w, weight, line, wrapped(i + 1, w, wrap[0]), a)
            for c in range(4):
                terms[r, 2, c] = a[c]


@inner
def _primitive(terms, nearest, c, fx, fy):
    """Return F of column c at (fx, fy), 0 to 1, inside a cell; terms (2, 3, 4) from `_load_cell`."""
    upper = terms[0, 0, c] + terms[0, 1, c] * fx
    if nearest:
        return upper
    upper += 0.5 * (terms[0, 2, c] - terms[0, 1, c]) * fx * fx
    lower = terms[1, 0, c] + terms[1, 1, c] * fx + 0.5 * (terms[1, 2, c] - terms[1, 1, c]) * fx * fx
    return (1.0 - fy) * upper + fy * lower


@inner
def _next(at, step, start, low, high):
    """Return the parameter t at which the coordinate start + t step of an edge reaches the texel border `at`.

    Returns 2 if `step` is 0, or if the edge has passed the last border in the range `low` to `high`.
    """
    if step == 0.0 or (step > 0.0 and at > high) or (step < 0.0 and at < low):
        return 2.0
    return (at - start) / step


@inner
def _walk(pixels, w, h, weight, block, wrap, nearest, first, ends, along, total, size):
    """Add the integral along an edge to `total` (4,), and the magnitudes of its terms to `size` (4,).

    pixels : (H * W, 4) float32; weight, block : see `RowSums`; wrap : (3,) int64
    first : column from which F is integrated
    ends : six float: x0, y0, x1, y1 of the ends, texels, and the weight of f at each end
    along : bool; if true, the integral of f times the linearly interpolated weight along the edge is added,
        else the integral of F dy
    """
    x0, y0, x1, y1, first_weight, last_weight = ends
    dx, dy = x1 - x0, y1 - y0
    if not along and dy == 0.0:
        return
    terms, a, b = _row_terms(), _prefix(), _texel()
    # If the texture is clamped, consider only borders of texels near the texture.
    low_x, high_x = (-1.0, w + 1.0) if wrap[0] == 2 else (-1.0e30, 1.0e30)
    low_y, high_y = (-1.0, h + 1.0) if wrap[1] == 2 else (-1.0e30, 1.0e30)
    line_x = math.floor(x0) + 1.0 if dx > 0.0 else math.ceil(x0) - 1.0
    line_y = math.floor(y0) + 1.0 if dy > 0.0 else math.ceil(y0) - 1.0
    line_x = larger(line_x, low_x) if dx > 0.0 else smaller(line_x, high_x)
    line_y = larger(line_y, low_y) if dy > 0.0 else smaller(line_y, high_y)
    t = 0.0
    while t < 1.0:
        at_x, at_y = _next(line_x, dx, x0, low_x, high_x), _next(line_y, dy, y0, low_y, high_y)
        end = smaller(smaller(at_x, at_y), 1.0)
        if at_x <= end:
            line_x += 1.0 if dx > 0.0 else -1.0
        if at_y <= end:
            line_y += 1.0 if dy > 0.0 else -1.0
        if end <= t:
            continue
        middle = 0.5 * (t + end)
        if along:
            for k in range(3):
                s = t if k == 0 else (middle if k == 1 else end)
                # Evaluate f just inside the interval from t to end, because two texels meet at its ends.
                inside = middle + (s - middle) * (1.0 - 1.0e-9)
                _value(pixels, w, h, weight, wrap, nearest, x0 + inside * dx, y0 + inside * dy, a, b)
                share = (4.0 if k == 1 else 1.0) / 6.0 * (end - t)
                share *= first_weight + (last_weight - first_weight) * s
                for c in range(4):
                    total[c] += share * a[c]
                    size[c] += share * a[c]
        else:
            i, j = np.int64(math.floor(x0 + middle * dx)), np.int64(math.floor(y0 + middle * dy))
            _load_cell(pixels, w, h, weight, block, wrap, nearest, first, i, j, terms, a, b)
            share = (end - t) * dy / 6.0
            for c in range(4):
                part = _primitive(terms, nearest, c, x0 + t * dx - i, y0 + t * dy - j)
                part += 4.0 * _primitive(terms, nearest, c, x0 + middle * dx - i, y0 + middle * dy - j)
                part += _primitive(terms, nearest, c, x0 + end * dx - i, y0 + end * dy - j)
                total[c] += share * part
                size[c] += abs(share * part)
        t = end


@inner
def _measured_spread(pixels, w, h, weight, wrap, nearest, corner, lit):
    """Return E[f^2] / E[f]^2 - 1, estimated at the centroids of sixteen equal parts of a triangle.

    pixels : (H * W, 4) float32; weight : (4,) float64, see `RowSums`; wrap : (3,) int64
    corner : (3, 2) float64, texels; lit : whether the mean over the triangle is positive
    """
    a, b, mean = _prefix(), _texel(), _four()
    for part in range(16):
        i, j = 0, part
        while j >= 2 * (4 - i) - 1:
            j -= 2 * (4 - i) - 1
            i += 1
        third = 1.0 if j % 2 == 0 else 2.0
        b1, b2 = (i + third / 3.0) / 4.0, (j // 2 + third / 3.0) / 4.0
        x = corner[0, 0] + b1 * (corner[1, 0] - corner[0, 0]) + b2 * (corner[2, 0] - corner[0, 0])
        y = corner[0, 1] + b1 * (corner[1, 1] - corner[0, 1]) + b2 * (corner[2, 1] - corner[0, 1])
        _value(pixels, w, h, weight, wrap, nearest, x, y, a, b)
        for c in range(4):
            mean[c] += a[c] / 16.0
    square = 0.0
    for c in range(3):
        square += weight[c] * mean[c] * mean[c]
    if square <= 0.0:
        return _UNSEEN if lit else 0.0
    return larger(mean[3] / square - 1.0, 0.0)


@kernel
def uv_means(uv, pixels, w, h, wrap, weight, block, mean, spread):
    """Average a texture over n triangles.

    Parameters
    ----------
    uv : (n, 3, 2) float64, corners of the triangles
    pixels : (H * W, 4) float32, linear; w, h : width and height, texels
    wrap : (3,) int64, see `TexturePack.wrap`
    weight, block : see `RowSums`
    mean : (n, 3) float64 output, RGB, exact up to rounding
    spread : (n,) float64 output, weighted variance / mean^2 of the texture. If the texture is bilinear, it is
        an estimate for triangles at most `_FEW_CELLS` wide, and an upper bound for wider triangles
    """
    nearest = wrap[2] != 0
    shift = 0.0 if nearest else 0.5
    corner, total, size = _corner_memory(), _totals(), _sizes()
    for n in range(len(uv)):
        for k in range(3):
            corner[k, 0], corner[k, 1] = uv[n, k, 0] * w - shift, uv[n, k, 1] * h - shift
        for c in range(4):
            total[c] = size[c] = 0.0
        area = (corner[1, 0] - corner[0, 0]) * (corner[2, 1] - corner[0, 1])
        area = 0.5 * (area - (corner[1, 1] - corner[0, 1]) * (corner[2, 0] - corner[0, 0]))
        longest, top = -1.0, 0
        for k in range(3):
            after = (k + 1) % 3
            square = (corner[after, 0] - corner[k, 0]) ** 2 + (corner[after, 1] - corner[k, 1]) ** 2
            if square > longest:
                longest, top = square, (k + 2) % 3
        thin = abs(area) <= _THIN * longest
        if longest <= 1.0e-18:
            _value(pixels, w, h, weight, wrap, nearest, corner[0, 0], corner[0, 1], total, size)
            area = 1.0
        elif thin:
            # Integrate a degenerate triangle along its longest edge. The weight of f is proportional to the
            # triangle's width: it rises linearly from 0 at one end to the projection of corner `top`, then
            # falls to 0 at the other end.
            p, q = (top + 1) % 3, (top + 2) % 3
            way_x, way_y = corner[q, 0] - corner[p, 0], corner[q, 1] - corner[p, 1]
            at = (corner[top, 0] - corner[p, 0]) * way_x + (corner[top, 1] - corner[p, 1]) * way_y
            at = smaller(larger(at / longest, 0.0), 1.0)
            x, y = corner[p, 0] + at * way_x, corner[p, 1] + at * way_y
            ends = (corner[p, 0], corner[p, 1], x, y, 0.0, 2.0 * at)
            _walk(pixels, w, h, weight, block, wrap, nearest, 0, ends, True, total, size)
            ends = (x, y, corner[q, 0], corner[q, 1], 2.0 * (1.0 - at), 0.0)
            _walk(pixels, w, h, weight, block, wrap, nearest, 0, ends, True, total, size)
            area = 1.0
        else:
            low = smaller(smaller(corner[0, 0], corner[1, 0]), corner[2, 0])
            first = np.int64(math.floor(low))
            for k in range(3):
                after = (k + 1) % 3
                ends = (corner[k, 0], corner[k, 1], corner[after, 0], corner[after, 1], 0.0, 0.0)
                _walk(pixels, w, h, weight, block, wrap, nearest, first, ends, False, total, size)
        square, lit = 0.0, False
        for c in range(3):
            value = total[c] / area
            value = value if value > _ROUNDING * size[c] / abs(area) else 0.0
            mean[n, c] = value
            square += weight[c] * value * value
            lit = lit or value > 0.0
        wide = 0.0
        for k in range(3):
            after = (k + 1) % 3
            wide = larger(wide, abs(corner[after, 0] - corner[k, 0]))
            wide = larger(wide, abs(corner[after, 1] - corner[k, 1]))
        spread[n] = 0.0
        if lit and not nearest and wide <= _FEW_CELLS:
            spread[n] = _measured_spread(pixels, w, h, weight, wrap, nearest, corner, lit)
        elif square > 0.0:
            spread[n] = larger(total[3] / area / square - 1.0, 0.0)
