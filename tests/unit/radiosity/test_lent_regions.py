"""A texel inside geometry between two regions is assigned to the region that uses it in bilinear lookups."""

from __future__ import annotations

import numpy as np
import pytest
from tiny_scenes import Quad, grey, quad_world

from baker.kernels.surface import N_POINTS, place_points
from baker.radiosity.lent_regions import lend_regions

WALL = 7


@pytest.fixture(scope="module")
def floor():
    """Return the world of a square, and the page column (n, 16), in texels, of the points of its n texels."""
    world = quad_world([Quad((0, 0, 0), (1, 0, 0), (0, 1, 0), grey())], size=16)
    n = world.texels.n_front
    point, normal = np.zeros((n, N_POINTS, 3), np.float32), np.zeros((n, N_POINTS, 3), np.float32)
    triangle, bary = np.zeros((n, N_POINTS), np.int32), np.zeros((n, N_POINTS, 2), np.float32)
    every = np.full(len(world.texels.pixel), 0xFFFF, np.uint16)
    turn = np.arange(N_POINTS, dtype=np.uint8)[None]
    place_points(world.surface, every, np.arange(n), turn, point, normal, triangle, bary)
    # The square covers 15 columns. The centre of column c is at c + 0.5.
    return world, 15.0 * point[..., 0].astype(float)


def lent(floor, left_ends, right_begins):
    """Return the set of regions (0 left, 1 right) of each column that is inside geometry completely.

    Points at columns from `left_ends` to `right_begins` are marked as inside geometry.
    """
    world, x = floor
    bits = np.uint16(1) << np.arange(N_POINTS, dtype=np.uint16)
    mask = (((x < left_ends) | (x > right_begins)) * bits).sum(axis=1).astype(np.uint16)
    column = world.texels.pixel[: world.texels.n_front] % 16
    region = (column > WALL).astype(np.int32)
    region[mask == 0] = -7
    before = region.copy()
    lend_regions(world.texels, world.surface, region, mask)
    assert (region[mask != 0] == before[mask != 0]).all()
    inside = [c for c in range(15) if (mask[column == c] == 0).all()]
    return [set(region[column == c].tolist()) for c in inside]


def test_points_within_a_texel_of_its_centre_decide(floor):
    # Only column 7 is inside geometry completely. Its centre is 0.6 texels from the valid points of one
    # region, and 1.2 texels from those of the other region.
    assert lent(floor, 6.9, 8.7) == [{0}]
    assert lent(floor, 6.3, 8.1) == [{1}]


def test_texels_that_no_lookup_uses_get_the_nearest_region(floor):
    found = lent(floor, 3.9, 11.1)
    assert len(found) == 7
    assert found[:3] == [{0}] * 3
    assert found[-3:] == [{1}] * 3
