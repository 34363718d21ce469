"""What happens in one room changes nothing in another one."""

from __future__ import annotations

import numpy as np
import pytest
from scenes import SceneBuilder


def room_and_ground(sun, lamp=(1.0, 1.0, 1.0)):
    """A closed room with a point light inside, beside a sunlit ground."""
    builder = SceneBuilder(96)
    white = builder.material(0.8)
    room = builder.box((0, 0, 0), (4, 2.5, 3), white, 12, inward=True)
    builder.light("point", lamp, position=(1.0, 2.0, 1.2))
    ground = builder.quad((8, 0, -3), (0, 0, 6), (6, 0, 0), white, (20, 20))
    builder.light("directional", sun, direction=(0.0, -1.0, 0.0))
    return builder, list(room.values()), ground


@pytest.mark.parametrize("lamp", [(1.0, 1.0, 1.0), (1.0, 1e-5, 1e-2)])
def test_the_sun_outside_does_not_end_the_solve_of_a_room(lamp):
    """A closed room has the same light beside a ground a million million times as bright."""
    light = []
    for sun in (0.0, 1e3, 1e12):
        builder, room, ground = room_and_ground(sun, lamp)
        result = builder.bake()
        light.append(np.concatenate([wall.values(result).reshape(-1, 3) for wall in room]))
        np.testing.assert_allclose(ground.values(result), sun, rtol=1e-5)
        assert 0 < result.solve["patch_error"] <= 3e-5
        assert result.solve["iterations"] > 5
    for other in light[1:]:
        # The solve estimates the error of each patch at 3e-5; the estimate is no bound.
        np.testing.assert_allclose(other, light[0], rtol=2e-4)
    colours = np.divide(light[0], lamp)
    np.testing.assert_allclose(colours, colours[:, :1].repeat(3, axis=1), rtol=2e-4)
