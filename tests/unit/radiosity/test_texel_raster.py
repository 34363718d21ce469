"""The lists of triangles that overlap each texel agree with loops over texels and triangles."""

from __future__ import annotations

from itertools import pairwise

import naive
import numpy as np
import pytest

from baker.radiosity.kernels.texel_raster import keep_main_chart, list_overlaps, morton_keys


def rasterise(uv, triangle, page, size, n_pages):
    """Return {(page, row, column): {triangle: area}}. `list_overlaps` runs twice, to count and to write."""
    count = np.zeros(n_pages * size * size, np.int64)
    list_overlaps(uv, triangle, page, size, count, np.zeros(0, np.int32), np.zeros(0, np.float32))
    first = np.concatenate([[0], np.cumsum(count)]).astype(np.int64)
    entry, area = np.full(first[-1], -1, np.int32), np.full(first[-1], -1, np.float32)
    start = first[:-1].copy()
    list_overlaps(uv, triangle, page, size, start, entry, area)
    np.testing.assert_array_equal(start, first[1:])
    found = {}
    for k in np.flatnonzero(count):
        chosen = slice(first[k], first[k + 1])
        assert (np.diff(entry[chosen]) > 0).all()
        key = (int(k // (size * size)), int(k // size % size), int(k % size))
        found[key] = dict(zip(entry[chosen].tolist(), area[chosen].tolist(), strict=True))
    return found


@pytest.mark.parametrize("shape", ["small", "large", "thin"])
def test_lists_are_those_of_a_loop(shape):
    rng = np.random.default_rng(["small", "large", "thin"].index(shape))
    n, size = (30, 12) if shape == "small" else (12, 16)
    middle = rng.uniform(0.1, 0.9, (n, 1, 2))
    spread = rng.normal(0, 0.04 if shape == "small" else 0.25, (n, 3, 2))
    if shape == "thin":
        spread[:, 2] = spread[:, 0] * 0.5 + spread[:, 1] * 0.5 + rng.normal(0, 1e-3, (n, 2))
    uv = np.float32(np.clip(middle + spread, 0, 1)).reshape(-1, 2)
    triangle = np.arange(3 * n, dtype=np.int32).reshape(-1, 3)
    page = rng.integers(0, 2, n).astype(np.int32)
    ours, truth = rasterise(uv, triangle, page, size, 2), naive.covered_texels(uv, triangle, page, size)
    for key, entries in truth.items():
        for t, area in entries.items():
            # Overlaps below this area may be missing.
            if area > 1e-4:
                assert ours[key][t] == pytest.approx(area, abs=2e-6)
    for key, entries in ours.items():
        for t, area in entries.items():
            assert area == pytest.approx(truth.get(key, {}).get(t, 0.0), abs=2e-6)
    assert len(truth) > 60


def test_borders_on_the_grid_cover_no_neighbour():
    uv = np.float32([[2, 2], [5, 2], [5, 6], [2, 6]]) / np.float32(8)
    ours = rasterise(uv, np.int32([[0, 1, 2], [0, 2, 3]]), np.zeros(2, np.int32), 8, 1)
    assert {key[1:] for key in ours} == {(r, c) for r in range(2, 6) for c in range(2, 5)}
    assert all(sum(areas.values()) == pytest.approx(1, abs=1e-6) for areas in ours.values())


def test_uv_at_the_rim_of_the_page_stays_inside():
    uv = np.float32([[0, 0], [1, 0], [1, 1], [0, 1]])
    ours = rasterise(uv, np.int32([[0, 1, 2], [0, 2, 3]]), np.ones(2, np.int32), 4, 2)
    assert len(ours) == 16
    assert {key[0] for key in ours} == {1}
    assert sum(sum(areas.values()) for areas in ours.values()) == pytest.approx(16)
    assert rasterise(uv, np.zeros((0, 3), np.int32), np.zeros(0, np.int32), 4, 1) == {}
    point = rasterise(np.ones((3, 2), np.float32), np.int32([[0, 1, 2]]), np.zeros(1, np.int32), 4, 1)
    assert point == {(0, 3, 3): {0: 0.0}}


def test_the_larger_chart_keeps_a_texel():
    rng = np.random.default_rng(5)
    first = np.concatenate([[0], np.cumsum(rng.integers(1, 7, 200))]).astype(np.int64)
    chart = rng.integers(0, 3, 40).astype(np.int32)
    entry = np.concatenate([np.sort(rng.choice(40, b - a, replace=False)) for a, b in pairwise(first)])
    entry = entry.astype(np.int32)
    area = np.where(rng.random(len(entry)) < 0.3, 0, rng.random(len(entry))).astype(np.float32)
    texel_chart, kept = np.full(200, -1, np.int32), np.zeros(len(entry), bool)
    keep_main_chart(first, entry, area, chart, texel_chart, kept)
    for i in range(200):
        span = slice(first[i], first[i + 1])
        total = {c: area[span][chart[entry[span]] == c].sum() for c in chart[entry[span]]}
        assert total[texel_chart[i]] == pytest.approx(max(total.values()), abs=1e-6)
        own = chart[entry[span]] == texel_chart[i]
        some = own & (area[span] > 1e-7)
        # If the triangles of the chart only touch the texel, the first one is kept.
        np.testing.assert_array_equal(kept[span], some if some.any() else own & (np.cumsum(own) == 1))


def test_morton_order():
    rng = np.random.default_rng(6)
    x, y = rng.integers(0, 65536, (2, 200))
    for key, a, b in zip(morton_keys(y * 65536 + x, 65536), x, y, strict=True):
        assert int(key) == naive.interleave(int(a), int(b))
    pixel = np.arange(3 * 64, dtype=np.int64)
    order = pixel[np.argsort(morton_keys(pixel, 8))]
    np.testing.assert_array_equal(order // 64, np.repeat(np.arange(3), 64))
    np.testing.assert_array_equal(order[:8], [0, 1, 8, 9, 2, 3, 10, 11])
