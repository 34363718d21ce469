"""Texels of a Cornell bake agree with the tests' simple path tracer within the standard errors of both."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from path_tracer import PathTracer
from scenes import SceneBuilder
from ztest import critical

import baker

CORNELL = Path(__file__).parents[2] / "assets" / "cornell.glb"
PATHS = 3000
SEEDS = 6


def whole_texels(result, rng, n):
    """Return (n, 4): row, column, instance and triangle of random texels that lie inside one triangle."""
    found = []
    size = result.atlas.resolution
    for number, layout in enumerate(result.atlas.layouts):
        for t, corner in enumerate(layout.uv[layout.triangle].astype(float) * size):
            low, high = np.floor(corner.min(axis=0)).astype(int), np.ceil(corner.max(axis=0)).astype(int)
            column, row = (
                a.reshape(-1) for a in np.meshgrid(*(np.arange(*s) for s in zip(low, high, strict=True)))
            )
            inside = np.ones(len(row), bool)
            for dx, dy in ((0, 0), (1, 0), (0, 1), (1, 1)):
                inside &= (barycentric(corner, np.stack([column + dx, row + dy], axis=1)) > 1e-3).all(axis=1)
            found += [(r, c, number, t) for r, c in zip(row[inside], column[inside], strict=True)]
    found = np.array(found)
    return found[rng.permutation(len(found))[:n]]


def barycentric(corner, point):
    """Return (n, 3) barycentric coordinates of points (n, 2) in a triangle (3, 2)."""
    a, b, c = corner
    inverse = np.linalg.inv(np.stack([b - a, c - a], axis=1))
    bc = (point - a) @ inverse.T
    return np.concatenate([1 - bc.sum(axis=1, keepdims=True), bc], axis=1)


def test_furnace_of_the_path_tracer_itself():
    """The simple path tracer gives E = pi L / (1 - rho) in an emissive box."""
    builder = SceneBuilder(64)
    builder.box((0, 0, 0), (1, 2, 3), builder.material(0.5, 1.0), 8, inward=True)
    rng = np.random.default_rng(1)
    n = 20_000
    point = np.stack([rng.random(n), np.zeros(n), 3 * rng.random(n)], axis=1)
    value = PathTracer(builder.build()).irradiance(point, np.tile([0.0, 1.0, 0.0], (n, 1)), rng)[:, 0]
    error = value.std() / n**0.5
    assert error < 0.03 * 2 * np.pi
    assert abs(value.mean() - 2 * np.pi) < critical(1) * error


@pytest.fixture(scope="module")
def compared():
    """Return bakes (seeds, n, 3), path-traced means (n, 3) and their standard errors (n, 3)."""
    scene = baker.load(CORNELL)
    # Large texels are sufficient, because the path tracer averages over the area of the texel, too.
    results = [
        baker.bake(scene, resolution=96, samples=256, seed=seed, denoise=False, channels=["irradiance"])
        for seed in range(SEEDS)
    ]
    rng = np.random.default_rng(4)
    texel = whole_texels(results[0], rng, 60)
    bakes = np.array([r.lightmaps["irradiance"].value[0][texel[:, 0], texel[:, 1]] for r in results], float)
    tracer = PathTracer(scene)
    mean, error = np.zeros((len(texel), 3)), np.zeros((len(texel), 3))
    free = np.zeros(len(texel), bool)
    atlas = results[0].atlas
    for k, (row, column, number, t) in enumerate(texel):
        layout, instance = atlas.layouts[number], scene.instances[number]
        mesh = scene.meshes[instance.mesh]
        spot = np.array([column, row]) + rng.random((PATHS, 2))
        weight = barycentric(layout.uv[layout.triangle[t]].astype(float) * atlas.resolution, spot)
        matrix = instance.world_from_object
        world = mesh.position[layout.vertex[layout.triangle[t]]] @ matrix[:3, :3].T + matrix[:3, 3]
        face = np.cross(world[1] - world[0], world[2] - world[0])
        face *= np.sign(np.linalg.det(matrix[:3, :3])) / np.linalg.norm(face)
        point, normal = weight @ world, np.tile(face, (PATHS, 1))
        # Exclude texels with points under the boxes, because the bake computes no light for such points.
        free[k] = not tracer.inside_geometry(point, normal).any()
        value = tracer.irradiance(point, normal, rng)
        mean[k], error[k] = value.mean(axis=0), value.std(axis=0) / PATHS**0.5
    assert free.sum() > 45
    return bakes[:, free], mean[free], error[free]


def test_every_texel_agrees_within_error_bars(compared):
    bakes, mean, error = compared
    away = bakes.mean(axis=0) - mean
    # The tolerance combines both standard errors and 1 % of the mean. The 1 % is needed because the bake's
    # light after the first bounce is constant over a patch.
    both = np.sqrt(error**2 + bakes.var(axis=0, ddof=1) / SEEDS + (0.01 * mean) ** 2)
    assert np.median(error / mean) < 0.02
    z = np.abs(away / both)
    assert z.max() < critical(z.size)
    # A much smaller RMS would mean that the standard errors are overestimated.
    assert 0.3 < np.sqrt((z * z).mean()) < 1.5


def test_the_mean_has_no_bias(compared):
    bakes, mean, error = compared
    relative = bakes.mean(axis=0).sum() / mean.sum() - 1
    noise = np.sqrt((error.sum(axis=1) ** 2).sum()) / mean.sum()
    assert noise < 0.005
    assert abs(relative) < critical(1) * noise + 0.002
