"""Slivers are triangles whose height over their longest side is less than 1/50 of this side."""

from __future__ import annotations

import numpy as np
import pytest

from baker.topology.slivers import SLIVER, find_slivers


def height_over_length(corner):
    """Return a triangle's height over its longest side divided by that side, by Heron's formula."""
    sides = [float(np.linalg.norm(corner[k] - corner[k - 1])) for k in range(3)]
    s = sum(sides) / 2
    area = max(s * (s - sides[0]) * (s - sides[1]) * (s - sides[2]), 0.0) ** 0.5
    return 2 * area / max(sides) ** 2


@pytest.mark.parametrize("seed", range(4))
def test_slivers_are_those_of_the_slow_formula(seed):
    rng = np.random.default_rng(seed)
    corner = rng.normal(size=(200, 3, 3)) * [1.0, 1.0, 0.02] * [1.0, 0.02, 1.0]
    ratio = np.array([height_over_length(one) for one in corner])
    assert np.abs(ratio - SLIVER).min() > 1e-6
    found = find_slivers(corner)
    assert found.any()
    assert not found.all()
    assert np.array_equal(found, ratio < SLIVER)


def test_the_limit_is_a_fiftieth_from_every_corner():
    for height, expected in ((0.0199, True), (0.0201, False)):
        corner = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.7, height, 0.0]])
        turned = np.stack([np.roll(corner, k, axis=0) for k in range(3)])
        assert find_slivers(turned).tolist() == [expected] * 3
        assert find_slivers(1e-6 * turned).tolist() == find_slivers(1e6 * turned).tolist() == [expected] * 3


def test_no_triangles_and_points_are_no_slivers():
    assert find_slivers(np.zeros((0, 3, 3))).tolist() == []
    assert find_slivers(np.ones((1, 3, 3))).tolist() == [False]
