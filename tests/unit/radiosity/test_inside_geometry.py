"""`find_inside_geometry` finds the floor's points that are inside of a one-sided or double-sided crate."""

from __future__ import annotations

import numpy as np
import pytest
from tiny_scenes import Quad, box_quads, grey, quad_world

from baker.radiosity.inside_geometry import find_inside_geometry
from baker.radiosity.point_cache import points_of


def find(world, threads=1):
    return find_inside_geometry(world.texels, world.job(threads=threads), world.hit_kind)


def sunk_crate(double_sided=False, inward=False):
    """Return the world of a floor and a crate that is partly below the floor."""
    floor = Quad((0, 0, 0), (0, 0, 4), (4, 0, 0))
    material = grey(double_sided=double_sided)
    crate = box_quads((1.03, -0.51, 1.07), (2.53, 1.0, 2.41), inward=inward, material=material)
    return quad_world([floor, *crate], 96, inset=0.2)


@pytest.fixture(scope="module", params=["one-sided", "double-sided", "double-sided and wound inwards"])
def crate(request):
    world = sunk_crate("double" in request.param, "inwards" in request.param)
    runs = [find(world, threads) for threads in (1, 2)]
    assert runs[0][0].tobytes() == runs[1][0].tobytes()
    return world, *runs[0]


def test_points_inside_the_crate_are_found(crate):
    world, mask, rays = crate
    origin, _ = points_of(world.surface, world.free, np.arange(world.texels.n))
    good = (mask[:, None] >> np.arange(16, dtype=np.uint16) & 1).astype(bool)
    on_floor = (world.texels.instance == 0) & ~world.texels.back
    x, z = origin[..., 0], origin[..., 2]
    slack = 0.02
    inside = (x > 1.03 + slack) & (x < 2.53 - slack) & (z > 1.07 + slack) & (z < 2.41 - slack)
    outside = (x < 1.03 - slack) | (x > 2.53 + slack) | (z < 1.07 - slack) | (z > 2.41 + slack)
    assert inside[on_floor].sum() > 500
    assert not good[on_floor][inside[on_floor]].any()
    assert good[on_floor][outside[on_floor]].all()
    assert rays >= world.texels.n * 4


def test_texels_half_inside_keep_their_valid_half(crate):
    world, mask, _ = crate
    on_floor = np.flatnonzero((world.texels.instance == 0) & ~world.texels.back)
    part = on_floor[(mask[on_floor] != 0) & (mask[on_floor] != 0xFFFF)]
    assert len(part) > 20
    origin, _ = points_of(world.surface, mask, part)
    x, z = origin[..., 0], origin[..., 2]
    assert ((x < 1.05) | (x > 2.51) | (z < 1.09) | (z > 2.39)).mean() > 0.999
