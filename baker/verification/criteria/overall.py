"""Computes error metrics over all compared texels, and the deviations of all texels as one group."""

from __future__ import annotations

import numpy as np

from baker.metrics.error_metrics import METRICS, beyond_noise, error_metrics
from baker.verification.criteria.criterion import ChannelData, Criterion, CriterionResult
from baker.verification.criteria.groups import make_groups, worst_metrics


def evaluate(data: ChannelData) -> CriterionResult:
    """Compute `error_metrics`, the median error beyond the reference's noise, and the group's deviations."""
    mine = data.texels
    compared = data.compared.of(mine)
    found = error_metrics(
        compared.value,
        compared.reference,
        standard_error=compared.standard_error,
        halves=compared.halves,
        weight=data.points.texel_area[mine],
    )
    median, noise = found["median"], found["noise_floor"]
    excess = None if median is None or noise is None else beyond_noise(median, noise)
    groups = make_groups(data, [("all texels", np.flatnonzero(mine & ~data.points.gap & ~data.tilted))])
    whole, remarks = worst_metrics("whole", groups, data.channel)
    return CriterionResult({**found, **whole, "median_excess": excess}, remarks)


OVERALL = Criterion(
    "overall",
    (*METRICS, "median_excess", "whole_bias", "whole_colour", "whole_noise"),
    {
        "irradiance": "irradiance.median_excess > 0.06, irradiance.bias > 0.015, irradiance.nrmse > 0.25,"
        " irradiance.colour_median > 0.1, irradiance.colour_bias > 0.015, irradiance.whole_bias > 0.005,"
        " irradiance.whole_colour > 0.003, irradiance.whole_noise > 0.03",
        "ao": "ao.median_excess > 0.015, ao.bias > 0.015, ao.rmse > 0.05, ao.whole_bias > 0.003,"
        " ao.whole_noise > 0.03",
    },
    evaluate,
)
