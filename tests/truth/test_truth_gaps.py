"""The floor below plates 1 mm above it stays dark, although the floor beside the plates is bright."""

from __future__ import annotations

import numpy as np
import pytest
from scenes import SceneBuilder

HEIGHT, SLOT, SIDE = 0.001, 0.5, 1.0 / 16.0
COLUMNS = 32
# (column, row) of the first of the 2 x 2 floor texels under each plate.
UNDER = [(c, r) for c in (4, 12, 20, 28) for r in (4, 12, 20, 28)]


def _floor_with_plates():
    """Return a builder and its floor: 2 m wide, with plates 1 mm above it; all surfaces are black.

    A canopy 1 m above the floor extends from x = 0.5 to x = 20. At x = 20, a wall closes the space below the
    canopy.
    """
    builder = SceneBuilder(160)
    black = builder.material(0.0, double_sided=True)
    builder.quad((SLOT, 1, -50), (20 - SLOT, 0, 0), (0, 0, 100), black, (4, 4))
    builder.quad((20, 0, -50), (0, 1, 0), (0, 0, 100), black, (4, 4))
    floor = builder.quad((0, 0, 1), (2, 0, 0), (0, 0, -2), black, (COLUMNS, COLUMNS))
    for column, row in UNDER:
        corner = (column * SIDE, HEIGHT, 1 - row * SIDE)
        builder.quad(corner, (2 * SIDE, 0, 0), (0, 0, -2 * SIDE), black, (4, 4))
    return builder, floor


def _sky_share(x):
    """Return the share of the sky's light at x: (1 + sin b) / 2 for a canopy edge at the zenith angle b."""
    return (1.0 + (SLOT - x) / np.hypot(SLOT - x, 1.0)) / 2.0


@pytest.mark.parametrize("denoise", [False, True])
def test_gaps_stay_dark_and_the_floor_has_its_light(denoise):
    builder, floor = _floor_with_plates()
    found = []
    for seed in range(4):
        result = builder.bake(sky="1,1,1", samples=32, seed=seed, bounces=0, denoise=denoise)
        found.append(floor.values(result)[..., 0] / np.pi)
    found = np.mean(found, axis=0)
    under = np.zeros((COLUMNS, COLUMNS), bool)
    for column, row in UNDER:
        under[row : row + 2, column : column + 2] = True
    # Below a plate at height h, a point at a distance d from an edge receives (1 - d / hypot(d, h)) / 2 of
    # the sky's light through that edge. For two opposite edges together, the mean over a texel is at most
    # h / SIDE / 2. A plate has two pairs of opposite edges.
    assert found[under].mean() < HEIGHT / SIDE
    x = (np.arange(COLUMNS * 64) + 0.5) / (COLUMNS * 64) * 2.0
    want = _sky_share(x).reshape(COLUMNS, 64).mean(axis=1)
    # Plates 1 mm above the floor do not darken the floor texels beside the plates.
    free = np.where(under, np.nan, found)
    wrong = np.nanmean(free, axis=0) / want - 1.0
    # The mean over a column has the noise of about 4096 rays. The denoiser moves light from texels beside
    # plates to other texels.
    assert np.abs(wrong).max() < (0.075 if denoise else 0.045)
    assert np.nanmean(free) == pytest.approx(np.nanmean(np.where(under, np.nan, want)), rel=0.01)
