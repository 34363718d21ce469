"""Bias and typical error of groups of points, compared with known deviations of random samples."""

from __future__ import annotations

import math

import numpy as np
import pytest

from baker.metrics.groups import MIN_POINTS, ComparedPoints, bright_light, compare_group, z_needed


def points(value, reference, noise=0.0, samples=256):
    value, reference = np.atleast_2d(value), np.atleast_2d(reference)
    error = np.full(reference.shape, noise)
    return ComparedPoints(
        value, reference, error, (reference, reference), np.full(len(value), samples), error
    )


def noisy(rng, n, noise=0.05, colours=3):
    truth = np.exp(rng.normal(0, 0.5, (n, 1))) * rng.uniform(0.5, 1.5, colours)
    # The three colours of a path have the same noise.
    return truth, truth * (1 + noise * rng.standard_normal((n, 1)))


def test_by_hand():
    found = compare_group(points([[2.0, 1.0, 0.0], [2.0, 1.0, 3.0]], [[1.0, 1.0, 1.0], [2.0, 2.0, 2.0]]), 2.0)
    assert (found.texels, found.light) == (2, 1.5)
    # The means over colours are 1 and 2, for value and reference. The sums of the colours, relative to their
    # mean, are 4/3, 2/3, 1 for the value, and 1, 1, 1 for the reference.
    assert found.bias == pytest.approx(0)
    np.testing.assert_allclose(found.colour, [1 / 3, -1 / 3, 0], atol=1e-12)
    # The bias is 0 if either point is left out, so its jackknife standard error is 0.
    assert found.bias_se == pytest.approx(0)


def test_the_error_of_the_bias_is_its_spread():
    rng = np.random.default_rng(0)
    found = []
    for _ in range(400):
        truth, reference = noisy(rng, 50)
        found.append(compare_group(points(1.02 * truth, reference), 1.0))
    assert np.mean([f.bias for f in found]) == pytest.approx(0.02, abs=0.002)
    assert np.std([f.bias for f in found]) == pytest.approx(np.mean([f.bias_se for f in found]), rel=0.15)
    # `sure_bias` is the bias reduced by 3.6 standard errors. In these samples it never exceeds the true bias.
    # Without a bias, at most 3 of 400 samples have a `sure_bias` other than 0.
    assert sum(f.sure_bias > 0.02 for f in found) == 0
    exact = [compare_group(points(t, r), 1.0) for t, r in (noisy(rng, 50) for _ in range(400))]
    assert sum(f.sure_bias != 0 for f in exact) < 4


def test_a_shift_of_colour_is_seen_through_noise():
    rng = np.random.default_rng(1)
    truth, reference = noisy(rng, 40, noise=0.3)
    found = compare_group(points(truth * [1.04, 1, 1], reference), 1.0)
    assert found.sure_bias == 0
    assert found.sure_colour == pytest.approx(found.colour[0], abs=0.005)
    assert 0.02 < found.sure_colour < found.colour[0]
    assert found.colour[0] == pytest.approx(0.028, abs=0.01)
    assert compare_group(points(truth, reference), 1.0).sure_colour == 0


def test_one_bright_place_decides_nothing():
    truth = np.ones((30, 3))
    truth[0] = 500
    value = truth.copy()
    value[0] *= 0.8
    found = compare_group(points(value, truth), 1.0)
    assert found.bias == pytest.approx(-0.19, abs=0.01)
    assert found.sure_bias == 0
    # Two bright points with the same deviation have no variance. Their bias is not significant either.
    dark = np.full((30, 3), 1e-6)
    dark[:2] = 1.0
    two = compare_group(points(0.75 * dark, dark), 1.0)
    assert two.bias == pytest.approx(-0.25)
    assert two.bias_se < 0.01
    assert two.effective == pytest.approx(2, rel=0.01)
    assert two.effective < MIN_POINTS
    assert two.sure_bias == 0


def test_rare_light_in_one_half_of_the_reference_is_no_deviation():
    rng = np.random.default_rng(5)
    truth = np.ones((200, 3))
    halves = tuple(truth + 0.02 * rng.standard_normal((200, 1)) for _ in range(2))
    # One half of the reference has additional red light, as from rare paths. This light is the same at all
    # points.
    halves[0][:, 0] += 0.2
    reference = 0.5 * (halves[0] + halves[1])
    found = compare_group(
        ComparedPoints(truth, reference, 0.02 * truth, halves, np.full(200, 64), 0.02 * truth), 1.0
    )
    assert found.sure_bias == 0
    assert found.sure_colour == 0


def test_light_where_none_should_be():
    dark = np.zeros((20, 3))
    # The reference is 0. The value is about 40 times the light that a single path, missed by all 4096
    # samples, could have added.
    leak = compare_group(points(dark + 0.05, dark, samples=4096), 100.0)
    assert leak.bias == pytest.approx(0.05 / (1e-3 * 100))
    assert 0.4 < leak.sure_bias < leak.bias
    few = compare_group(points(dark + 0.05, dark, samples=16), 100.0)
    assert few.sure_bias == 0
    assert compare_group(points(dark, dark), 100.0).sure_bias == 0


def test_noise_of_a_map_is_more_than_that_of_the_reference():
    rng = np.random.default_rng(2)
    truth = np.ones((60, 3))
    halves = tuple(truth * (1 + 0.1 * rng.standard_normal((60, 1))) for _ in range(2))
    reference = 0.5 * (halves[0] + halves[1])
    good = ComparedPoints(truth, reference, 0.07 * truth, halves, np.full(60, 64), 0.07 * truth)
    assert compare_group(good, 1.0).sure_noise == 0
    spoilt = good._replace(value=truth * (1 + 0.4 * rng.standard_normal((60, 1))))
    found = compare_group(spoilt, 1.0)
    assert found.spread.own == pytest.approx(0.4, abs=0.08)
    assert 0.2 < found.sure_noise < found.spread.own


def test_few_points_need_more():
    assert z_needed(8) > z_needed(100) > 3
    assert bright_light(np.linspace(0, 1, 101)[:, None]) == pytest.approx(0.95)


def halved(rng, light, noise):
    """Return the two halves (n, 1) of a reference, which are independent estimates of the light `light` (n,).

    The mean of the halves has the relative standard error `noise` (n,), each half sqrt(2) times as much.
    """
    return tuple(
        light[:, None] * (1 + math.sqrt(2) * noise[:, None] * rng.standard_normal((len(light), 1)))
        for _ in range(2)
    )


def test_bright_and_dark_points_in_one_group_are_no_noise_of_the_map():
    rng = np.random.default_rng(3)
    light, noise = np.repeat([2.0, 200.0], [12, 11]), np.repeat([0.5, 0.001], [12, 11])
    sure = apart = 0
    for _ in range(300):
        halves = halved(rng, light, noise)
        reference = 0.5 * (halves[0] + halves[1])
        found = compare_group(
            ComparedPoints(
                light[:, None],
                reference,
                noise[:, None] * reference,
                halves,
                np.full(23, 256),
                noise[:, None] * reference,
            ),
            1000.0,
        )
        sure += found.sure_noise > 0
        apart += found.typical > 4 * found.typical_noise
    # Both medians, of the errors and of the expected noise, are the smallest error among the 12 dark, noisy
    # points. They often differ by more than a factor of 4, although the map is exact.
    assert apart > 30
    assert sure == 0


def test_noise_of_a_map_among_bright_and_dark_points_is_found():
    rng = np.random.default_rng(4)
    light, noise = np.repeat([2.0, 200.0], 50), np.full(100, 0.05)
    halves = halved(rng, light, noise)
    reference = 0.5 * (halves[0] + halves[1])
    map_ = (light * (1 + 0.5 * rng.standard_normal(100)))[:, None]
    found = compare_group(
        ComparedPoints(
            map_, reference, noise[:, None] * reference, halves, np.full(100, 256), noise[:, None] * reference
        ),
        1000.0,
    )
    assert found.sure_noise > 0.15
