"""`verify` assigns its points to rooms, gaps and charts, and computes the footprints of lookups at edges."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tiny_scenes import Quad, box_quads, grey, quad_atlas, quad_scene

from baker.core.geometry import world_geometry
from baker.metrics.texel_area import instance_map, surface_points
from baker.pathtracer.scene import build_reference
from baker.verification.edges import border_texels, edge_points
from baker.verification.points import chart_numbers
from baker.verification.surroundings import find_surroundings, in_contact, visible

SIZE = 64


def surface(quads, size=SIZE):
    scene = quad_scene(quads)
    geometry = world_geometry(scene, quad_atlas(scene, size, inset=0.3))
    return (
        geometry,
        instance_map(geometry, 1, size),
        build_reference(scene, lambertian=True, find_solids=True),
    )


def points_of(geometry, owner, step=1):
    pixel = np.flatnonzero(owner.reshape(-1) >= 0)[::step]
    return pixel, surface_points(geometry, pixel, SIZE, 16, 0)


def two_rooms():
    return [
        *box_quads((0, 0, 0), (1, 1, 1), inward=True, material=grey(0.5, 1.0)),
        *box_quads((1.1, 0, 0), (2, 1, 1), inward=True, material=grey(0.5, 1.0, double_sided=True)),
    ]


def test_closed_rooms_are_told_apart():
    geometry, owner, reference = surface(two_rooms())
    with reference:
        pixel, points = points_of(geometry, owner, 3)
        found = find_surroundings(reference, points, 0)
        again = find_surroundings(reference, points, 0)
    first = owner.reshape(-1)[pixel] < 6
    assert set(found.room[first]) | set(found.room[~first]) <= {-1, 0, 1}
    for side in (first & ~found.gap, ~first & ~found.gap):
        room = np.bincount(found.room[side] + 1, minlength=3)
        assert room.max() > 0.95 * side.sum()
    assert np.argmax(np.bincount(found.room[first] + 1)) != np.argmax(np.bincount(found.room[~first] + 1))
    assert not found.inside.any()
    np.testing.assert_array_equal(found.room, again.room)


def test_a_gap_is_no_room():
    floor = Quad((0, 0, 0), (1, 0, 0), (0, 1, 0))
    plate = box_quads((0.3, 0.3, 0.002), (0.7, 0.7, 0.1), inward=False)
    geometry, owner, reference = surface([floor, *plate])
    with reference:
        pixel, points = points_of(geometry, owner)
        found = find_surroundings(reference, points, 0)
        near = in_contact(reference, points, 0)
    on_floor = owner.reshape(-1)[pixel] == 0
    under = (np.abs(points.position[:, :, :2] - 0.5).max(axis=(1, 2)) < 0.2) & on_floor
    out = (np.abs(points.position[:, :, :2] - 0.5).max(axis=2).min(axis=1) > 0.25) & on_floor
    assert under.sum() > 10
    assert found.gap[under].all()
    assert not found.gap[out].any()
    assert near[under].all()
    assert not near[np.abs(points.position[:, 0, :2] - 0.5).max(axis=1) > 0.45].all()


def test_points_in_the_air_are_not_inside_solids():
    floor = Quad((-2, -2, 0), (4, 0, 0), (0, 4, 0))
    corners = [((-0.8, -0.5, -0.3), (0.4, 0.6, 0.9)), ((-0.2, -0.7, -0.4), (0.9, 0.3, 0.7))]
    corners.append(((-0.5, -0.1, -0.2), (0.6, 0.8, 0.6)))
    quads = [quad for low, high in corners for quad in box_quads(low, high, inward=False)]
    geometry, owner, reference = surface([floor, *quads])
    with reference:
        _, points = points_of(geometry, owner)
        found = find_surroundings(reference, points, 0)
    inside = [
        ((found.air > np.add(low, 1e-3)) & (found.air < np.subtract(high, 1e-3))).all(axis=1)
        for low, high in corners
    ]
    assert len(found.air) > 100
    assert not np.any(inside)


def test_what_is_seen_from_a_point():
    _, _, reference = surface(two_rooms())
    place = np.array([[0.5, 0.5, 0.0], [1.0, 0.5, 0.5], [1.5, 0.5, 0.0]])
    face = np.array([[0.0, 0, 1], [-1, 0, 0], [0, 0, 1]])
    with reference:
        seen = visible(reference, np.array([[0.5, 0.4, 0.6], [1.6, 0.5, 0.5]]), place, face)
    np.testing.assert_array_equal(seen, [[True, True, False], [False, False, True]])


def floor_under_a_wall():
    floor = Quad((0, 0, 0), (2, 0, 0), (0, 2, 0))
    wall = Quad((1.013, 0, -0.5), (0, 2, 0), (0, 0, 1.5), grey(double_sided=True))
    return surface([floor, wall])


def test_lookups_beside_a_wall_are_held_against_their_own_side():
    geometry, owner, reference = floor_under_a_wall()
    covered = owner >= 0
    with reference:
        found = edge_points(reference, geometry, owner, covered, 400, 16, 0)
    mine = found.owner == 0
    # x of the lookups, in metres. On the floor, u is a linear function of x.
    column = found.pixel % SIZE + 0.5 + found.surface.offset[:, 0]
    uv, position = geometry.uv[:4], geometry.position[:4]
    fit = np.polyfit(uv[:, 0] * SIZE, position[:, 0], 1)
    x = np.polyval(fit, column)
    width = fit[0]
    straddles = mine & (np.abs(x - 1.013) < width)
    assert straddles.sum() > 10
    side = np.sign(found.surface.position[..., 0] - 1.013)
    assert (side[straddles] == np.sign(x - 1.013)[straddles, None]).all()
    # All points of a footprint lie within 2.1 texels of the lookup.
    off = np.abs(found.surface.position[..., 0] - x[:, None])[mine]
    assert off.max() < 2.1 * width


def test_footprints_have_the_mean_of_a_lookup():
    """The mean position of a footprint is the position of its lookup, so linear light has no error."""
    geometry, owner, reference = surface([Quad((0, 0, 0), (2, 0, 0), (0, 2, 0))])
    with reference:
        found = edge_points(reference, geometry, owner, owner >= 0, 500, 256, 0)
    inside = np.flatnonzero(~border_texels(owner, owner >= 0).reshape(-1)[found.pixel])
    assert len(inside) > 40
    at = np.stack([found.pixel % SIZE, found.pixel // SIZE], axis=1) + 0.5 + found.surface.offset
    fit = [np.polyfit(geometry.uv[:4, k] * SIZE, geometry.position[:4, k], 1) for k in (0, 1)]
    for k in (0, 1):
        mean = found.surface.position[inside, :, k].mean(axis=1)
        error = (mean - np.polyval(fit[k], at[inside, k])) / fit[k][0]
        # A texel has 16 points, so its mean position has an error of 0.07 texels. A lookup uses four texels.
        assert np.abs(error).mean() < 0.05
        assert abs(error.mean()) < 0.02


def test_border_texels():
    owner = np.full((1, 8, 8), -1, np.int32)
    owner[0, 1:7, 1:7] = 0
    covered = owner >= 0
    covered[0, 6] = False
    found = border_texels(owner, covered)[0]
    assert found[1:7, 1].all()
    assert found[5, 1:7].all(), "the last covered row"
    assert found[6, 1:7].all(), "surface beyond it"
    assert not found[2:5, 2:6].any()
    assert not found[0].any()


def test_border_texels_beside_an_object_of_a_higher_index():
    owner = np.full((1, 6, 8), -1, np.int32)
    owner[0, 1:5, 1:4], owner[0, 1:5, 4:7] = 0, 5
    covered = owner >= 0
    covered[0, 2:4, 3] = False
    found = border_texels(owner, covered)[0]
    assert found[2:4, 3].all(), "surface of object 0 beyond its covered texels, beside object 5"
    swapped = np.where(owner == 0, 5, np.where(owner == 5, 0, -1)).astype(np.int32)
    np.testing.assert_array_equal(border_texels(swapped, covered)[0], found)


def test_charts_are_pieces_of_uv():
    quads = [Quad((0, 0, 0), (1, 0, 0), (0, 1, 0)), Quad((0, 0, 2), (0, 3, 0), (1, 0, 1))]
    scene = quad_scene(quads)
    geometry = world_geometry(scene, quad_atlas(scene, 32))
    np.testing.assert_array_equal(chart_numbers(geometry), [0, 0, 1, 1])
    # Split vertices with equal uv are joined, but other objects with the same uv are not.
    split = replace(
        geometry,
        uv=geometry.uv[geometry.triangle.reshape(-1)],
        triangle=np.arange(12, dtype=np.int32).reshape(4, 3),
    )
    np.testing.assert_array_equal(chart_numbers(split), [0, 0, 1, 1])
    same = replace(geometry, uv=np.concatenate([geometry.uv[:4]] * 2))
    assert len(set(chart_numbers(same).tolist())) == 2


@pytest.mark.parametrize("covered", [True, False])
def test_a_bake_without_edges_is_no_error(covered):
    geometry, owner, reference = surface([Quad((0, 0, 0), (1, 0, 0), (0, 1, 0))])
    with reference:
        found = edge_points(reference, geometry, owner, (owner >= 0) & covered, 20, 4, 0)
    assert len(found.pixel) == len(found.surface.position)
