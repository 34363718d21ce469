"""Directions sampled without regard to the material, and camera rays, have their stated densities."""

from __future__ import annotations

import math

import numpy as np
import pytest
from inner import compiled
from numba import njit
from scipy import stats

from baker.pathtracer.bsdf import N_PARAMETERS, bsdf_eval
from baker.pathtracer.camera import camera_rays, look_at
from baker.pathtracer.vertex import BETA, DENSITY, GO, N_ROWS, NORMAL, TO, scatter, set_frame

(bsdf_eval,) = compiled(bsdf_eval)
LEVEL = 1e-4
N = 100_000
AXIS = np.array([0.48, -0.6, 0.64])
ROUGH = (0.8, 0.6, 0.4, 0.3, 0.5)
MIRROR = (0.8, 0.6, 0.4, 0.3, 0.0)


@njit
def scatter_many(material, axis, hemisphere, random):
    path, row, weight = np.zeros((N_ROWS, 1)), np.zeros((N_PARAMETERS, 1)), np.zeros(3)
    out = np.zeros((len(random), 7))
    for i in range(len(random)):
        row[:, 0] = material
        for a in range(3):
            path[NORMAL + a, 0] = axis[a]
            path[BETA + a, 0] = 1.0
        set_frame(path, 0, axis[0], axis[1], axis[2])
        # Direction to the viewer in the tangent frame, at an angle to the normal whose sine is 0.6.
        path[TO, 0], path[TO + 1, 0], path[TO + 2, 0] = 0.6, 0.0, 0.8
        if not scatter(path, row, 0, hemisphere, random[i, 0], random[i, 1], random[i, 2], weight):
            continue
        out[i, :3] = path[GO : GO + 3, 0]
        out[i, 3] = path[DENSITY, 0]
        out[i, 4:] = path[BETA : BETA + 3, 0]
    return out


def uniform(value, other):
    """Assert that the pairs (value, other) are uniform in the unit square."""
    count = np.histogram2d(value, other, bins=16, range=[[0, 1], [0, 1]])[0]
    assert count.sum() == len(value)
    assert stats.chisquare(count.ravel()).pvalue > LEVEL


@pytest.mark.parametrize("hemisphere", [1, 2])
def test_directions_that_ignore_the_material(hemisphere):
    found = scatter_many(np.array(ROUGH), AXIS, hemisphere, np.random.default_rng(1).random((N, 3)))
    way, density = found[:, :3], found[:, 3]
    np.testing.assert_allclose(np.linalg.norm(way, axis=1), 1, rtol=1e-5)
    z = np.clip(way @ AXIS, 0, 1)
    across = np.cross(AXIS, [0.0, 0.0, 1.0])
    across /= np.linalg.norm(across)
    phi = np.arctan2(way @ np.cross(AXIS, across), way @ across) / (2 * np.pi) + 0.5
    # For uniform directions, z is uniform (Archimedes). For cosine-weighted ones, z squared is (Malley).
    uniform(z if hemisphere == 1 else z**2, phi)
    told = np.full(N, 0.5 / math.pi) if hemisphere == 1 else z / math.pi
    np.testing.assert_allclose(density, told, atol=1e-6)
    # The density is a polynomial of the height z, so Gauss-Legendre quadrature of its integral, 1, is exact.
    height, share = np.polynomial.legendre.leggauss(8)
    height = 0.5 + 0.5 * height
    over = 0.5 / math.pi + 0 * height if hemisphere == 1 else height / math.pi
    assert math.pi * (share * over).sum() == pytest.approx(1, rel=1e-12)


@pytest.mark.parametrize("hemisphere", [0, 1, 2])
def test_all_ways_to_scatter_carry_the_same_light(hemisphere):
    """The mean throughput is the reflected share of light for all ways to sample directions."""
    n = 400
    z, phi = (np.arange(n) + 0.5) / n, 2 * np.pi * (np.arange(n) + 0.5) / n
    z, phi = (a.ravel() for a in np.meshgrid(z, phi))
    r = np.sqrt(1 - z * z)
    row, value, total = np.zeros((N_PARAMETERS, 1)), np.zeros(3), np.zeros(3)
    row[:, 0] = ROUGH
    for x, y, h in zip(r * np.cos(phi), r * np.sin(phi), z, strict=True):
        bsdf_eval(row, 0, 0.6, 0.0, 0.8, x, y, h, value)
        total += value
    truth = total * 2 * np.pi / n**2
    found = scatter_many(np.array(ROUGH), AXIS, hemisphere, np.random.default_rng(2).random((16 * N, 3)))
    weight = found[:, 4:]
    error = weight.std(axis=0) / math.sqrt(len(weight))
    assert (3 * error < 0.005 * truth).all()
    # The three colours use the same directions, so this counts as one statistical test.
    assert (abs(weight.mean(axis=0) - truth) < 3 * error).all()


@pytest.mark.parametrize("hemisphere", [1, 2])
def test_mirror_samples_are_the_same_for_all_ways_to_sample(hemisphere):
    found = scatter_many(np.array(MIRROR), AXIS, hemisphere, np.random.default_rng(3).random((N, 3)))
    mirrored = found[:, 3] == 0
    own = scatter_many(np.array(MIRROR), AXIS, 0, np.random.default_rng(3).random((N, 3)))
    assert (mirrored == (own[:, 3] == 0)).all()
    np.testing.assert_array_equal(found[mirrored], own[mirrored])
    assert 0.05 < mirrored.mean() < 0.95


def test_pixels_are_covered_evenly():
    camera = look_at((1.0, 2.0, 3.0), (0.5, 0.3, -1.0), 50.0)
    pixel = np.array([0, 5, 11])
    way = np.concatenate([camera_rays(camera, 4, 3, pixel, 16, 7, k) for k in range(2000)], axis=1)
    for i in range(3):
        high = math.tan(0.5 * camera.fov)
        ahead = way[i] @ np.array(camera.forward)
        x = (way[i] @ np.array(camera.right) / ahead / (high * 4 / 3) + 1) * 2 - pixel[i] % 4
        y = (1 - way[i] @ np.array(camera.up) / ahead / high) * 1.5 - pixel[i] // 4
        assert min(x.min(), y.min()) > -1e-6
        assert max(x.max(), y.max()) < 1 + 1e-6
        # The 16 samples of a pass are a lattice with a random shift, so only one sample per pass is tested.
        uniform(np.clip(x[::16], 0, 1), np.clip(y[::16], 0, 1))
