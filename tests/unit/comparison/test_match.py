"""`match` maps surface points of one scene to a scene with other triangles, objects or transforms."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tiny_scenes import Quad, joined, quad_atlas, quad_scene

from baker.comparison.match import TrianglePoints, make_sides, match
from baker.comparison.pairs import pair_objects
from baker.comparison.pictures import read
from baker.core.atlas import Atlas, InstanceLayout
from baker.core.geometry import world_geometry
from baker.io.bake.read_bake import StoredBake

FLOOR = Quad((0, 0, 0), (4, 0, 0), (0, 2, 0))
CEILING = Quad((0, 0, 3), (0, 2, 0), (4, 0, 0))


def plain_atlas(scene):
    """Return an atlas whose uv are (0, 0) everywhere. It is for tests that read no lightmap."""
    layouts = []
    for k, instance in enumerate(scene.instances):
        mesh = scene.meshes[instance.mesh]
        row, chart = np.arange(len(mesh.position), dtype=np.int32), np.zeros(len(mesh.triangle), np.int32)
        uv = np.zeros((len(row), 2), np.float32)
        layouts.append(InstanceLayout(k, 0, row, uv, mesh.triangle, chart, True, 1.0))
    return Atlas(16, 1, tuple(layouts), 1, 1)


def sides_of(a, b):
    surfaces = (world_geometry(scene, plain_atlas(scene)) for scene in (a, b))
    return make_sides(*surfaces, a, b, pair_objects(a, b))


def scattered(geometry, n=400):
    random = np.random.default_rng(5)
    weight = random.dirichlet((1, 1, 1), n)
    return TrianglePoints(random.integers(0, len(geometry.triangle), n), weight)


def assert_same_places(sides, points, found):
    assert (found.triangle >= 0).all()
    apart = points.at(sides.a, "position") - found.at(sides.b, "position")
    np.testing.assert_allclose(apart, 0, atol=1e-6)
    facing = sides.a.face_normal[points.triangle] * sides.b.face_normal[found.triangle]
    np.testing.assert_allclose(facing.sum(axis=1), 1, atol=1e-6)


def test_the_same_mesh_gives_the_same_triangle_and_weights():
    scene = quad_scene([FLOOR, CEILING])
    sides = sides_of(scene, scene)
    points = scattered(sides.a)
    found = match(sides, points)
    assert (found.triangle == points.triangle).all()
    assert (found.weight == points.weight).all()


def test_triangles_in_another_order_and_split_otherwise():
    scene = quad_scene([FLOOR, CEILING])
    a = joined(scene)
    # Split the quads along the other diagonal, and put the floor's triangles last.
    b = joined(scene)
    mesh = replace(b.meshes[0], triangle=np.int32([[4, 5, 7], [5, 6, 7], [0, 1, 3], [1, 2, 3]]))
    sides = sides_of(a, replace(b, meshes=(mesh,)))
    assert not sides.pairs.same.any()
    points = scattered(sides.a)
    assert_same_places(sides, points, match(sides, points))


@pytest.mark.parametrize("order", [[0, 1, 2, 3], [2, 3, 0, 1]])
def test_of_two_faces_back_to_back_the_one_that_looks_the_same_way(order):
    card = quad_scene([FLOOR, Quad((0, 0, 0), (0, 2, 0), (4, 0, 0))])
    a, b = joined(card, [3, 2, 1, 0]), joined(card, order)
    sides = sides_of(a, b)
    points = scattered(sides.a)
    assert_same_places(sides, points, match(sides, points))


def test_objects_that_were_joined_are_found():
    apart = quad_scene([FLOOR, CEILING])
    sides = sides_of(apart, joined(apart, [2, 3, 0, 1]))
    assert not sides.missing_a.any()
    assert not sides.missing_b.any()
    points = scattered(sides.a)
    assert_same_places(sides, points, match(sides, points))


def test_an_object_that_is_nowhere_else_is_missing_though_it_lies_on_another():
    rug = Quad((1, 0.5, 1e-4), (1, 0, 0), (0, 1, 0))
    sides = sides_of(quad_scene([FLOOR, CEILING, rug]), quad_scene([FLOOR, CEILING]))
    assert sides.missing_a.tolist() == [False, False, True]
    assert not sides.missing_b.any()
    points = scattered(sides.a)
    found = match(sides, points)
    assert ((found.triangle < 0) == (sides.a.instance[points.triangle] == 2)).all()


def test_what_has_no_partner_on_either_side_is_not_taken_for_one_another():
    chair, table = Quad((1, 1, 1), (1, 0, 0), (0, 1, 0)), Quad((2, 1, 2), (1, 0, 0), (0, 1, 0))
    a, b = quad_scene([FLOOR, chair]), quad_scene([FLOOR, table])
    b = replace(b, instances=(b.instances[0], replace(b.instances[1], name="table")))
    sides = sides_of(a, b)
    assert sides.missing_a.tolist() == sides.missing_b.tolist() == [False, True]


def test_a_moved_and_mirrored_object_is_compared_with_itself():
    scene = quad_scene([FLOOR])
    matrix = np.diag([-2.0, 1, 1, 1])
    matrix[:3, 3] = 5, 6, 7
    moved = replace(scene, instances=(replace(scene.instances[0], world_from_object=matrix),))
    sides = sides_of(scene, moved)
    points = scattered(sides.a)
    found = match(sides, points)
    expected = points.at(sides.a, "position") * (-2, 1, 1) + (5, 6, 7)
    np.testing.assert_allclose(found.at(sides.b, "position"), expected, atol=1e-6)


def test_names_decide_where_nodes_were_numbered_again():
    scene = quad_scene([FLOOR, CEILING])
    turned = [replace(scene.instances[1], node=0), replace(scene.instances[0], node=1)]
    pairs = pair_objects(scene, replace(scene, instances=tuple(turned)))
    assert pairs.partner.tolist() == [1, 0]
    assert pairs.same.all()


def test_a_renamed_node_is_known_by_its_mesh():
    scene = quad_scene([FLOOR, CEILING])
    named = tuple(replace(i, name=f"new {i.node}") for i in scene.instances)
    assert pair_objects(scene, replace(scene, instances=named)).partner.tolist() == [0, 1]
    other = replace(scene, instances=tuple(replace(i, mesh=1 - i.mesh) for i in named))
    assert pair_objects(scene, other).partner.tolist() == [-1, -1]


def test_maps_of_different_layout_read_the_same_where_light_is_linear_in_the_place():
    """If light is a linear function of position, bilinear lookup reproduces it up to float32 rounding."""
    scene = quad_scene([FLOOR])
    stored, points = [], None
    for size, inset in ((32, 2.0), (57, 5.5)):
        atlas = quad_atlas(scene, size, inset)
        geometry = world_geometry(scene, atlas)
        corner, uv = geometry.position[:, :2].astype(float), geometry.uv.astype(float)
        # `basis` (3, 2) maps (u, v, 1) to world x and y.
        basis = np.linalg.lstsq(np.c_[uv, np.ones(4)], corner, rcond=None)[0]
        row, column = np.mgrid[:size, :size]
        centre = np.stack([(column + 0.5) / size, (row + 0.5) / size, np.ones_like(row)], axis=-1)
        light = 1 + (centre @ basis) @ (0.5, 2.0)
        bake = StoredBake(
            Path(), {}, scene, atlas, {"irradiance": np.float32(light)[None, :, :, None]},
            np.ones((1, size, size), np.uint8), (),
        )  # fmt: skip
        stored.append((bake, geometry))
    points = scattered(stored[0][1])
    first, second = (read(bake, geometry, points, "irradiance") for bake, geometry in stored)
    place = points.at(stored[0][1], "position")
    np.testing.assert_allclose(first[:, 0], 1 + place[:, :2] @ (0.5, 2.0), rtol=1e-5)
    np.testing.assert_allclose(first, second, rtol=1e-5)
