"""Lights in one room do not change the accuracy of another room."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scenes import SceneBuilder
from ztest import assert_unbiased


def room_and_ground(sun, bulb=(1.0, 1.0, 1.0)):
    """Return a builder and quads of a closed room with a point light inside, beside a sunlit ground."""
    builder = SceneBuilder(96)
    white = builder.material(0.8)
    room = builder.box((0, 0, 0), (4, 2.5, 3), white, 12, inward=True)
    builder.light("point", bulb, position=(1.0, 2.0, 1.2))
    ground = builder.quad((8, 0, -3), (0, 0, 6), (6, 0, 0), white, (20, 20))
    builder.light("directional", sun, direction=(0.0, -1.0, 0.0))
    return builder, list(room.values()), ground


@pytest.mark.parametrize("bulb", [(1.0, 1.0, 1.0), (1.0, 1e-5, 1e-2)])
def test_the_sun_outside_does_not_end_the_solve_of_a_room(bulb):
    """A closed room has the same light beside a ground that is 1e12 times as bright."""
    light = []
    for sun in (0.0, 1e3, 1e12):
        builder, room, ground = room_and_ground(sun, bulb)
        result = builder.bake()
        light.append(np.concatenate([wall.values(result).reshape(-1, 3) for wall in room]))
        np.testing.assert_allclose(ground.values(result), sun, rtol=1e-5)
        assert 0 < result.solve["patch_error"] <= 3e-5
        assert result.solve["iterations"] > 5
    for other in light[1:]:
        # The solver stops at an estimated error of 3e-5 for each patch; the true error may be larger.
        np.testing.assert_allclose(other, light[0], rtol=2e-4)
    colours = np.divide(light[0], bulb)
    np.testing.assert_allclose(colours, colours[:, :1].repeat(3, axis=1), rtol=2e-4)


def boxes(radiance):
    """Return a builder and the floors of closed rooms in a row; room k has an emitter of `radiance[k]`."""
    builder = SceneBuilder(96)
    floors = []
    for k, emission in enumerate(radiance):
        white, at = builder.material(0.5), 2.5 * k
        walls = builder.box((at, 0, 0), (at + 2, 2, 2), white, 10, inward=True)
        emitter = builder.material(0.0, emission)
        builder.quad((at + 0.75, 1.9, 0.75), (0.5, 0, 0), (0, 0, 0.5), emitter, (4, 4))
        floors.append(walls["-y"])
    return builder, floors


def noise(radiance, room, **settings):
    """Return the relative RMS difference of a room's floor between two seeds, and its mean."""
    builder, floors = boxes(radiance)
    first, second = (floors[room].values(builder.bake(seed=seed, **settings)) for seed in (1, 2))
    return float(np.sqrt(np.mean((first / second - 1.0) ** 2))), float((first + second).mean() / 2)


@pytest.mark.parametrize("bright", [1e4, 1e6])
def test_bright_lights_next_door_do_not_raise_the_noise(bright):
    """Noise and light of a room do not depend on lights behind its walls."""
    alone, light = noise((1.0,), 0)
    for radiance, room in (((1.0, bright), 0), ((bright, 1.0, bright), 1)):
        beside, same = noise(radiance, room)
        # If the bake did not estimate which emitters are visible, the noise would be 20 times that of
        # `alone`.
        assert beside < 1.3 * alone
        # The mean of a bake has a standard deviation of 0.1 % over seeds.
        assert same == pytest.approx(light, rel=4e-3)


def test_light_through_a_keyhole_is_found():
    """Through a hole of 8 cm, an emitter next door lights a room whose own emitter is 10,000 times weaker."""
    builder = SceneBuilder(96)
    grey = builder.material(0.5)
    dim = builder.box((0, 0, 0), (2, 2, 2), grey, 12, inward=True)
    bright = builder.box((2.1, 0, 0), (4.1, 2, 2), grey, 6, inward=True)
    for wall, x in ((dim["+x"], 2.0), (bright["-x"], 2.1)):
        # Replace the two walls between the rooms by frames around the hole.
        at = next(k for k, mesh in enumerate(builder.meshes) if np.allclose(mesh.position[0], wall.origin))
        del builder.meshes[at], builder.instances[at]
        for low, high in (
            ((0, 0), (0.96, 2)),
            ((1.04, 0), (2, 2)),
            ((0.96, 0), (1.04, 0.96)),
            ((0.96, 1.04), (1.04, 2)),
        ):
            up, along = (0, high[0] - low[0], 0), (0, 0, high[1] - low[1])
            edges = (along, up) if x == 2.0 else (up, along)
            builder.quad((x, *low), *edges, grey, (4, 4))
    for k, emission in enumerate((1.0, 1e4)):
        builder.quad(
            (2.6 * k + 0.75, 1.9, 0.75), (0.5, 0, 0), (0, 0, 0.5), builder.material(0.0, emission), (4, 4)
        )
    for k, instance in enumerate(builder.instances):
        builder.instances[k] = replace(instance, mesh=k)
    own = [quad for side, quad in dim.items() if side != "+x"]

    def light(seed, samples):
        result = builder.bake(seed=seed, samples=samples, bounces=0)
        return np.mean([quad.values(result).mean() for quad in own])

    # The standard error of the truth is 1.5 %. `slack` is twice this error.
    truth = np.mean([light(seed, 2048) for seed in range(100, 104)])
    assert_unbiased([light(seed, 256) for seed in range(8)], truth, least=0.05, slack=0.03)
