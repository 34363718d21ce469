"""BSDF samples have their stated density (chi-square tests). The reflected energy equals closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from inner import compiled
from numba import njit
from scipy import stats

from baker.pathtracer.bsdf import bsdf_eval, bsdf_sample, cosines_pdf

(bsdf_eval,) = compiled(bsdf_eval)

LAMBERT = (0.6, 0.3, 0.1, 0.0, -1.0)
MATERIALS = {
    "lambert": LAMBERT,
    "dielectric": (0.6, 0.3, 0.1, 0.0, 0.25),
    "metal": (0.9, 0.6, 0.3, 1.0, 0.16),
    "rough metal": (0.9, 0.6, 0.3, 1.0, 1.0),
    "mixed": (0.8, 0.8, 0.8, 0.5, 0.5),
}


def column(material):
    row = np.zeros((5, 16))
    row[:, 0] = material
    return row


def towards(degrees):
    angle = np.radians(degrees)
    return np.sin(angle), 0.0, np.cos(angle)


@njit
def draw_many(row, vx, vy, vz, random):
    out = np.zeros((len(random), 8))
    weight = np.zeros(3)
    for i in range(len(random)):
        x, y, z, density, smooth = bsdf_sample(
            row, 0, vx, vy, vz, random[i, 0], random[i, 1], random[i, 2], weight
        )
        out[i, 0], out[i, 1], out[i, 2], out[i, 3] = x, y, z, density
        out[i, 4:7] = weight
        out[i, 7] = 1.0 if smooth else 0.0
    return out


@njit
def density_of(row, vx, vy, vz, way):
    out = np.zeros(len(way))
    for i in range(len(way)):
        along = vx * way[i, 0] + vy * way[i, 1] + vz * way[i, 2]
        out[i] = cosines_pdf(row, 0, vz, way[i, 2], along)
    return out


def grid(n_cosine, n_angle, inner=16):
    """Return directions (cells, inner^2, 3) on the hemisphere, divided into cells of equal solid angle."""
    step = (np.arange(inner) + 0.5) / inner
    z = (np.arange(n_cosine)[:, None] + step) / n_cosine
    phi = 2 * np.pi * (np.arange(n_angle)[:, None] + step) / n_angle
    z, phi = np.broadcast_arrays(z[:, None, :, None], phi[None, :, None, :])
    r = np.sqrt(1 - z**2)
    way = np.stack([r * np.cos(phi), r * np.sin(phi), z], axis=-1)
    return way.reshape(n_cosine * n_angle, inner * inner, 3)


@pytest.mark.parametrize("degrees", [0, 40, 75])
@pytest.mark.parametrize("name", MATERIALS)
def test_samples_follow_their_density(name, degrees):
    row, view = column(MATERIALS[name]), towards(degrees)
    cells = grid(12, 16, inner=32)
    mass = density_of(row, *view, cells.reshape(-1, 3)).reshape(len(cells), -1).mean(axis=1)
    mass *= 2 * np.pi / len(cells)
    random = np.random.default_rng(3).random((200_000, 3))
    found = draw_many(row, *view, random)
    up = found[:, 2] > 0
    # Samples of a rough lobe below the surface are lost. The lost share and the density's integral sum to 1.
    # The tolerance is three standard errors of the lost share, plus the error of the midpoint rule.
    lost = 1 - up.mean()
    assert mass.sum() + lost == pytest.approx(1, abs=3 * np.sqrt(lost * up.mean() / len(up)) + 2e-4)
    if name == "lambert":
        assert mass.sum() == pytest.approx(1, abs=1e-9)
    z, phi = found[up, 2], np.arctan2(found[up, 1], found[up, 0]) % (2 * np.pi)
    cell = np.minimum((z * 12).astype(int), 11) * 16 + np.minimum((phi / (2 * np.pi) * 16).astype(int), 15)
    count = np.bincount(cell, minlength=len(cells))
    expected = mass / mass.sum() * up.sum()
    # For narrow lobes, the midpoint rule in a cell has an error of up to 0.3 %.
    many = expected > 50
    chi = ((count - expected)[many] ** 2 / (expected + (0.003 * expected) ** 2)[many]).sum()
    assert chi < stats.chi2.isf(1e-4, many.sum())


@pytest.mark.parametrize("degrees", [10, 60])
@pytest.mark.parametrize("name", MATERIALS)
def test_weight_is_value_over_density(name, degrees):
    row, view = column(MATERIALS[name]), towards(degrees)
    found = draw_many(row, *view, np.random.default_rng(5).random((200, 3)))
    value = np.zeros(3)
    for x, y, z, density, *weight, _ in found[found[:, 3] > 0]:
        told = bsdf_eval(row, 0, *view, x, y, z, value)
        assert told == pytest.approx(density, rel=1e-9)
        np.testing.assert_allclose(np.array(weight[:3]) * density, value, rtol=1e-9)


@pytest.mark.parametrize("name", MATERIALS)
def test_scattering_is_the_same_both_ways(name):
    row = column(MATERIALS[name])
    one, other = np.zeros(3), np.zeros(3)
    for v, w in zip(grid(3, 4, 1)[:, 0], grid(4, 3, 1)[::-1, 0], strict=True):
        bsdf_eval(row, 0, *v, *w, one)
        bsdf_eval(row, 0, *w, *v, other)
        np.testing.assert_allclose(one / w[2], other / v[2], rtol=1e-9)


@pytest.mark.parametrize("degrees", [0, 45, 70])
@pytest.mark.parametrize(
    ("material", "least", "most"),
    [
        (LAMBERT, 0.3333, 0.3334),
        # A white mirror loses no light, and a narrow lobe almost none.
        ((1, 1, 1, 1, 0.0), 0.9999, 1.0001),
        ((1, 1, 1, 1, 0.01), 0.99, 1.001),
        # The model ignores light reflected more than once between microfacets, so a rough metal loses light.
        ((1, 1, 1, 1, 1.0), 0.30, 0.99),
        # A white rough dielectric: the specular lobe reflects the share F, and the diffuse part 1 - F.
        ((1, 1, 1, 0, 1.0), 0.9, 1.001),
    ],
)
def test_white_furnace(material, degrees, least, most):
    found = draw_many(column(material), *towards(degrees), np.random.default_rng(1).random((200_000, 3)))
    share = np.where(found[:, 2:3] > 0, found[:, 4:7], 0).mean()
    assert least <= share <= most


def test_the_loss_of_the_roughest_metal_is_the_known_one():
    # For a = 1 and a view along the normal, D = 1 / pi and V n.l = n.l / (2 (n.l + 1)). The integral of
    # D V n.l over the hemisphere is 1 - ln 2.
    found = draw_many(column((1, 1, 1, 1, 1.0)), 0.0, 0.0, 1.0, np.random.default_rng(1).random((400_000, 3)))
    share = np.where(found[:, 2] > 0, found[:, 4], 0).mean()
    assert share == pytest.approx(1 - np.log(2), abs=0.002)


def test_a_mirror_reflects():
    found = draw_many(column((1, 1, 1, 1, 0.0)), *towards(30), np.random.default_rng(1).random((10, 3)))
    np.testing.assert_allclose(found[:, :3], np.tile([-0.5, 0, np.cos(np.pi / 6)], (10, 1)), atol=1e-12)
    assert (found[:, 7] == 1).all()
    assert (found[:, 3] == 0).all()
