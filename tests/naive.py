"""Implements kernels in slow, simple ways for comparison, and statistical tests of samplers."""

from __future__ import annotations

import math

import numpy as np
from scipy.stats import chi2

# ---- statistics ----


def chi_square_chance(observed, expected):
    """Return the p-value of Pearson's chi-square test of `observed` counts; `expected` may have any scale."""
    observed, expected = np.ravel(observed).astype(float), np.ravel(expected).astype(float)
    assert (observed[expected == 0] == 0).all()
    observed, expected = observed[expected > 0], expected[expected > 0]
    # Merge bins with an expected count below 5, because the chi-square distribution is inaccurate for them.
    few = expected < 5
    if few.any():
        observed = np.append(observed[~few], observed[few].sum())
        expected = np.append(expected[~few], expected[few].sum())
    expected = expected * (observed.sum() / expected.sum())
    return float(chi2.sf(((observed - expected) ** 2 / expected).sum(), len(expected) - 1))


def sidak(n, significance=1e-3):
    """Return the significance level of each of n independent tests that gives `significance` in total."""
    return 1.0 - (1.0 - significance) ** (1.0 / n)


def assert_uniform(tables):
    """Check that every table of counts is uniform, by chi-square tests with a Sidak bound."""
    tables = [np.asarray(t) for t in tables]
    chance = [chi_square_chance(t, np.full(t.size, t.sum() / t.size)) for t in tables]
    assert min(chance) > sidak(len(tables)), f"{min(chance):.2e} at table {int(np.argmin(chance))}"


# ---- rays ----


def intersect(position, triangle, origin, direction, near=0.0, far=np.inf):
    """Return (distance / |direction|, triangle or -1) of the closest hit, by Moeller and Trumbore."""
    corner = np.asarray(position, float)[np.asarray(triangle, int)]
    if not len(corner):
        return np.inf, -1
    origin, direction = np.asarray(origin, float), np.asarray(direction, float)
    a, b = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
    p = np.cross(direction, b)
    with np.errstate(all="ignore"):
        inverse = 1.0 / (a * p).sum(1)
        s = origin - corner[:, 0]
        u = (s * p).sum(1) * inverse
        q = np.cross(s, a)
        v = (q @ direction) * inverse
        t = (b * q).sum(1) * inverse
    hit = np.isfinite(inverse) & (u >= 0) & (v >= 0) & (u + v <= 1) & (t >= near) & (t <= far)
    if not hit.any():
        return np.inf, -1
    best = int(np.argmin(np.where(hit, t, np.inf)))
    return float(t[best]), best


def barycentric(corner, point):
    """Return the barycentric coordinates b1, b2 of a point in the plane of a triangle (3, k), float64."""
    corner = np.asarray(corner, float)
    edges = np.stack([corner[1] - corner[0], corner[2] - corner[0]], axis=1)
    return np.linalg.lstsq(edges, np.asarray(point, float) - corner[0], rcond=None)[0]


# ---- planes ----


def inside(corner, point, slack=0.0):
    """Return whether a 2D point lies in a triangle of either winding."""
    (ax, ay), (bx, by), (cx, cy) = corner
    x, y = point
    side = np.array([
        (bx - ax) * (y - ay) - (by - ay) * (x - ax),
        (cx - bx) * (y - by) - (cy - by) * (x - bx),
        (ax - cx) * (y - cy) - (ay - cy) * (x - cx),
    ])  # fmt: skip
    return bool((side >= -slack).all() or (side <= slack).all())


def cut_polygon(corner, x0, y0, width=1.0):
    """Return the corners of the intersection of a triangle and the square at (x0, y0), in order."""
    corner = [tuple(map(float, c)) for c in corner]
    square = [(x0, y0), (x0 + width, y0), (x0 + width, y0 + width), (x0, y0 + width)]
    points = [p for p in corner if x0 <= p[0] <= x0 + width and y0 <= p[1] <= y0 + width]
    points += [p for p in square if inside(corner, p)]
    for i in range(3):
        ax, ay = corner[i]
        bx, by = corner[(i + 1) % 3]
        for x in (x0, x0 + width):
            if (ax - x) * (bx - x) < 0:
                y = ay + (by - ay) * (x - ax) / (bx - ax)
                if y0 <= y <= y0 + width:
                    points.append((x, y))
        for y in (y0, y0 + width):
            if (ay - y) * (by - y) < 0:
                x = ax + (bx - ax) * (y - ay) / (by - ay)
                if x0 <= x <= x0 + width:
                    points.append((x, y))
    if len(points) < 3:
        return np.array(points).reshape(-1, 2)
    points = np.array(points)
    middle = points.mean(axis=0)
    return points[np.argsort(np.arctan2(*(points - middle).T[::-1]), kind="stable")]


def shoelace(polygon):
    """Return area and centroid of a polygon (n, 2)."""
    if len(polygon) < 3:
        return 0.0, np.full(2, np.nan)
    x, y = polygon.T
    cross = x * np.roll(y, -1) - np.roll(x, -1) * y
    area = 0.5 * cross.sum()
    if area == 0:
        return 0.0, np.full(2, np.nan)
    centre = np.array([((x + np.roll(x, -1)) * cross).sum(), ((y + np.roll(y, -1)) * cross).sum()]) / (
        6 * area
    )
    return abs(float(area)), centre


def cut_area(corner, x0, y0, width=1.0):
    """Return the area of the intersection of a triangle and a square."""
    return shoelace(cut_polygon(corner, x0, y0, width))[0]


def covered_texels(uv, triangle, page, size):
    """Return {(page, row, column): {triangle: covered area in texels}} for all covered texels."""
    found = {}
    for t, corners in enumerate(np.asarray(uv, float)[triangle] * size):
        low, high = np.floor(corners.min(0)).astype(int), np.ceil(corners.max(0)).astype(int)
        for y in range(max(low[1], 0), min(high[1], size)):
            for x in range(max(low[0], 0), min(high[0], size)):
                area = cut_area(corners, x, y)
                if area > 0:
                    found.setdefault((int(page[t]), y, x), {})[t] = area
    return found


def interleave(x, y):
    """Return the Morton code of two 16-bit numbers."""
    return int("".join(b + a for a, b in zip(f"{x:016b}", f"{y:016b}", strict=True)), 2)


# ---- numbers and directions ----


def bits_reversed(x):
    """Return the 32 bits of a number in reverse order."""
    return int(f"{x:032b}"[::-1], 2)


def owen_hash(x, seed):
    """Return the hash of Laine and Karras, whose bit k depends only on bits 0 to k."""
    x = (x + seed) % 2**32
    for factor in (0x6C50B47C, 0xB82F1E52, 0xC7AFE638, 0x8D22F6E6):
        x ^= x * factor % 2**32
    return x


def cosine_direction(u, v):
    """Return the direction of (u, v) by Shirley and Chiu's concentric map, projected up to the hemisphere."""
    a, b = 2.0 * u - 1.0, 2.0 * v - 1.0
    if a == 0 and b == 0:
        return np.array([0.0, 0.0, 1.0])
    if abs(a) > abs(b):
        r, angle = a, math.pi / 4 * b / a
    else:
        r, angle = b, math.pi / 2 - math.pi / 4 * a / b
    return np.array([r * math.cos(angle), r * math.sin(angle), math.sqrt(max(0.0, 1.0 - r * r))])


def frame(normal):
    """Return the rotation whose columns are tangent, bitangent and normal (Duff et al. 2017)."""
    x, y, z = map(float, normal)
    sign = 1.0 if z >= 0 else -1.0
    a = -1.0 / (sign + z)
    return np.array([
        [1 + sign * x * x * a, x * y * a, x],
        [sign * x * y * a, sign + y * y * a, y],
        [-sign * x, -y, z],
    ])  # fmt: skip


# ---- textures ----


def wrapped(i, n, mode):
    """Return the index in 0..n-1 to which a wrap mode maps pixel i."""
    if mode == "repeat":
        return i % n
    if mode == "mirror":
        return (list(range(n)) + list(range(n))[::-1])[i % (2 * n)]
    return min(max(i, 0), n - 1)


def bilinear(image, u, v, wrap):
    """Return the bilinear lookup of a linear image (H, W, C) at uv."""
    height, width = image.shape[:2]
    x, y = u * width - 0.5, v * height - 0.5
    x0, y0 = math.floor(x), math.floor(y)
    out = np.zeros(image.shape[2])
    for j in (0, 1):
        for i in (0, 1):
            weight = (1 - abs(x - x0 - i)) * (1 - abs(y - y0 - j))
            out += weight * image[wrapped(y0 + j, height, wrap[1]), wrapped(x0 + i, width, wrap[0])]
    return out


def pyramid(image):
    """Return the mip levels of an image by 2 x 2 means; an odd last row or column is left out."""
    levels = [np.asarray(image, float)]
    while levels[-1].shape[:2] != (1, 1):
        last = levels[-1]
        height, width = max(last.shape[0] // 2, 1), max(last.shape[1] // 2, 1)
        step_y, step_x = min(last.shape[0], 2), min(last.shape[1], 2)
        cells = last[: height * step_y, : width * step_x].reshape(height, step_y, width, step_x, -1)
        levels.append(cells.mean(axis=(1, 3)))
    return levels


# ---- lookups ----


def hit_pixel(uv, page, double_sided, size, n_pages, t, u, v, front):
    """Return the pixel index of a hit, -1 for a black back. Indices of backs follow those of all fronts."""
    if not front and not double_sided[t]:
        return -1
    x, y = ((1 - u - v) * uv[t, 0] + u * uv[t, 1] + v * uv[t, 2]).astype(float) * size
    column, row = (int(np.clip(int(c), 0, size - 1)) for c in (x, y))
    pixel = (int(page[t]) * size + row) * size + column
    return pixel if front else pixel + n_pages * size * size
