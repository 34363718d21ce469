"""`find_solids` distinguishes solids from sheets by edges, and solids from rooms by what is inside."""

from __future__ import annotations

import numpy as np
import pytest
from scenes import icosphere

from baker.topology.solids import BEFORE, BEHIND, NOWHERE, SolidSurfaces, find_solids
from baker.topology.winding_number import Enclosure, winding_number

BOX = np.array(
    [
        [0, 4, 6], [0, 6, 2], [1, 3, 7], [1, 7, 5], [0, 1, 5], [0, 5, 4],
        [2, 6, 7], [2, 7, 3], [0, 2, 3], [0, 3, 1], [4, 5, 7], [4, 7, 6],
    ]
)  # fmt: skip
NOBODY = np.zeros((0, 3))


def box(low, high, inward=False):
    """Return the triangles (12, 3, 3) of a box."""
    low, high = np.array(low, float), np.array(high, float)
    corner = low + np.array([[i & 1, i >> 1 & 1, i >> 2 & 1] for i in range(8)]) * (high - low)
    return corner[BOX[:, ::-1] if inward else BOX]


def shifted(corner, *by):
    return corner + np.array(by)


def ball(radius, inward=False, level=2):
    return radius * icosphere(level, inward=inward)


FLOOR = np.array([[[-9, 0, -9], [-9, 0, 9], [9, 0, 9]], [[-9, 0, -9], [9, 0, 9], [9, 0, -9]]], float)
CRATE = box((0, 0, 0), (1, 1, 1))
SMALL = box((0.4, 0.4, 0.4), (0.6, 0.6, 0.6))


def covers(*objects, **more):
    """Return for each object whether all its triangles are covers."""
    return [bool(cover.all()) for _, _, _, cover in classify(*objects, **more)]


def classify(*objects, viewpoints=NOBODY, double_sided=True, emits=(), hit_filter=()):
    """Return (inside, room, sealed, cover) for each object, arrays with one element per triangle."""
    count = [len(one) for one in objects]
    corner = np.concatenate(objects).reshape(-1, 3)
    owner = np.repeat(np.arange(len(objects)), count)
    surfaces = SolidSurfaces(
        position=corner.astype(np.float32),
        triangle=np.arange(len(corner)).reshape(-1, 3),
        instance=owner,
        opaque=~np.isin(owner, hit_filter),
        double_sided=np.full(len(owner), double_sided),
        emits=np.isin(owner, emits),
    )
    solids = find_solids(surfaces, np.array(viewpoints, float).reshape(-1, 3))
    columns = solids.inside, solids.room, solids.sealed, solids.cover
    return [tuple(column[owner == k] for column in columns) for k in range(len(count))]


def kinds(found):
    """Return the distinct values of `inside` of each object."""
    return [sorted(set(inside.tolist())) for inside, *_ in found]


@pytest.mark.parametrize("double_sided", [False, True])
def test_a_crate_on_a_floor_is_solid_and_the_floor_is_not(double_sided):
    found = classify(FLOOR, CRATE, double_sided=double_sided)
    assert kinds(found) == [[NOWHERE], [BEHIND]]
    assert found[1][2].all()


def test_crates_of_several_objects_and_several_crates_in_one_object():
    sides = [CRATE[2 * k : 2 * k + 2] for k in range(6)]
    # The corners of adjacent sides differ by a rounding error.
    sides[3] = sides[3] + 2e-7
    assert kinds(classify(FLOOR, *sides)) == [[NOWHERE]] + 6 * [[BEHIND]]
    beside = np.concatenate([CRATE, shifted(CRATE, 1, 0, 0), shifted(CRATE, 0, 3, 0)])
    inside = classify(FLOOR, beside)[1][0]
    # The coincident walls of the two touching crates are the surface of no solid.
    assert (inside == NOWHERE).sum() == 4
    assert (inside == BEHIND).sum() == 32


def test_winding():
    assert kinds(classify(FLOOR, CRATE[:, ::-1])) == [[NOWHERE], [BEFORE]]
    mixed = CRATE.copy()
    mixed[[1, 4, 5]] = mixed[[1, 4, 5], ::-1]
    inside = classify(FLOOR, mixed)[1][0]
    assert (inside[[1, 4, 5]] == BEFORE).all()
    assert (np.delete(inside, [1, 4, 5]) == BEHIND).all()
    both_ways = np.concatenate([CRATE, CRATE[:, ::-1]])
    inside = classify(FLOOR, both_ways)[1][0]
    assert (inside == np.repeat([BEHIND, BEFORE], 12)).all()


def test_what_encloses_nothing():
    sheets = np.concatenate([FLOOR, FLOOR[:, ::-1]])
    assert kinds(classify(sheets, CRATE)) == [[NOWHERE], [BEHIND]]
    no_lid = np.delete(CRATE, [6, 7], axis=0)
    assert kinds(classify(FLOOR, no_lid)) == [[NOWHERE], [NOWHERE]]
    assert kinds(classify(FLOOR, CRATE, hit_filter=[1])) == [[NOWHERE], [NOWHERE]]
    thin = box((0, 0, 0), (1, 1, 1e-6))
    assert kinds(classify(FLOOR, thin)) == [[NOWHERE], [NOWHERE]]
    assert kinds(classify(FLOOR, box((0, 0, 0), (4, 3, 0.001)))) == [[NOWHERE], [BEHIND]]


def test_a_crate_without_a_bottom_covers_what_it_stands_on():
    bottomless = np.delete(CRATE, [4, 5], axis=0)
    assert covers(FLOOR, bottomless) == [False, True]
    assert covers(FLOOR, bottomless, double_sided=False) == [False, False]
    assert covers(FLOOR, bottomless[:, ::-1]) == [False, False]
    # With a light or furniture inside, the crate is a hut, not a cover.
    assert covers(FLOOR, bottomless, viewpoints=[(0.5, 0.5, 0.5)]) == [False, False]
    assert covers(FLOOR, bottomless, shifted(SMALL, 0, -0.4, 0)) == [False, False, False]
    two_holes = np.delete(CRATE, [4, 5, 6, 7], axis=0)
    assert covers(FLOOR, two_holes) == [False, False]
    # Half of a wall is missing, like a door.
    assert covers(FLOOR, np.delete(CRATE, [4, 5, 11], axis=0)) == [False, False]


def test_small_holes_do_no_harm():
    holed = np.delete(ball(1.0, level=3), 7, axis=0)
    (_, (inside, _, sealed, _)) = classify(FLOOR, holed)
    assert (inside == BEHIND).all()
    assert not sealed.any()
    # With an object inside it, the ball with a hole is not solid.
    assert kinds(classify(FLOOR, holed, 0.2 * SMALL))[1] == [NOWHERE]
    # A T-junction, an edge beside two edges of half its length, does not open the crate.
    split = np.concatenate([CRATE[:1], CRATE[2:]])
    a, b, c = CRATE[1]
    middle = 0.5 * (b + c)
    split = np.concatenate([split, [[a, b, middle], [a, middle, c]]])
    assert classify(FLOOR, split)[1][2].all()


def test_rooms_are_told_from_crates_by_what_is_in_them():
    light = (0.5, 0.9, 0.5)
    out = (3.0, 0.9, 0.5)
    assert kinds(classify(FLOOR, CRATE, SMALL, viewpoints=[out])) == [[NOWHERE], [BEHIND], [BEHIND]]
    inside, room, *_ = classify(FLOOR, CRATE, SMALL, viewpoints=[out, light])[1]
    assert (inside == NOWHERE).all()
    assert room.all()
    assert kinds(classify(FLOOR, CRATE, SMALL, emits=[2]))[1:] == [[NOWHERE], [BEHIND]]
    # An emitter in the ceiling makes the crate a room. An emitter at the outside of a wall does not.
    assert kinds(classify(FLOOR, CRATE, shifted(SMALL, 0, 0.45, 0), emits=[2]))[1] == [NOWHERE]
    assert kinds(classify(FLOOR, CRATE, shifted(SMALL, 0, 0, 0.55), emits=[2]))[1] == [BEHIND]


def test_rooms_that_look_inwards():
    room = box((-3, 0, -3), (3, 3, 3), inward=True)
    assert kinds(classify(room)) == [[NOWHERE]]
    assert kinds(classify(room, CRATE)) == [[NOWHERE], [BEHIND]]
    # The crate is partly below the floor of the room.
    assert kinds(classify(room, CRATE - [0, 0.1, 0], FLOOR - [0, 1, 0])) == [[NOWHERE], [BEHIND], [NOWHERE]]
    # A house with thick walls: the solid is the space between the outer and the inner walls.
    house = box((-3.3, -0.3, -3.3), (3.3, 3.3, 3.3))
    for objects in ((house, room), (np.concatenate([house, room]),)):
        found = classify(*objects, CRATE, viewpoints=[(0, 2, 0)])
        assert kinds(found) == [[BEHIND]] * len(found)
        assert all(sealed.all() for _, _, sealed, _ in found)


@pytest.mark.parametrize("inward", [False, True])
@pytest.mark.parametrize("emits", [(), (0,)])
def test_a_sky_sphere_is_no_solid(inward, emits):
    sky = ball(50.0, inward)
    found = classify(sky, FLOOR, CRATE, shifted(CRATE, 2, 0.5, 0.5), emits=emits)
    assert kinds(found) == [[NOWHERE], [NOWHERE], [BEHIND], [BEHIND]]
    assert found[0][1].all()


def test_no_triangles_give_no_solids():
    assert kinds(classify(np.zeros((0, 3, 3)))) == [[]]


def test_winding_numbers_along_a_line_are_those_of_solid_angles():
    surface = np.concatenate(
        [ball(1.0, level=4), ball(0.4, inward=True), shifted(ball(0.9, level=2), 1.3, 0.2, 0)]
    )
    many = Enclosure(surface)
    assert many.many
    rng = np.random.default_rng(0)
    points = rng.uniform(-1.2, 2.3, (60, 3))
    truth = [winding_number(surface, point) for point in points]
    np.testing.assert_allclose([many.winding(point) for point in points], truth, atol=1e-6)
    assert {round(value) for value in truth} == {0, 1, 2}
