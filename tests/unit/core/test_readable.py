"""Numbers have three significant digits in messages, and percentages have no exponent."""

from __future__ import annotations

import pytest

from baker.core.readable import number, percent


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0, "0"), (0.0152, "0.0152"), (12.34, "12.3"), (99.96, "100"), (100, "100"), (1234.5, "1230"),
        (65504, "65500"), (0.5, "0.5"), (-2.345, "-2.35"), (1e-9, "1.0e-09"), (1e20, "1e+20"),
        (float("inf"), "inf"),
    ],
)  # fmt: skip
def test_numbers_have_three_significant_digits(value, text):
    assert number(value) == text


@pytest.mark.parametrize(
    ("share", "text"), [(0.0152, "1.52%"), (1, "100%"), (12.3, "1230%"), (1e-8, "0%"), (-0.004, "-0.4%")]
)
def test_percentages_have_no_exponent(share, text):
    assert percent(share) == text


def test_signs():
    assert (percent(0.02, signed=True), number(3.0, signed=True)) == ("+2%", "+3")
