"""Computes the deviations of whole objects and whole charts, and the error metrics of each object."""

from __future__ import annotations

from typing import Any

import numpy as np

from baker.metrics.error_metrics import dark_floor, error_metrics
from baker.verification.criteria.criterion import ChannelData, Criterion, CriterionResult
from baker.verification.criteria.groups import make_groups, worst_metrics


def evaluate_objects(data: ChannelData) -> CriterionResult:
    """Compute the largest deviations of objects, and a table of error metrics in the order of the scene."""
    points, instances = data.points, data.bake.scene.instances
    mine = data.texels
    floor = dark_floor(data.compared.reference[mine])
    rows: list[dict[str, Any]] = []
    members = []
    for number in np.unique(points.owner[mine]):
        chosen = np.flatnonzero(mine & (points.owner == number))
        compared = data.compared.of(chosen)
        instance = instances[int(number)]
        found = error_metrics(
            compared.value,
            compared.reference,
            standard_error=compared.standard_error,
            halves=compared.halves,
            floor=floor,
            weight=points.texel_area[chosen],
        )
        rows.append({"object": instance.name, "node": instance.node, **found})
        name = f"'{instance.name}' (node {instance.node})"
        members.append((name, chosen[data.interior[chosen]]))
    worst, remarks = worst_metrics("object", make_groups(data, members), data.channel)
    return CriterionResult(worst, remarks, rows)


def evaluate_charts(data: ChannelData) -> CriterionResult:
    """Compute the largest deviations of all charts."""
    points, instances = data.points, data.bake.scene.instances
    size = data.bake.atlas.resolution
    mine = data.texels & data.interior
    members = []
    for number in np.unique(points.chart[mine]):
        chosen = np.flatnonzero(mine & (points.chart == number))
        page, rest = divmod(int(points.pixel[chosen[0]]), size * size)
        name = (
            f"the chart at row {rest // size}, column {rest % size} of page {page}, of"
            f" '{instances[int(points.owner[chosen[0]])].name}'"
        )
        members.append((name, chosen))
    worst, remarks = worst_metrics("chart", make_groups(data, members), data.channel)
    return CriterionResult(worst, remarks)


OBJECTS = Criterion(
    "objects",
    ("object_bias", "object_colour", "object_noise"),
    {
        "irradiance": "irradiance.object_bias > 0.025, irradiance.object_colour > 0.01,"
        " irradiance.object_noise > 0.1",
        "ao": "ao.object_bias > 0.02, ao.object_noise > 0.06",
    },
    evaluate_objects,
)
CHARTS = Criterion(
    "charts",
    ("chart_bias", "chart_colour", "chart_noise"),
    {
        "irradiance": "irradiance.chart_bias > 0.025, irradiance.chart_colour > 0.01,"
        " irradiance.chart_noise > 0.1",
        "ao": "ao.chart_bias > 0.02, ao.chart_noise > 0.06",
    },
    evaluate_charts,
)
