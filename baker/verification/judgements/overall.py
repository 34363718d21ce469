"""Figures over all judged texels, and their bias and colour as a group of their own."""

from __future__ import annotations

import numpy as np

from baker.judge.figures import FIGURES, figures
from baker.verification.judgements.groups import make_groups, worst_figures
from baker.verification.judgements.judgement import Evidence, Judged, Judgement


def judge(evidence: Evidence) -> Judged:
    """Return the figures of `judge.figures`."""
    mine = evidence.texels
    places = evidence.compared.of(mine)
    found = figures(
        places.value,
        places.reference,
        standard_error=places.standard_error,
        halves=places.halves,
        weight=evidence.points.stands_for[mine],
    )
    groups = make_groups(evidence, [("all texels", np.flatnonzero(mine & ~evidence.points.gap))])
    whole, remarks = worst_figures("whole", groups, evidence.channel)
    return Judged({**found, **whole}, remarks)


OVERALL = Judgement(
    "overall",
    (*FIGURES, "whole_bias", "whole_colour", "whole_noise"),
    {
        "irradiance": "irradiance.median > 0.12, irradiance.bias > 0.02, irradiance.nrmse > 0.5,"
        " irradiance.colour_median > 0.15, irradiance.colour_bias > 0.02, irradiance.whole_bias > 0.01,"
        " irradiance.whole_colour > 0.007, irradiance.whole_noise > 0.08",
        "ao": "ao.median > 0.03, ao.bias > 0.01, ao.rmse > 0.05, ao.whole_bias > 0.005,"
        " ao.whole_noise > 0.05",
    },
    judge,
)
