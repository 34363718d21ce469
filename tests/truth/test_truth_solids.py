"""A crate on or in a slab: texels at its foot are correct for one-sided and double-sided materials."""

from __future__ import annotations

import numpy as np
import pytest
from scenes import SceneBuilder

# Height of the crate's bottom, metres: below the slab's top, which is at 0, or level with it.
SUNK, EXACT = -0.3, 0.0


def crate_in_slab(double_sided, low, *, inward=False, albedo=0.5, half=4.0):
    """Bake a crate 1 m wide in or on a slab under a sky of radiance 1; return slab, crate and result."""
    builder = SceneBuilder(128)
    material = builder.material(albedo, double_sided=double_sided)
    slab = builder.box((-half, -0.5, -half), (half, 0, half), material, 26)
    crate = builder.box((-0.47, low, -0.52), (0.53, 0.7, 0.48), material, 12, inward=inward)
    return slab, crate, builder.bake(sky="1", samples=256)


@pytest.mark.parametrize("low", [SUNK, EXACT])
@pytest.mark.parametrize("double_sided", [False, True])
def test_the_foot_of_a_black_crate_sees_half_the_sky(double_sided, low):
    """A wall on black ground receives light from the upper half of its hemisphere: E = pi / 2 at any height.

    Beyond the slab's edge, 200 m away, sky below the horizon adds 0.1 % at a height of 0.15 m.
    """
    _, crate, result = crate_in_slab(double_sided, low, albedo=0.0, half=200.0)
    for side, axis in (("+x", 2), ("-x", 2), ("+z", 0), ("-z", 0)):
        quad = crate[side]
        middle = quad.at(0.5, 0.5)
        for height in (0.01, 0.06, 0.1, 0.15):
            along = np.array([0.0, 0.0, 0.0])
            along[axis] = 0.11
            for sign in (-1, 0, 1):
                point = np.array([middle[0], height, middle[2]]) + sign * along
                # A texel with 256 stratified rays has a noise of 2 %.
                assert quad.value_at(result, point)[0] == pytest.approx(np.pi / 2, rel=0.04)


def test_double_sided_solids_bake_to_the_same_bytes():
    maps = [crate_in_slab(sides, SUNK)[2] for sides in (False, True)]
    values = [result.lightmaps["irradiance"].value for result in maps]
    assert values[0].tobytes() == values[1].tobytes()
    assert (maps[0].status == maps[1].status).all()
    assert maps[0].statistics["irradiance"]["invalid"] > 100


def test_a_crate_wound_inwards_hides_the_floor_all_the_same():
    slab, _, right = crate_in_slab(False, SUNK)
    flipped = crate_in_slab(True, SUNK, inward=True)[2]
    np.testing.assert_allclose(slab["+y"].values(flipped), slab["+y"].values(right), rtol=0.06)
