"""One-sided surfaces are black on their backs; double-sided ones reflect and emit on both sides."""

from __future__ import annotations

import numpy as np
import pytest
from closed_forms import polygon_irradiance
from scenes import SceneBuilder
from ztest import assert_unbiased

SEEDS = 6
UP = (0.0, 1.0, 0.0)


def emitter_over_floor(double_sided, face_down, **settings):
    """Return (floor, builder): a floor of 2 x 2 m, and an emitter of 1 x 1 m that is 1 m above it."""
    builder = SceneBuilder(64)
    floor = builder.quad((-1, 0, -1), (0, 0, 2), (2, 0, 0), builder.material(0.0), (16, 16))
    edges = ((1, 0, 0), (0, 0, 1)) if face_down else ((0, 0, 1), (1, 0, 0))
    emitter = builder.quad((-0.5, 1, -0.5), *edges, builder.material(0.5, 10.0, double_sided=double_sided))
    assert emitter.normal[1] == (-1 if face_down else 1)
    return floor, builder


def test_one_sided_emitter_is_dark_behind():
    floor, builder = emitter_over_floor(False, face_down=False)
    assert (floor.values(builder.bake(sky="0")) == 0).all()


@pytest.mark.parametrize(("double_sided", "face_down"), [(False, True), (True, True), (True, False)])
def test_emitter_shines_from_its_front_and_from_both_if_double_sided(double_sided, face_down):
    found = []
    for seed in range(SEEDS):
        floor, builder = emitter_over_floor(double_sided, face_down)
        found.append(floor.values(builder.bake(seed=seed))[..., 0])
    square = [(-0.5, 1, -0.5), (0.5, 1, -0.5), (0.5, 1, 0.5), (-0.5, 1, 0.5)]
    truth = 10.0 * floor.texel_mean(lambda p: polygon_irradiance(square, p, UP))
    assert_unbiased([f.mean(axis=0) for f in found], truth.mean(axis=0), least=0.01)
    # The 64 stratified light rays of a texel are unblocked. Their mean has a noise below 5 %.
    assert np.abs(np.mean(found, axis=0) / truth - 1).max() < 0.05


def bounce_onto_floor(double_sided, lit_front, seed):
    """Return E of a floor and of a wall at the floor's edge. The horizontal sun lights only the wall."""
    builder = SceneBuilder(64)
    floor = builder.quad((0, 0, -0.5), (0, 0, 1), (1, 0, 0), builder.material(0.0), (16, 16))
    edges = ((0, 1, 0), (0, 0, 1)) if lit_front else ((0, 0, 1), (0, 1, 0))
    wall = builder.quad((0, 0, -0.5), *edges, builder.material(0.6, double_sided=double_sided))
    # Sunlight travels horizontally along -x, so it lights only the +x side of the wall.
    builder.light("directional", 100.0, direction=(-1.0, 0.0, 0.0))
    result = builder.bake(seed=seed)
    return floor.values(result)[..., 0], wall.values(result)[..., 0]


def test_back_of_a_one_sided_wall_reflects_nothing():
    floor, wall = bounce_onto_floor(False, lit_front=False, seed=0)
    assert (floor == 0).all()
    assert (wall == 0).all()


@pytest.mark.parametrize(("double_sided", "lit_front"), [(False, True), (True, True), (True, False)])
def test_wall_reflects_what_reaches_it_on_a_side_that_reflects(double_sided, lit_front):
    found = []
    for seed in range(SEEDS):
        floor, wall = bounce_onto_floor(double_sided, lit_front, seed)
        found.append(floor.mean())
        # The map stores the irradiance of the front, which is 0 if only the back is lit.
        assert np.allclose(wall, 100.0 if lit_front else 0.0, rtol=1e-4)
    # The radiosity of the wall is 60 lx. 0.2 is the form factor of perpendicular unit squares with a common
    # edge.
    assert_unbiased(found, 60.0 * 0.2000438, least=0.005)


def test_double_sided_sheet_in_a_furnace_changes_nothing():
    """With a double-sided sheet of the walls' material in a furnace, E is still pi L / (1 - rho)."""
    found = []
    for seed in range(SEEDS):
        builder = SceneBuilder(64)
        material = builder.material(0.7, 1.0, double_sided=True)
        quads = list(builder.box((0, 0, 0), (2, 2, 2), material, 10, inward=True).values())
        quads.append(builder.quad((0.5, 0.7, 0.6), (1, 0.2, 0), (0, 0.3, 0.8), material, (10, 10)))
        result = builder.bake(seed=seed)
        found.append([q.values(result).mean() for q in quads])
        assert result.solve["energy"]["escaped"] == 0
    assert_unbiased(found, np.full(7, np.pi / 0.3), least=0.01)


def test_one_sided_sheet_swallows_light_at_its_back():
    """A one-sided sheet in the same furnace absorbs light at its back, so the wall behind it is darker."""
    builder = SceneBuilder(64)
    walls = builder.material(0.7, 1.0)
    quads = builder.box((0, 0, 0), (2, 2, 2), walls, 10, inward=True)
    builder.quad((0.5, 1.0, 0.5), (0, 0, 1), (1, 0, 0), walls, (10, 10))
    result = builder.bake()
    below, above = (quads[side].values(result).mean() for side in ("-y", "+y"))
    assert below < above < np.pi / 0.3
    energy = result.solve["energy"]
    assert energy["absorbed"] == pytest.approx(energy["emitted"], rel=1e-4)
