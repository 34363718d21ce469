"""Error metrics, compared with values computed by hand and with the spread of random samples."""

from __future__ import annotations

import numpy as np
import pytest

from baker.metrics.error_metrics import METRICS, dark_floor, error_metrics, relative_error


def test_by_hand():
    value, truth = np.array([[1.1], [2.0], [2.7]]), np.array([[1.0], [2.0], [3.0]])
    found = error_metrics(value, truth, standard_error=np.full((3, 1), 0.1))
    assert list(found) == list(METRICS)
    assert found["texels"] == 3
    assert found["bias"] == pytest.approx(-0.2 / 3 / 2)
    assert found["rmse"] == pytest.approx(np.sqrt((0.01 + 0.09) / 3))
    assert found["nrmse"] == pytest.approx(found["rmse"] / 2)
    assert found["median"] == pytest.approx(0.1)
    assert found["max"] == pytest.approx(0.1)
    assert found["relmse"] == pytest.approx((0.01 / 1.04 + 0.09 / 9.04) / 3)
    assert found["z_rms"] == pytest.approx(np.sqrt((1 + 9) / 3))
    assert found["noise_floor"] is None


def test_dark_points_are_relative_to_a_tenth_of_the_median():
    truth = np.array([[1e-6], [1.0], [1.0]])
    assert dark_floor(truth) == pytest.approx(0.1)
    error = relative_error(truth + 0.01, truth, dark_floor(truth))
    np.testing.assert_allclose(error, [0.1, 0.01, 0.01], rtol=1e-4)


def test_where_most_is_dark_they_are_relative_to_a_hundredth_of_the_mean():
    truth = np.array([[0.0], [0.0], [0.0], [400.0]])
    assert dark_floor(truth) == pytest.approx(1.0)
    assert dark_floor(np.zeros((0, 3))) == 0.0


def test_noise_floor_is_what_noise_alone_shows():
    rng = np.random.default_rng(0)
    truth = np.ones((4000, 1))
    halves = tuple(truth + 0.02 * rng.standard_normal(truth.shape) for _ in range(2))
    reference = 0.5 * (halves[0] + halves[1])
    found = error_metrics(
        truth, reference, standard_error=np.full(truth.shape, 0.02 / np.sqrt(2)), halves=halves
    )
    # The measured error of an exact map equals the noise floor.
    assert found["median"] == pytest.approx(found["noise_floor"], rel=0.05)
    assert found["p95"] == pytest.approx(found["noise_p95"], rel=0.05)
    assert found["z_rms"] == pytest.approx(1.0, abs=0.05)


def test_energy_ratio_by_hand():
    value, truth = np.array([[1.0, 3.0], [4.0, 4.0]]), np.array([[1.0, 1.0], [5.0, 5.0]])
    found = error_metrics(value, truth, weight=np.array([3.0, 1.0]))
    # The means over colours are 2 and 4 (value) and 1 and 5 (truth): (3 * 2 + 4) / (3 * 1 + 5) = 10 / 8.
    assert found["energy_ratio"] == pytest.approx(1.25)
    assert found["energy_ratio_se"] == pytest.approx(np.hypot(3 * (2 - 1.25), 4 - 6.25) / 8)
    assert error_metrics(value, truth)["energy_ratio"] is None
    dark = error_metrics(value, 0 * truth, weight=np.ones(2))
    assert (dark["energy_ratio"], dark["energy_ratio_se"]) == (None, None)


def test_the_error_of_the_energy_ratio_is_its_spread():
    rng = np.random.default_rng(1)
    ratios, errors = [], []
    for _ in range(300):
        truth = rng.uniform(0.1, 2.0, (200, 1))
        noisy = truth * (1 + 0.1 * rng.standard_normal(truth.shape))
        found = error_metrics(1.1 * truth, noisy, weight=rng.uniform(0.5, 2.0, 200))
        ratios.append(found["energy_ratio"])
        errors.append(found["energy_ratio_se"])
    assert np.mean(ratios) == pytest.approx(1.1, abs=0.002)
    assert np.std(ratios) == pytest.approx(np.mean(errors), rel=0.15)


def test_no_point_has_no_metrics():
    found = error_metrics(np.zeros((0, 3)), np.zeros((0, 3)))
    assert found["texels"] == 0
    assert all(found[name] is None for name in METRICS if name != "texels")


def test_a_black_truth_gives_finite_metrics():
    found = error_metrics(np.full((5, 3), 0.5), np.zeros((5, 3)))
    assert all(np.isfinite(found[name]) for name in ("bias", "rmse", "median", "relmse"))
    assert dark_floor(np.zeros((5, 3))) == 0.0
