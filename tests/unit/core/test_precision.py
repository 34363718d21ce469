"""`coarse_objects` reports objects whose float32 positions are coarser than a tenth of a texel."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from tiny_scenes import Quad, quad_scene

from baker.core.precision import _VERTICES, _medians_and_extents, coarse_objects


def floor(at, by="node", size=2.0, scale=1.0):
    """Return a scene of one floor at x = `at`.

    `by` selects whether the node's transform or the vertex positions contain this offset.
    """
    scene = quad_scene([Quad((-size / 2, 0, -size / 2), (0, 0, size), (size, 0, 0))])
    if by == "vertices":
        mesh = replace(scene.meshes[0], position=scene.meshes[0].position + np.float32([at, 0, 0]))
        return replace(scene, meshes=(mesh,))
    matrix = np.diag([scale, scale, scale, 1.0])
    matrix[0, 3] = at
    return replace(scene, instances=(replace(scene.instances[0], world_from_object=matrix),))


def both(one, two):
    """Return one scene with the objects of two scenes that have one mesh each."""
    second = replace(two.instances[0], node=1, mesh=1, name="second")
    return replace(
        one, meshes=(*one.meshes, *two.meshes), materials=one.materials, instances=(*one.instances, second)
    )


@pytest.mark.parametrize("at", [0, 1e3, 1e5, 1e7])
def test_nodes_far_away_are_exact(at):
    assert coarse_objects(floor(at), np.array([0.01])) is None


@pytest.mark.parametrize(
    ("at", "texel", "step"), [(1e5, 0.05, "7.81 mm"), (1e4, 0.005, "0.977 mm"), (2e7, 1.0, "2 m")]
)
def test_vertices_far_away_are_named_with_their_step(at, texel, step):
    found = coarse_objects(floor(at, "vertices"), np.array([texel]))
    assert step in found.text
    assert f"{1000 * texel:.3g} mm" in found.text or "1 m" in found.text
    assert "coarser" in found.text
    assert "translation" in found.fix
    # With texels 100 times as large, nothing is reported.
    assert coarse_objects(floor(at, "vertices"), np.array([100 * texel])) is None


def test_a_node_that_takes_far_vertices_back_does_not_help():
    scene = floor(1e5, "vertices")
    matrix = np.eye(4)
    matrix[0, 3] = -1e5
    scene = replace(scene, instances=(replace(scene.instances[0], world_from_object=matrix),))
    assert "7.81 mm" in coarse_objects(scene, np.array([0.05])).text


def test_a_level_in_millimetres_is_measured_in_metres():
    # The vertex coordinates reach 1000 and the scale is 1/1000, so the float32 spacing is 0.06 micrometres.
    assert coarse_objects(floor(0, size=2000.0, scale=1e-3), np.array([0.01])) is None


def test_two_objects_far_apart_cannot_both_be_fine():
    found = coarse_objects(both(floor(0), floor(1e5)), np.array([0.05, 0.05]))
    assert found.count == 1
    assert "100 km" in found.text
    assert "scenes of their own" in found.fix
    # A distant backdrop with large texels is not reported.
    assert coarse_objects(both(floor(0), floor(1e5, size=1e4)), np.array([0.05, 5.0])) is None


def test_objects_without_texels_are_not_reported():
    assert coarse_objects(floor(1e5, "vertices"), np.array([np.inf])) is None
    assert coarse_objects(replace(floor(0), instances=()), np.zeros(0)) is None


def test_medians_and_extents_of_many_meshes():
    random = np.random.default_rng(0)
    sizes = [1, 2, 3, 0, 7, 1000, 40_000, 70_000, 5, 0, 1]
    positions = [random.normal(0, 10, (n, 3)).astype(np.float32) for n in sizes]
    middle, extent = _medians_and_extents(positions)
    for k, position in enumerate(positions):
        some = position[:: max(1, len(position) // _VERTICES)].astype(np.float64)
        if not len(some):
            assert not middle[k].any()
            assert not extent[k].any()
            continue
        np.testing.assert_allclose(middle[k], np.median(some, axis=0), rtol=1e-12)
        np.testing.assert_allclose(extent[k], np.quantile(np.abs(some), 0.9, axis=0), rtol=1e-12)
