"""Neighbouring points share packets of occlusion rays. Only rays that graze an edge may change by this."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scenes import SceneBuilder

import baker.pathtracer.irradiance as irradiance
from baker.pathtracer.irradiance import ambient_occlusion_pass
from baker.pathtracer.occlusion import are_dense, near_together
from baker.pathtracer.point_estimate import new_estimate
from baker.pathtracer.scene import build_reference
from baker.trace.packets import arguments_of

UP = np.array([0.0, 1.0, 0.0])


def step(position):
    """Return the mean distance of consecutive points."""
    return np.linalg.norm(np.diff(position, axis=0), axis=1).mean()


def test_neighbours_follow_each_other():
    position = np.random.default_rng(1).random((4096, 3)) * [3.0, 0.1, 2.0] - 1.0
    order = near_together(position)
    assert (np.sort(order) == np.arange(4096)).all()
    # On average, a point has a square of area 6 / 4096. The limit is twice the side of this square.
    assert step(position[order]) < 2 * np.sqrt(6.0 / 4096)
    assert step(position) > 1.0


@pytest.mark.parametrize("n", [1, 7])
def test_points_of_one_place_keep_their_order(n):
    assert (near_together(np.full((n, 3), 0.3)) == np.arange(n)).all()


def test_scattered_points_are_left_as_they_are():
    """Points are dense if consecutive points are near each other, even if rows of points are far apart."""
    x, y = np.meshgrid(np.linspace(0, 8, 400), np.linspace(0, 8, 20))
    rows = np.stack([x.ravel(), y.ravel(), 0 * x.ravel()], axis=1)
    assert are_dense(rows, 0.05)
    assert not are_dense(np.random.default_rng(2).permutation(rows), 0.05)
    assert not are_dense(rows[:1], 0.05)


@pytest.fixture(scope="module")
def under_cards():
    """Yield (reference, position (4096, 1, 3)): points on a floor below two cards and beside a wall.

    One card is opaque. The other one has the alpha 0.5.
    """
    builder = SceneBuilder(64)
    plain = builder.material(0.5, double_sided=True)
    veil = builder.material(0.5, double_sided=True)
    builder.materials[veil] = replace(
        builder.materials[veil], base_colour=(0.5, 0.5, 0.5, 0.5), alpha_mode="BLEND"
    )
    builder.quad((-2, 0, -2), (0, 0, 4), (4, 0, 0), plain)
    builder.quad((-1, 0.3, -1), (0, 0, 1), (1, 0, 0), plain)
    builder.quad((0, 0.2, 0), (0, 0, 1), (1, 0, 0), veil)
    builder.quad((1.5, 0, -2), (0, 0, 4), (0, 1, 0), plain)
    side = np.linspace(-1.4, 1.4, 64)
    x, z = (a.ravel() for a in np.meshgrid(side, side))
    with build_reference(builder.build(), threads=1) as reference:
        yield reference, np.stack([x, 0 * x, z], axis=1)[:, None]


def opened(reference, position, distance, samples=64):
    estimate = new_estimate(len(position), 1, samples)
    normal = np.broadcast_to(UP, position.shape)
    ambient_occlusion_pass(reference, estimate, position, normal, normal, distance=distance, seed=3)
    return estimate.mean[:, 0]


@pytest.mark.parametrize("distance", [1.0, np.inf])
def test_coherent_packets_find_the_same_hits(under_cards, monkeypatch, distance):
    reference, position = under_cards
    found, asked = [], []

    def told(never):
        def arguments(*, coherent=False):
            asked.append(coherent)
            return arguments_of(coherent=coherent and not never)

        return arguments

    for never in (False, True):
        monkeypatch.setattr(irradiance, "arguments_of", told(never))
        found.append(opened(reference, position, distance))
    assert asked == [False, True] * 2
    assert 0.1 < found[0].min() < 0.5 < found[0].max()
    # By rounding, a ray near an edge may hit in one case and miss in the other.
    assert abs(found[0] - found[1]).max() <= 1 / 64
    assert (found[0] != found[1]).sum() <= 2


def test_estimates_do_not_depend_on_other_points(under_cards):
    """The estimate of a point does not depend on the other points, with which it may share packets."""
    reference, position = under_cards
    together = opened(reference, position, 1.0)
    alone = opened(reference, position[:21], 1.0)
    assert abs(alone - together[:21]).max() <= 1 / 64
    assert (alone != together[:21]).sum() <= 1
