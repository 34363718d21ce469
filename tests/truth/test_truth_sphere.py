"""The integrating sphere: E_indirect = Phi / (4 pi r^2) rho / (1 - rho), for any position of the light."""

from __future__ import annotations

import numpy as np
import pytest
from scenes import SceneBuilder, icosphere
from ztest import assert_unbiased

INTENSITY = 10.0


def sphere_bake(level, albedo, position, seed, bounces=None, texels=2):
    corner = icosphere(level, inward=True)
    side = int(np.ceil(np.sqrt(len(corner)))) * (texels + 2) + 4
    builder = SceneBuilder(64 if side <= 64 else 128 if side <= 128 else 256)
    builder.triangles(corner, builder.material(albedo), texels)
    builder.light("point", INTENSITY, position=position)
    result = builder.bake(seed=seed, bounces=bounces)
    edge = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
    area = 0.5 * np.linalg.norm(np.cross(*edge), axis=1).sum()
    # The triangles have nearly equal areas, so an unweighted mean over texels is accurate enough.
    return result.lightmaps["irradiance"].value[result.status == 1][:, 0].astype(np.float64), area


@pytest.mark.parametrize("position", [(0.0, 0.0, 0.0), (0.3, 0.4, -0.2)])
@pytest.mark.parametrize("albedo", [0.3, 0.9])
def test_indirect_light_is_even_and_known(albedo, position):
    """The mean indirect irradiance of a polyhedron around a point light is 4 pi I rho / (A (1 - rho))."""
    indirect = []
    for seed in range(4):
        whole, area = sphere_bake(2, albedo, position, seed)
        direct, _ = sphere_bake(2, albedo, position, seed, bounces=0)
        even = 4 * np.pi * INTENSITY * albedo / (1 - albedo) / area
        indirect.append((whole - direct) / even)
        # In a sphere, indirect light is uniform. In an icosphere of 320 flat faces it varies by a few percent
        # if the light is off the centre. The noise of 64 rays adds to this variation.
        assert indirect[-1].std() < 0.06
    # `slack`: a flat face reflects no light to itself and little to its neighbours, which changes the mean by
    # up to 0.5 %.
    assert_unbiased([v.mean() for v in indirect], 1.0, least=0.003, slack=0.005)


def test_error_falls_with_the_square_of_the_edge():
    """With the light at the centre, E converges to the value in a sphere, I (1 + rho / (1 - rho)) / r^2."""
    truth = INTENSITY / (1 - 0.5)
    error = []
    for level in (0, 1, 2):
        values = [
            sphere_bake(level, 0.5, (0.0, 0.0, 0.0), seed, texels=6 - 2 * level)[0].mean()
            for seed in range(4)
        ]
        error.append(np.mean(values) / truth - 1)
    # Half the edge length gives a quarter of the error; 2.5 to 6 allows for higher orders and noise.
    assert error[0] > error[1] > error[2] > 0
    assert 2.5 < error[0] / error[1] < 6
    assert 2.5 < error[1] / error[2] < 6
