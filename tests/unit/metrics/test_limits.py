"""Limits at, above and below a figure are evaluated correctly, and invalid texts of limits are refused."""

from __future__ import annotations

import pytest

from baker.core.errors import SettingsError
from baker.metrics.limits import evaluate_limits, parse_limits

CHANNELS, NAMES = ("irradiance", "ao"), ("median", "bias", "rmse", "p95")


def verdicts(text, **values):
    table = {"irradiance": dict.fromkeys(NAMES, 0.0) | values, "ao": dict.fromkeys(NAMES)}
    return [v.failed for v in evaluate_limits(parse_limits(text, CHANNELS, NAMES), table)]


@pytest.mark.parametrize(
    ("sign", "below", "equal", "above"),
    [(">", 0, 0, 1), (">=", 0, 1, 1), ("<", 1, 0, 0), ("<=", 1, 1, 0)],
)
def test_every_comparison(sign, below, equal, above):
    for value, fails in ((0.04, below), (0.05, equal), (0.06, above)):
        assert verdicts(f"irradiance.p95 {sign} 0.05", p95=value) == [bool(fails)]


def test_several_limits_and_blanks():
    assert verdicts(" irradiance.p95>0.05 ,irradiance . median > 1e-3", p95=0.1, median=0.0) == [True, False]


def test_bias_counts_both_ways():
    assert verdicts("irradiance.bias > 0.01", bias=-0.02) == [True]
    assert verdicts("irradiance.bias < -0.01", bias=-0.02) == [True]


def test_a_figure_that_is_missing_fails():
    assert verdicts("ao.median > 0.05") == [True]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("iradiance.p95 > 1", "did you mean 'irradiance'"),
        ("irradiance.p59 > 1", "did you mean 'p95'"),
        ("irradiance.p95 = 1", "not of the form"),
        ("irradiance.p95 > x", "'x' is not a number"),
        ("irradiance.p95 > nan", "never reached"),
        ("", "it is empty"),
        ("irradiance.p95 > 1,", "not of the form"),
    ],
)
def test_what_cannot_be_read_is_refused(text, said):
    with pytest.raises(SettingsError, match=said):
        parse_limits(text, CHANNELS, NAMES)
