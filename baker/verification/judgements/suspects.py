"""Texels that stand out from all their neighbours, and whether they are right."""

from __future__ import annotations

from typing import Any

import numpy as np

from baker.metrics.error_metrics import dark_floor
from baker.verification.judgements.judgement import Evidence, Judged, Judgement

_WRONG, _SURE = 0.3, 4.0


def judge(evidence: Evidence) -> Judged:
    """Return how many such texels were judged, and how many are plainly wrong."""
    points = evidence.points
    mine = evidence.suspects & ~points.gap
    figures: dict[str, Any] = {"suspects": int(mine.sum()), "wrong_suspects": 0}
    remarks = {}
    if mine.any():
        places = evidence.compared.of(mine)
        noise = np.where(np.isfinite(places.standard_error), places.standard_error, 0.0)
        floor = dark_floor(evidence.compared.reference[evidence.texels])
        scale = np.maximum(np.maximum(places.value, places.reference), floor)
        off = np.abs(places.value - places.reference)
        wrong = (off > np.maximum(_WRONG * scale, _SURE * noise)).any(axis=1)
        figures["wrong_suspects"] = int(wrong.sum())
        remarks["wrong_suspects"] = (
            f"{int(wrong.sum())} single texels of {evidence.channel} stand out from their neighbours"
            " and are wrong"
        )
    return Judged(figures, remarks)


SUSPECTS = Judgement(
    "suspects",
    ("suspects", "wrong_suspects"),
    {"irradiance": "irradiance.wrong_suspects > 8", "ao": "ao.wrong_suspects > 8"},
    judge,
)
