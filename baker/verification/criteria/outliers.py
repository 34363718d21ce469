"""Counts the outliers (texels that differ from all their neighbours), and the outliers with wrong values."""

from __future__ import annotations

from typing import Any

import numpy as np

from baker.metrics.error_metrics import dark_floor
from baker.verification.criteria.criterion import ChannelData, Criterion, CriterionResult

# Limits above which a component of a texel is wrong: error divided by the largest of value, reference and
# `dark_floor`, and error divided by the standard error. A wrong component exceeds both.
_WRONG, _Z = 0.3, 4.0


def evaluate(data: ChannelData) -> CriterionResult:
    """Count the outliers that are not in gaps, and those with a wrong value."""
    points = data.points
    mine = data.outliers & ~points.gap
    metrics: dict[str, Any] = {"suspects": int(mine.sum()), "wrong_suspects": 0}
    remarks = {}
    if mine.any():
        compared = data.compared.of(mine)
        noise = np.where(np.isfinite(compared.standard_error), compared.standard_error, 0.0)
        floor = dark_floor(data.compared.reference[data.texels])
        scale = np.maximum(np.maximum(compared.value, compared.reference), floor)
        off = np.abs(compared.value - compared.reference)
        wrong = (off > np.maximum(_WRONG * scale, _Z * noise)).any(axis=1)
        metrics["wrong_suspects"] = int(wrong.sum())
        remarks["wrong_suspects"] = (
            f"{int(wrong.sum())} single texels of {data.channel} differ strongly from their"
            " neighbours and from path tracing"
        )
    return CriterionResult(metrics, remarks)


OUTLIERS = Criterion(
    "outliers",
    ("suspects", "wrong_suspects"),
    {"irradiance": "irradiance.wrong_suspects > 8", "ao": "ao.wrong_suspects > 8"},
    evaluate,
)
