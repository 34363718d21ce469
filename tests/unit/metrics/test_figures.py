"""Every figure has an explanation, and its value is written in the unit that the explanation implies."""

from __future__ import annotations

import pytest

from baker.comparison.compare import LIMITED
from baker.metrics.error_metrics import METRICS
from baker.metrics.figures import FIGURES, figure_text, limit_text
from baker.verification.criteria.registry import METRIC_NAMES


def test_every_figure_is_explained_once():
    assert {*METRICS, *METRIC_NAMES, *LIMITED, "flip", "unresolved"} <= set(FIGURES)
    assert all(figure.phrase and "{" not in figure.phrase for figure in FIGURES.values())


@pytest.mark.parametrize(
    ("name", "value", "text"),
    [
        ("bias", 0.0152, "+1.52%"), ("median", 0.0152, "1.52%"), ("texels", 400, "400"),
        ("z_rms", 1.234, "1.23"),
        ("energy_ratio", 0.99966, "0.9997"), ("shifted", 1, "yes"), ("area", 12.3456, "12.3 m2"),
        ("shift", [0, 1], "0, 1"), ("p95", None, "-"), ("max", 3.4306, "343%"),
    ],
)  # fmt: skip
def test_values(name, value, text):
    assert figure_text(name, value) == text


def test_limits_have_the_unit_of_their_figure():
    assert limit_text("bias", ">", 0.015) == "> 1.5%"
    assert limit_text("wrong_suspects", ">", 8) == "> 8"
    assert limit_text("shifted", ">", 0) == "yes"
