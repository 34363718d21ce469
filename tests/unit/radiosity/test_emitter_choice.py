"""`EmitterChooser` chooses the emitter clusters that a tile of texels samples, and their probabilities."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from scenes import SceneBuilder, prepared

from baker.radiosity.emitter_choice import EmitterChooser, only
from baker.radiosity.point_cache import points_of
from baker.trace.packets import new_packet_buffers


def world_of(radiance, wall=True, texels=16):
    """Return (world, floors): two floors, each below an emitter, 4 m apart, with a wall between them."""
    builder = SceneBuilder(64)
    grey = builder.material(0.5, double_sided=True)
    floors = [builder.quad((x, 0, 0), (0, 0, 2), (2, 0, 0), grey, (texels, texels)) for x in (0.0, 4.0)]
    if wall:
        builder.quad((3, -1, -9), (0, 0, 20), (0, 20, 0), grey, (4, 4))
    for x, emission in zip((0.75, 4.75), radiance, strict=True):
        builder.quad((x, 1.5, 0.75), (0.5, 0, 0), (0, 0, 0.5), builder.material(0.0, emission), (2, 2))
    return prepared(builder)[0], floors


def choices(world, chosen, n_light=64):
    """Return (chooser, choices) for the tile from the first to the last of the texel entries `chosen`."""
    begin, end = int(chosen[0]), int(chosen[-1]) + 1
    origin, normal = points_of(world.job.surface, world.job.valid_points, np.arange(begin, end))
    chooser = EmitterChooser.build(world.emitters, n_light, world.texels.chart)
    return chooser, chooser.choose(begin, origin, normal, new_packet_buffers(world.rays.tracer))


def side(world, left):
    """Return the entries of the front texels of the left or the right floor."""
    x, y = world.texels.position[: world.texels.n_front, :2].T
    return np.flatnonzero((y < 1e-3) & (x < 2.5 if left else (x > 3.5) & (x < 6.5)))


@pytest.mark.parametrize("bright", [1.0, 1e4, 1e8])
def test_hidden_clusters_are_set_apart_and_the_rest_is_as_if_alone(bright):
    world, _ = world_of((1.0, bright))
    chooser, made = choices(world, side(world, True)[:64])
    own = world.emitters.centre[:, 0] < 3
    assert 0 < own.sum() < len(own)
    alone = EmitterChooser.build(only(world.emitters, own), 64)
    for choice in made:
        assert choice.hidden is not None
        assert choice.seen.chance.sum() == pytest.approx(1.0)
        assert len(choice.seen.chance) == own.sum()
        np.testing.assert_array_equal(choice.found.apart, ~own)
        # `found` has the probabilities for the MIS weights of rays that hit an emitter.
        assert choice.found.chance[own].sum() == pytest.approx(1.0)
        assert choice.found.chance[~own].sum() == pytest.approx(chooser.n_hidden / chooser.n_light)
        assert (choice.found.cumulative == 1.0).all()
    begin = int(side(world, True)[0])
    points = points_of(world.job.surface, world.job.valid_points, np.arange(begin, begin + 64))
    (single,) = alone.choose(begin, *points, new_packet_buffers(world.rays.tracer))
    if len(made) == 1:
        np.testing.assert_allclose(made[0].seen.chance, single.seen.chance, rtol=1e-6)


def test_without_a_wall_nothing_is_hidden():
    world, _ = world_of((1.0, 1e4), wall=False)
    _, made = choices(world, side(world, True)[:64])
    (choice,) = made
    assert choice.hidden is None
    assert choice.seen is choice.found
    assert (choice.seen.chance > 0).all()


def test_a_tile_over_two_rooms_falls_into_parts():
    """A tile with both floors is divided into consecutive parts, each with the emitters visible from it."""
    world, _ = world_of((1.0, 1e4), texels=20)
    n_front = world.texels.n_front
    _, made = choices(world, np.arange(n_front))
    assert made[0].part.start == 0
    assert made[-1].part.stop == n_front
    for before, after in pairwise(made):
        assert before.part.stop == after.part.start
    x = world.texels.position[:n_front, 0]
    own = world.emitters.centre[:, 0] < 3
    wrong = 0
    for choice in made:
        if choice.hidden is None:
            continue
        seen_left = not choice.found.apart[own].any()
        wrong += ((x[choice.part] < 3) != seen_left).sum()
    assert wrong == 0
    assert sum(choice.hidden is not None for choice in made) >= 2


def test_one_emitter_of_several_triangles_is_no_choice():
    builder = SceneBuilder(32)
    builder.quad((0, 0, 0), (0, 0, 2), (2, 0, 0), builder.material(0.5), (8, 8))
    builder.quad((0.5, 1, 0.5), (1, 0, 0), (0, 0, 1), builder.material(0.0, 1.0), (4, 4))
    world, _ = prepared(builder)
    assert len(world.emitters.power) == 2
    assert EmitterChooser.build(world.emitters, 64).single
    dark = only(world.emitters, np.zeros(2, bool))
    assert EmitterChooser.build(dark, 64).single
