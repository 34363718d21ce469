"""No light leaks through the edges and corners of a closed mesh."""

from __future__ import annotations

import numpy as np
import pytest
from scenes import SceneBuilder, icosphere, unit
from twins import closest_hits

from baker.trace.embree import RayScene


def turn(angles):
    """Return the rotation matrix (3, 3) of angles about x, y and z."""
    matrix = np.eye(3)
    for k, angle in enumerate(angles):
        c, s = np.cos(angle), np.sin(angle)
        step = np.eye(3)
        a, b = (k + 1) % 3, (k + 2) % 3
        step[a, a], step[a, b], step[b, a], step[b, b] = c, -s, s, c
        matrix = step @ matrix
    return matrix


def cube(matrix):
    """Return (12, 3, 3) triangles of a rotated cube, fronts inwards; shared corners are bit-identical."""
    point = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float) @ matrix.T
    quads = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    corner = np.array([[point[list(t)] for t in ((q[0], q[1], q[2]), (q[0], q[2], q[3]))] for q in quads])
    corner = corner.reshape(-1, 3, 3)
    face = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    inward = (face * corner.mean(axis=1)).sum(axis=1) < 0
    return np.where(inward[:, None, None], corner, corner[:, ::-1])


SHAPES = {
    "cube": cube(np.eye(3)),
    "turned cube": cube(turn((0.3, 0.7, 1.1))),
    "far away": cube(turn((0.3, 0.7, 1.1))) + np.array([1000.0, -300.0, 70.0]),
    "sphere": icosphere(2, inward=True),
}


@pytest.mark.parametrize("name", SHAPES)
def test_rays_aimed_at_edges_and_corners_do_not_leak(name):
    corner = SHAPES[name].astype(np.float32).astype(np.float64)
    rng = np.random.default_rng(2)
    middle = corner.reshape(-1, 3).mean(axis=0)
    at = np.concatenate([corner, np.roll(corner, -1, axis=1)], axis=2).reshape(-1, 2, 3)
    pick = at[rng.integers(0, len(at), 40_000)]
    share = rng.random((len(pick), 1))
    # A quarter of the rays aim exactly at corners, the others at points on edges.
    share[::4] = np.round(share[::4])
    target = pick[:, 0] * (1 - share) + pick[:, 1] * share
    origin = middle + 0.5 * unit(rng.normal(size=target.shape)) * rng.random((len(target), 1))
    rays = RayScene(corner.reshape(-1, 3).astype(np.float32), np.arange(3 * len(corner)).reshape(-1, 3))
    primitive, distance = closest_hits(rays.tracer, origin, unit(target - origin))
    assert (primitive >= 0).all()
    assert distance == pytest.approx(np.linalg.norm(target - origin, axis=1), rel=1e-3)


@pytest.mark.parametrize("name", SHAPES)
def test_dark_inside_a_hull_however_bright_outside(name):
    builder = SceneBuilder(128)
    builder.triangles(SHAPES[name], builder.material(0.9), 16 if len(SHAPES[name]) == 12 else 3)
    builder.light("directional", 1.0e5, direction=tuple(unit(np.array([0.3, -0.8, 0.5]))))
    middle = SHAPES[name].reshape(-1, 3).mean(axis=0)
    builder.light("point", 1.0e5, position=tuple(middle + np.array([0.0, 3.0, 0.0])))
    result = builder.bake(sky="10000", channels=["irradiance", "ao"], ao_distance="inf")
    inside = result.status > 0
    assert inside.sum() > 1000
    assert result.lightmaps["irradiance"].value.max() < 1e-6
    assert result.lightmaps["ao"].value.max() == 0.0


def test_dark_in_a_room_of_separate_walls():
    """A room of six separate quads with the emitter outside: its texels at edges and corners stay dark."""
    builder = SceneBuilder(128)
    quads = builder.box((0, 0, 0), (4, 3, 2), builder.material(0.9), 20, inward=True)
    builder.quad((1, 3.5, 0.5), (1, 0, 0), (0, 0, 1), builder.material(0.0, 1.0e4), (6, 6))
    result = builder.bake(sky="10000", samples=256)
    for quad in quads.values():
        assert quad.values(result).max() < 1e-6
