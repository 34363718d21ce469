"""Figures over all judged texels, and their bias and colour as a group of their own."""

from __future__ import annotations

import numpy as np

from baker.metrics.error_metrics import FIGURES, beyond_noise, figures
from baker.verification.judgements.groups import make_groups, worst_figures
from baker.verification.judgements.judgement import Evidence, Judged, Judgement


def judge(evidence: Evidence) -> Judged:
    """Return the figures of `error_metrics`, and what the median holds beside the reference's noise."""
    mine = evidence.texels
    places = evidence.compared.of(mine)
    found = figures(
        places.value,
        places.reference,
        standard_error=places.standard_error,
        halves=places.halves,
        weight=evidence.points.stands_for[mine],
    )
    median, noise = found["median"], found["noise_floor"]
    excess = None if median is None or noise is None else beyond_noise(median, noise)
    groups = make_groups(
        evidence, [("all texels", np.flatnonzero(mine & ~evidence.points.gap & ~evidence.tilted))]
    )
    whole, remarks = worst_figures("whole", groups, evidence.channel)
    return Judged({**found, **whole, "median_excess": excess}, remarks)


OVERALL = Judgement(
    "overall",
    (*FIGURES, "median_excess", "whole_bias", "whole_colour", "whole_noise"),
    {
        "irradiance": "irradiance.median_excess > 0.06, irradiance.bias > 0.015, irradiance.nrmse > 0.25,"
        " irradiance.colour_median > 0.1, irradiance.colour_bias > 0.015, irradiance.whole_bias > 0.005,"
        " irradiance.whole_colour > 0.003, irradiance.whole_noise > 0.03",
        "ao": "ao.median_excess > 0.015, ao.bias > 0.015, ao.rmse > 0.05, ao.whole_bias > 0.003,"
        " ao.whole_noise > 0.03",
    },
    judge,
)
