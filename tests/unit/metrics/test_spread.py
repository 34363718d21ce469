"""`own_error`: the relative error of a map, estimated from its differences to a noisy reference."""

from __future__ import annotations

import math

import numpy as np
import pytest

from baker.metrics.spread import own_error


def drawn(rng, n, own, noise, light=None):
    """Return value, reference, standard error and half the difference of the reference's halves, (n,) each.

    `own` is the relative error of the value, and `noise` the relative standard error of the reference.
    """
    light = np.ones(n) if light is None else light
    noise = np.broadcast_to(noise, n) * light
    halves = [light + math.sqrt(2) * noise * rng.standard_normal(n) for _ in range(2)]
    value = light * (1 + own * rng.standard_normal(n))
    return value, 0.5 * (halves[0] + halves[1]), noise, 0.5 * (halves[0] - halves[1])


@pytest.mark.parametrize(("own", "noise"), [(0.15, 0.0), (0.15, 0.1), (0.15, 0.2), (0.05, 0.02), (0.0, 0.1)])
def test_the_estimate_equals_the_error_of_the_map(own, noise):
    rng = np.random.default_rng(0)
    found = [own_error(*drawn(rng, 200, own, noise), 0.01, 3.0) for _ in range(200)]
    # The estimate cannot be negative, so for an exact map its mean is above 0. If the map's own error is
    # smaller than the noise of the reference, the estimate is too small.
    off = 0.03 if own == 0 else 0.003 if noise <= own else 0.015
    assert np.mean([f.own for f in found]) == pytest.approx(own, abs=off)
    assert np.mean([f.lower <= own <= f.upper for f in found]) > 0.97


def test_noise_of_fifteen_percent_is_distinguished_from_a_tenth_by_a_hundred_and_fifty_points():
    rng = np.random.default_rng(1)
    for noise in (0.0, 0.05, 0.1):
        assert np.mean([own_error(*drawn(rng, 150, 0.15, noise), 0.01, 3.2).lower for _ in range(50)]) > 0.08
        for _ in range(50):
            assert own_error(*drawn(rng, 150, 0.0, noise), 0.01, 3.2).lower < 0.02


def test_points_of_different_light_and_noise():
    rng = np.random.default_rng(2)
    light, noise = np.repeat([1.0, 1000.0], 100), np.repeat([0.4, 0.001], 100)
    exact = [own_error(*drawn(rng, 200, 0.0, noise, light), 0.01, 3.0) for _ in range(50)]
    assert max(f.lower for f in exact) < 0.002
    wrong = [own_error(*drawn(rng, 200, 0.1, noise, light), 0.01, 3.0) for _ in range(50)]
    assert np.mean([f.own for f in wrong]) == pytest.approx(0.1, abs=0.015)


def test_a_few_points_far_off_decide_little_and_a_common_shift_nothing():
    rng = np.random.default_rng(3)
    value, reference, noise, apart = drawn(rng, 200, 0.05, 0.05)
    plain = own_error(value, reference, noise, apart, 0.01, 3.0).own
    shifted = own_error(1.2 * value, reference, 1.0 * noise, apart, 0.01, 3.0).own
    assert shifted == pytest.approx(plain, abs=0.015)
    value[:10] *= 5
    assert own_error(value, reference, noise, apart, 0.01, 3.0).own == pytest.approx(plain, abs=0.03)


def test_a_reference_noisier_than_its_passes_show_is_taken_at_its_halves():
    rng = np.random.default_rng(4)
    value, reference, noise, apart = drawn(rng, 200, 0.0, 0.1)
    assert own_error(value, reference, 0.3 * noise, apart, 0.01, 3.0).lower < 0.02
    # If the halves of the reference do not differ, its noise is attributed to the map.
    assert own_error(value, reference, 0.3 * noise, 0 * apart, 0.01, 3.0).lower > 0.05
