"""A closed room under a bright sky stays dark where walls, ceiling, beams and shelves cross texels."""

from __future__ import annotations

import numpy as np
import pytest
from scenes import SceneBuilder

SKY = 1000.0
# Largest permitted E in the room, as a share of the sky's irradiance outside.
DARK = 1e-4


def room(density, thickness, double_sided, sunk=0.0):
    """Return a room of 4 x 4 x 2.5 m on a floor of 7 x 7 m, with a beam and a shelf through its walls."""
    builder = SceneBuilder(256)
    matter = builder.material(0.6, double_sided=double_sided)

    def n(metres):
        return max(int(np.ceil(density * metres)), 2)

    floor = builder.quad((-3.5, 0, 3.5), (7, 0, 0), (0, 0, -7), matter, (n(7), n(7)))
    walls = []
    # Offsets of the walls, so that they do not coincide with borders of floor texels.
    for k, shift in enumerate((0.013, 0.017, -0.021, 0.029)):
        turn = np.array([[np.cos(k * np.pi / 2), 0, np.sin(k * np.pi / 2)], [0, 1, 0],
                         [-np.sin(k * np.pi / 2), 0, np.cos(k * np.pi / 2)]])  # fmt: skip
        low, high = np.array([-2.2, -sunk, 2.0 + shift]), np.array([2.2, 2.5, 2.0 + shift + thickness])
        corner = np.array([low, high]) @ turn.T
        if thickness:
            sides = builder.box(corner.min(axis=0), corner.max(axis=0), matter, n(2.5))
        else:
            origin, along = turn @ (2.2, -sunk, 2 + shift), turn @ (-4.4, 0, 0)
            size = n(4.4), n(2.5 + sunk)
            sides = {"in": builder.quad(origin, along, (0, 2.5 + sunk, 0), matter, size)}
        inward = turn @ (0, 0, -1.0)
        walls += [side for side in sides.values() if side.normal @ inward > 0.9]
    roof = builder.box((-2.6, 2.5, -2.6), (2.6, 2.8, 2.6), matter, n(4))
    beam = builder.box((1.2, 1.5, 0.4), (2.9, 1.7, 0.6), matter, 4)
    shelf = builder.box((-0.4, 1.1, 1.6), (0.6, 1.14, 2.6), matter, 5)
    return builder, floor, walls, roof["-y"], beam, shelf


def inside(quad, margin):
    """Return (rows, columns) bool: texels of a quad inside the room, at least `margin` from its walls."""
    place = quad.points(1)[:, :, 0]
    within = (np.abs(place[..., [0, 2]]) < 2.0 - margin).all(axis=-1)
    return within & (place[..., 1] > -1e-6) & (place[..., 1] < 2.51)


ROOMS = (
    (5, 0.1, False, 0.0),
    (5, 0.1, True, 0.0),
    (12, 0.0, True, 0.0),
    (12, 0.0, False, 0.1),
    (9, 0.25, True, 0.1),
)


@pytest.mark.parametrize(("density", "thickness", "double_sided", "sunk"), ROOMS)
def test_no_light_crosses_the_walls_of_a_closed_room(density, thickness, double_sided, sunk):
    builder, floor, walls, ceiling, beam, shelf = room(density, thickness, double_sided, sunk)
    result = builder.bake(sky=(SKY, SKY, SKY), samples=32, denoise=True)
    dark = DARK * np.pi * SKY
    texel = 1.0 / density
    for quad in (floor, ceiling):
        here = inside(quad, texel)
        assert here.sum() > 100
        assert quad.values(result)[here].max() < dark
    for quad in walls:
        values = quad.values(result)
        # Texels of the walls that lie wholly above the floor and between the other walls.
        place = quad.points(1)[:, :, 0]
        along = np.abs(place @ (quad.u / np.linalg.norm(quad.u))) < 2.0 - texel
        assert values[along & (place[..., 1] > 0.75 * texel)].max() < dark
    for side in (beam["+y"], shelf["+y"], shelf["-y"]):
        place = side.points(1)[:, :, 0]
        far = (np.abs(place[..., [0, 2]]) < 2.0 - 0.45).all(axis=-1)
        assert side.values(result)[far].max(initial=0.0) < dark
    # The floor outside is bright, up to the walls.
    bright = floor.values(result)[(np.abs(floor.points(1)[:, :, 0][..., [0, 2]]) > 3.0).any(axis=-1)]
    assert bright.min() > 0.3 * np.pi * SKY
