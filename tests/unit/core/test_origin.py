"""`Scene.origin` is 0 for scenes near 0, and otherwise near most objects of the scene."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tiny_scenes import Quad, box_quads, grey, quad_atlas, quad_scene

from baker.core.geometry import world_geometry
from baker.core.scene import Instance, PunctualLight


def room(at=(0.0, 0.0, 0.0), scale=1.0, quads=()):
    """Return a scene of a room with a crate, and of `quads`. Node transforms move only room and crate."""
    inside = box_quads((-1, 0, -1), (1, 2, 1), inward=True)
    crate = box_quads((0.1, 0, 0.1), (0.5, 0.4, 0.5), inward=False)
    scene = quad_scene([*inside, *crate, *quads])
    n = len(inside) + len(crate)
    matrix = np.diag([scale, scale, scale, 1.0])
    matrix[:3, 3] = at
    placed = [replace(i, world_from_object=matrix) if i.mesh < n else i for i in scene.instances]
    return replace(scene, instances=tuple(placed))


def ground(size, at=(0.0, 0.0, 0.0)):
    x, y, z = at
    return Quad((x - size / 2, y, z - size / 2), (0, 0, size), (size, 0, 0), grey(0.5))


def sky(size):
    return box_quads((-size / 2,) * 3, (size / 2,) * 3, inward=True)


@pytest.mark.parametrize("at", [(0, 0, 0), (3, 0, -2), (20, 5, 20)])
@pytest.mark.parametrize("scale", [0.001, 1.0, 100.0])
def test_scenes_near_zero_keep_their_coordinates(at, scale):
    scene = room(np.multiply(at, scale), scale)
    assert (scene.origin == 0).all()
    assert scene.local_lights is scene.lights


@pytest.mark.parametrize("at", [(1e3, 0, 500), (1e5, 0, 5e4), (-3.3e6, 1e4, 7.7)])
@pytest.mark.parametrize("scale", [0.001, 1.0])
def test_far_scenes_have_their_own_origin(at, scale):
    scene = room(at, scale)
    assert np.abs(scene.origin - at).max() < 4 * scale


@pytest.mark.parametrize("by_vertices", [False, True])
def test_what_nodes_move_far_away_is_bitwise_what_it_was(by_vertices):
    near, at = room(), np.array([65536.0, 0, -32768])
    far = room(at)
    if by_vertices:
        meshes = [replace(m, position=(m.position + at).astype(np.float32)) for m in near.meshes]
        far = replace(near, meshes=tuple(meshes))
    one, two = world_geometry(near, quad_atlas(near, 64)), world_geometry(far, quad_atlas(far, 64))
    shift = two.origin - at
    assert (shift == np.round(shift)).all()
    np.testing.assert_allclose(two.position + shift, one.position, atol=0.0 if not by_vertices else 4e-3)


def test_a_stray_object_far_away_does_not_move_the_origin():
    assert (room(quads=[ground(1.0, (1e5, 0, 0))]).origin == 0).all()
    scene = room((1e5, 0, 0), quads=[ground(1.0), ground(2.0, (-300, 0, 0))])
    assert np.abs(scene.origin - (1e5, 0, 0)).max() < 4


def test_a_sky_a_terrain_and_a_backdrop_have_no_say():
    far = room((4000, 0, 3000), quads=[*sky(2e5), ground(10_000), ground(1000, (24_000, 0, 0))])
    assert np.abs(far.origin - (4000, 0, 3000)).max() < 4
    assert (room(quads=[*sky(2e5), ground(10_000)]).origin == 0).all()


def test_a_few_triangles_of_the_mesh_itself_may_be_anywhere():
    scene = room()
    position = np.concatenate([m.position for m in scene.meshes]) + np.float32([50_000, 0, 0])
    stray = np.float32([[0, 0, 0], [1, 0, 0], [0, 1, 0]])
    triangle = np.concatenate([m.triangle + 4 * k for k, m in enumerate(scene.meshes)])
    n = len(position)
    mesh = replace(
        scene.meshes[0],
        position=np.concatenate([position, stray]),
        triangle=np.concatenate([triangle, np.int32([[n, n + 1, n + 2]])]),
    )
    scene = replace(scene, meshes=(mesh,), instances=(Instance(0, "all", 0, np.eye(4)),))
    assert np.abs(scene.origin - (50_000, 0, 0)).max() < 4


def test_the_origin_depends_on_the_scene_only():
    scene = room((1e5, 0, 0))
    assert (replace(scene).origin == scene.origin).all()
    assert (replace(scene, instances=scene.instances[::-1]).origin - (1e5, 0, 0) < 4).all()
    assert (replace(scene, instances=()).origin == 0).all()


def test_lights_are_relative_to_the_origin():
    light = PunctualLight("point", "p", 0, (1, 1, 1), (100_000.125, 1.5, 0.25), range=2.0)
    scene = replace(room((1e5, 0, 0)), lights=(light,))
    local = scene.local_lights[0]
    assert tuple(np.array(local.position) + scene.origin) == light.position
    assert replace(local, position=light.position) == light
