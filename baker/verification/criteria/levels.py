"""Computes the own error of each light level, in dark as well as in bright areas.

The own error is defined in `baker.metrics.groups`. The levels divide the scale of light into intervals of a
factor sqrt(10). A level contains the compared texels of all rooms whose light is in its interval. The darkest
5, 10 and 20 % of all compared texels are further groups, so that a fault of the darkest texels is not hidden
among brighter texels. Narrower levels would not detect more faults: texels are assigned to levels by values
that include the error, so a large error moves a texel to another level.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from baker.metrics.groups import ComparedPoints
from baker.metrics.sample_texels import light_level
from baker.verification.criteria.criterion import ChannelData, Criterion, CriterionResult
from baker.verification.criteria.groups import make_groups, worst_metrics

# Shares of all texels in the groups of the darkest texels.
_DARKEST = (0.05, 0.1, 0.2)
# `equal_weight` of `level_light`: relative standard error of the reference at which reference and map have
# the same weight.
EQUAL_WEIGHT = 0.15


def level_light(compared: ComparedPoints, equal_weight: float) -> NDArray[np.float64]:
    """Return (n,) float64: the light by which points are assigned to levels, a mean of reference and map.

    An error of this light moves points to a neighbouring level. This biases the errors in both levels. So the
    reference has more weight where its noise is low, and the map has more weight elsewhere. Both have the
    same weight if the relative standard error of the reference is `equal_weight`, which is about the error to
    be detected.
    """
    value, reference = compared.value.mean(axis=1), compared.reference.mean(axis=1)
    noise = np.where(np.isfinite(compared.spread), compared.spread, 0.0).mean(axis=1)
    variance = (noise / np.maximum(reference, 1e-30)) ** 2
    weight = variance / (variance + equal_weight**2)
    return np.asarray(weight * value + (1.0 - weight) * reference, np.float64)


def _span(light: NDArray[np.float64]) -> str:
    return f"light {light.min():.4g} to {light.max():.4g} in all rooms"


def evaluate(data: ChannelData) -> CriterionResult:
    """Compute the largest own error of all levels, and a table of the levels in order of increasing light.

    The groups of the darkest texels are included in both.
    """
    points = data.points
    mine = np.flatnonzero((data.texels | data.scarce) & data.interior & (points.room >= 0))
    light = level_light(data.compared.of(mine), EQUAL_WEIGHT)
    order = np.argsort(light, kind="stable")
    level = light_level(light)[order]
    members: list[tuple[str, NDArray[np.int64]]] = []
    for number in np.unique(level):
        same = order[level == number]
        members.append((_span(light[same]), mine[same]))
    for share in _DARKEST:
        darkest = order[: int(share * len(order))]
        if len(darkest):
            members.append((f"the darkest {share:.0%}, {_span(light[darkest])}", mine[darkest]))
    groups = make_groups(data, members)
    worst, remarks = worst_metrics("level", groups, data.channel)
    rows: list[dict[str, Any]] = [
        {"level": group.name, "channel": data.channel, **group.found.as_json()}
        for group in sorted(groups, key=lambda group: group.found.light)
    ]
    return CriterionResult({"level_noise": worst["level_noise"]}, remarks, rows)


LIGHT_LEVELS = Criterion(
    "levels",
    ("level_noise",),
    {"irradiance": "irradiance.level_noise > 0.07", "ao": "ao.level_noise > 0.06"},
    evaluate,
)
