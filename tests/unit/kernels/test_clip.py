"""Triangles clipped to texel squares equal polygons that `naive.cut_polygon` finds from candidate corners."""

from __future__ import annotations

import naive
import numpy as np
import pytest
from inner import compiled

from baker.kernels.clip import MAX_CORNERS, clip_to_square, polygon_area, polygon_point, square_touches

clip_to_square, polygon_area, polygon_point, square_touches = compiled(
    clip_to_square, polygon_area, polygon_point, square_touches
)


def cut(corner, x0=0, y0=0):
    out, spare = np.zeros((MAX_CORNERS, 2)), np.zeros((MAX_CORNERS, 2))
    return out, clip_to_square(np.asarray(corner, float), x0, y0, out, spare)


def random_triangles(n, rng):
    corner = rng.uniform(-1.5, 2.5, (n, 3, 2))
    # Make a third of the triangles large and a third small.
    corner[: n // 3] = corner[: n // 3] * 4 - 1.5
    corner[n // 3 : 2 * n // 3] = corner[n // 3 : 2 * n // 3, :1] + rng.normal(0, 0.2, (n // 3, 3, 2))
    return corner


def test_areas_are_those_of_the_polygons():
    rng = np.random.default_rng(0)
    corners = {0: 0}
    seven = [[0.5, -0.2], [1.7 / 1.4 + 0.0143, 0.5286], [-4.6, 4.9]]
    for corner in [np.array(seven), *random_triangles(900, rng)]:
        x0, y0 = (0, 0) if corner[2, 1] == 4.9 else rng.integers(-1, 2, 2)
        out, n = cut(corner, x0, y0)
        polygon = naive.cut_polygon(corner, x0, y0)
        assert polygon_area(out, n) == pytest.approx(naive.shoelace(polygon)[0], abs=1e-12)
        if naive.shoelace(polygon)[0] > 1e-9:
            # Both polygons have the same corners. The corners in `out` are relative to the corner (x0, y0) of
            # the square.
            ours = out[:n] + np.array((x0, y0))
            assert all(np.linalg.norm(polygon - c, axis=1).min() < 1e-9 for c in ours)
            assert all(np.linalg.norm(ours - c, axis=1).min() < 1e-9 for c in polygon)
        assert (out[:n] >= -1e-12).all()
        assert (out[:n] <= 1 + 1e-12).all()
        corners[n] = corners.get(n, 0) + 1
    assert set(corners) == {0, 3, 4, 5, 6, 7}
    assert polygon_area(np.zeros((MAX_CORNERS, 2)), 0) == 0


@pytest.mark.parametrize(
    ("corner", "area"),
    [
        ([[0, 0], [1, 0], [1, 1]], 0.5),
        ([[-5, -5], [9, -5], [-5, 9]], 1.0),
        ([[0, 0], [1, 0], [0.5, 0]], 0.0),
        ([[0.2, 0.2]] * 3, 0.0),
        ([[1, 0], [2, 0], [1, 1]], 0.0),
        ([[0, 1], [1, 0], [1, 1]], 0.5),
        ([[-1, 0.5], [2, 0.5], [0.5, 0.5]], 0.0),
    ],
)
def test_areas_at_borders(corner, area):
    for turn in (corner, corner[::-1]):
        out, n = cut(turn)
        assert polygon_area(out, n) == pytest.approx(area, abs=1e-15)


def test_touching_is_what_the_area_says():
    rng = np.random.default_rng(1)
    seen = [0, 0, 0]
    for corner in random_triangles(1500, rng):
        x0, y0 = (int(c) for c in rng.integers(-1, 2, 2))
        how = square_touches(corner, x0, y0)
        low, high = corner.min(axis=0), corner.max(axis=0)
        in_box = (low <= [x0 + 1, y0 + 1]).all() and (high >= [x0, y0]).all()
        area = naive.cut_area(corner, x0, y0)
        # `square_touches` tests the edges only. Its caller tests the bounding box first.
        assert bool(how and in_box) == (area > 0)
        assert (how == 2) == (area > 1 - 1e-12)
        seen[how] += 1
    assert min(seen) > 50


def test_a_triangle_without_area_touches_along_its_line_only():
    line = np.array([[0.5, 0.5], [3.5, 3.5], [2.0, 2.0]])
    for turn in (line, line[::-1], line[[1, 2, 0]]):
        touched = {(x, y) for x in range(4) for y in range(4) if square_touches(turn, x, y)}
        # The line passes through corners that four squares share. At each such corner, it also touches the
        # two squares beside the line.
        assert touched == {(x, y) for x in range(4) for y in range(4) if abs(x - y) <= 1}
    assert square_touches(np.full((3, 2), 0.3), 0, 0) == 1


def test_points_are_uniform_in_the_polygon():
    rng = np.random.default_rng(2)
    tables, expected = [], []
    for corner in (
        [[-0.3, 0.1], [1.4, 0.3], [0.6, 1.2]],
        [[0.1, 0.2], [0.9, 0.4], [0.3, 0.8]],
        [[-1, -1], [3, -1], [-1, 3]],
    ):
        out, n = cut(corner)
        points = np.array([polygon_point(out, n, u, v) for u, v in rng.random((8000, 2))])
        assert all(naive.inside(corner, p, 1e-9) for p in points[:500])
        assert points.min() >= -1e-12
        assert points.max() <= 1 + 1e-12
        table = np.histogram2d(*points.T, bins=8, range=[[0, 1], [0, 1]])[0]
        area = [[naive.cut_area(corner, i / 8, j / 8, 1 / 8) for j in range(8)] for i in range(8)]
        tables.append(table)
        expected.append(np.array(area) / np.sum(area) * len(points))
    chance = [naive.chi_square_chance(*pair) for pair in zip(tables, expected, strict=True)]
    assert min(chance) > naive.sidak(len(chance))


def test_points_of_what_is_no_polygon():
    out = np.zeros((MAX_CORNERS, 2))
    out[:3] = [[0.2, 0.2], [0.6, 0.4], [0.4, 0.3]]
    assert polygon_point(out, 0, 0.5, 0.5) == (0, 0)
    assert polygon_point(out, 1, 0.5, 0.5) == (0.2, 0.2)
    assert polygon_point(out, 2, 0.5, 0.5) == pytest.approx((0.4, 0.3))
    # The polygon is degenerate, a line. All random numbers give points on the line.
    for u in (0.0, 0.5, 1.0):
        x, y = polygon_point(out, 3, u, 0.7)
        assert 0.2 <= x <= 0.6
        assert y - 0.1 == pytest.approx(x / 2)
