"""A texel that extends to both sides of a wall is split into sides. Lookups of rays choose one side."""

from __future__ import annotations

import numpy as np
import pytest
from tiny_scenes import Quad, box_quads, grey, quad_world

from baker.radiosity.kernels.form_factor import SPLIT
from baker.radiosity.patches import build_patches
from baker.radiosity.point_cache import points_of
from baker.radiosity.sides import split_texels

SIZE = 48


def floor_and(*quads):
    """Return the world of a floor of 4 x 4 m that faces up, and of other quads."""
    return quad_world([Quad((-2, 0, 2), (4, 0, 0), (0, 0, -4), grey()), *quads], SIZE, inset=0.3)


def wall(x, *, low=0.0, high=1.0, z=(-3.0, 3.0)):
    return Quad((x, low, z[0]), (0, 0, z[1] - z[0]), (0, high - low, 0), grey(double_sided=True))


def cut(world, mask=None, threads=1):
    return split_texels(world.texels, world.job(mask, threads))


def points(sides, entry):
    return points_of(sides.surface, sides.valid_points, np.asarray(entry, np.int64))[0]


@pytest.mark.parametrize("x", [0.031, 0.52, -1.3])
def test_points_of_an_entry_lie_on_one_side_of_a_wall(x):
    world = floor_and(wall(x))
    sides = cut(world)
    floor = np.flatnonzero(sides.texels.instance == 0)
    place = points(sides, floor)[..., 0]
    assert ((place < x).all(axis=1) | (place > x).all(axis=1)).all()
    # Each point of a split texel belongs to exactly one side. The areas of the sides sum to the texel's area.
    n = world.texels.n
    split = np.unique(sides.surface.front[n:])
    for front in split:
        own = np.flatnonzero((sides.surface.front == front) & ~sides.texels.back)
        bits = sides.valid_points[own].astype(int)
        assert np.bitwise_or.reduce(bits) == 0xFFFF
        assert sum(bits) == 0xFFFF
        assert sides.texels.area[own].sum() == pytest.approx(world.texels.area[front], rel=1e-5)
        # The side that is stored in the page is the larger one.
        assert int(sides.valid_points[front]).bit_count() >= 8
    assert len(split) >= 10
    # Texels that are not split do not change.
    rest = np.setdiff1d(np.arange(n), split)
    assert (sides.valid_points[rest] == 0xFFFF).all()
    assert sides.texels.area[rest].tobytes() == world.texels.area[rest].tobytes()


def test_a_lookup_finds_the_centroid_of_the_side_that_is_kept():
    world = floor_and(wall(0.031))
    sides = cut(world)
    front = np.unique(sides.surface.front[world.texels.n :])
    # The floor's u is along x, and its 4 m are SIZE / 2 - 1 - 0.6 texels.
    metres = 4.0 / (SIZE // 2 - 1.6)
    for entry in front:
        free = (int(sides.valid_points[entry]) >> np.arange(16)) & 1 == 1
        every, _ = points_of(world.surface, world.free, np.array([entry], np.int64))
        mean = every[0][free].mean(axis=0)
        np.testing.assert_allclose(sides.texels.position[entry], mean, atol=1e-5)
        middle = world.texels.position[entry] - world.texels.centroid[entry, 0] * metres * np.array([1, 0, 0])
        assert sides.texels.centroid[entry, 0] == pytest.approx((mean[0] - middle[0]) / metres, abs=0.05)


def test_walls_split_the_floor_into_regions_and_a_gap_below_them_changes_nothing():
    for low in (0.0, 0.02):
        sides = cut(floor_and(wall(0.5, low=low)))
        floor = sides.texels.instance[: sides.texels.n_front] == 0
        region = sides.texels.region[floor]
        left = sides.texels.position[: sides.texels.n_front][floor][:, 0] < 0.5
        assert len(np.unique(region[left])) == len(np.unique(region[~left])) == 1
        assert region[left][0] != region[~left][0]
        # Texels of all other charts have the index of their chart as region.
        other = sides.texels.region[~floor]
        assert (other == sides.texels.chart[: sides.texels.n_front][~floor]).all()


def test_a_wall_that_ends_in_the_middle_leaves_one_region():
    sides = cut(floor_and(wall(0.5, z=(-3.0, 0.2))))
    floor = sides.texels.instance[: sides.texels.n_front] == 0
    assert len(np.unique(sides.texels.region[floor])) == 1
    assert len(sides.owner) > 3


def test_a_low_step_and_an_untouched_room_split_nothing():
    # The step is 1 cm high. The texels are 18 cm wide.
    assert len(cut(floor_and(wall(0.5, high=0.01))).owner) == 0
    room = quad_world(box_quads((0, 0, 0), (2, 1.5, 2), inward=True), 32, inset=0.2)
    sides = cut(room)
    assert sides.texels.n == room.texels.n
    assert (sides.texels.region == room.texels.chart[: room.texels.n_front]).all()


def test_points_inside_geometry_stay_out_of_every_side():
    world = floor_and(wall(0.5), wall(0.58))
    place = points_of(world.surface, world.free, np.arange(world.texels.n))[0]
    inside = (place[..., 0] > 0.5) & (place[..., 0] < 0.58) & (world.texels.instance == 0)[:, None]
    mask = ((~inside).astype(np.uint32) << np.arange(16, dtype=np.uint32)).sum(axis=1).astype(np.uint16)
    sides = cut(world, mask)
    member = sides.member
    for entry in member:
        front = int(sides.surface.front[entry])
        assert int(sides.valid_points[entry]) & ~int(mask[front]) == 0
    kept = points(sides, member)[..., 0]
    assert ((kept <= 0.5) | (kept >= 0.58)).all()


def test_patches_end_at_walls_though_their_chart_goes_on():
    world = floor_and(wall(0.5))
    sides = cut(world)
    patches = build_patches(sides.texels, max_patches=60, link=sides.link)
    assert patches.block >= 4
    floor = np.flatnonzero((sides.texels.instance == 0) & ~sides.texels.back)
    left = points(sides, floor)[:, :, 0].mean(axis=1) < 0.5
    assert not set(patches.patch[floor[left]]) & set(patches.patch[floor[~left]])
    loose = build_patches(sides.texels, max_patches=60)
    assert set(loose.patch[floor[left]]) & set(loose.patch[floor[~left]])


def test_images_refer_to_the_values_of_sides():
    sides = cut(floor_and(wall(0.5)))
    light = np.arange(4 * sides.texels.n, dtype=np.float32).reshape(-1, 4)
    seen = sides.seen_light(light)
    row = seen.image[sides.texels.pixel[sides.owner] + 0, 3]
    fronts = ~sides.texels.back[sides.owner]
    np.testing.assert_array_equal(row[fronts], np.flatnonzero(fronts) + 1)
    np.testing.assert_array_equal(seen.value[:, :3], light[sides.member, :3])
    patch = np.arange(sides.texels.n, dtype=np.int32)
    found = sides.seen_patches(patch)
    assert (found.image[sides.texels.pixel[sides.owner[fronts]]] == SPLIT - np.flatnonzero(fronts)).all()
    np.testing.assert_array_equal(found.value, sides.member)
    # Each of a texel's 16 points is mapped to the entry whose mask contains the point.
    for s, owner in enumerate(sides.owner):
        for k in range(16):
            m = sides.table.member[s, k]
            assert m >= 0
            assert int(sides.valid_points[sides.member[m]]) >> k & 1
            assert sides.surface.front[sides.member[m]] == sides.surface.front[owner]


def test_the_same_for_any_number_of_threads():
    world = floor_and(wall(0.031), wall(-0.8, z=(-1.0, 0.3)))
    one, three = (cut(world, threads=threads) for threads in (1, 3))
    for name in ("valid_points", "owner", "member", "link"):
        assert getattr(one, name).tobytes() == getattr(three, name).tobytes()
    assert one.texels.region.tobytes() == three.texels.region.tobytes()


@pytest.mark.parametrize("apex", [(0.31, 0.12), (-0.44, 0.57), (0.02, -0.83)])
def test_a_corner_of_two_walls_is_found_in_every_texel_that_it_reaches_into(apex):
    x, z = apex
    walls = [
        Quad((x, 0.0, z), edge, (0, 1.0, 0), grey(double_sided=True))
        for edge in ((3.0, 0, 2.6), (3.0, 0, -2.9))
    ]
    world = floor_and(*walls)
    sides = cut(world)
    floor = np.flatnonzero((world.texels.instance == 0) & ~world.texels.back)
    # Texels away from the floor's border are squares along x and z, centred at their positions.
    metres = 4.0 / (SIZE // 2 - 1.6)
    whole = floor[np.abs(world.texels.position[floor][:, [0, 2]]).max(axis=1) < 1.8]
    spot = (np.stack(np.meshgrid(np.arange(40), np.arange(40)), axis=-1).reshape(-1, 2) + 0.5) / 40 - 0.5
    place = world.texels.position[whole][:, None, [0, 2]] + 0.996 * metres * spot
    dx, dz = place[..., 0] - x, place[..., 1] - z
    within = (dx > 0) & (dz < dx * 2.6 / 3.0) & (dz > -dx * 2.9 / 3.0)
    both = within.any(axis=1) & ~within.all(axis=1)
    assert both.sum() > 15
    assert set(whole[both]) <= set(sides.owner)
