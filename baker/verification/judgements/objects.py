"""Objects and charts, each judged on the whole, and the figures of each object."""

from __future__ import annotations

from typing import Any

import numpy as np

from baker.metrics.error_metrics import dark_floor, figures
from baker.verification.judgements.groups import make_groups, worst_figures
from baker.verification.judgements.judgement import Evidence, Judged, Judgement


def judge_objects(evidence: Evidence) -> Judged:
    """Return the figures of each object that was judged, in the order of the scene, and of the worst."""
    points, instances = evidence.points, evidence.bake.scene.instances
    mine = evidence.texels
    floor = dark_floor(evidence.compared.reference[mine])
    rows: list[dict[str, Any]] = []
    members = []
    for number in np.unique(points.owner[mine]):
        chosen = np.flatnonzero(mine & (points.owner == number))
        places = evidence.compared.of(chosen)
        instance = instances[int(number)]
        found = figures(
            places.value,
            places.reference,
            standard_error=places.standard_error,
            halves=places.halves,
            floor=floor,
            weight=points.stands_for[chosen],
        )
        rows.append({"object": instance.name, "node": instance.node, **found})
        name = f"'{instance.name}' (node {instance.node})"
        members.append((name, chosen[evidence.whole[chosen]]))
    worst, remarks = worst_figures("object", make_groups(evidence, members), evidence.channel)
    return Judged(worst, remarks, rows)


def judge_charts(evidence: Evidence) -> Judged:
    """Return the figures of the worst chart."""
    points, instances = evidence.points, evidence.bake.scene.instances
    size = evidence.bake.atlas.resolution
    mine = evidence.texels & evidence.whole
    members = []
    for number in np.unique(points.chart[mine]):
        chosen = np.flatnonzero(mine & (points.chart == number))
        page, rest = divmod(int(points.pixel[chosen[0]]), size * size)
        name = (
            f"the chart at row {rest // size}, column {rest % size} of page {page}, of"
            f" '{instances[int(points.owner[chosen[0]])].name}'"
        )
        members.append((name, chosen))
    worst, remarks = worst_figures("chart", make_groups(evidence, members), evidence.channel)
    return Judged(worst, remarks)


OBJECTS = Judgement(
    "objects",
    ("object_bias", "object_colour", "object_noise"),
    {
        "irradiance": "irradiance.object_bias > 0.025, irradiance.object_colour > 0.01,"
        " irradiance.object_noise > 0.1",
        "ao": "ao.object_bias > 0.02, ao.object_noise > 0.06",
    },
    judge_objects,
)
CHARTS = Judgement(
    "charts",
    ("chart_bias", "chart_colour", "chart_noise"),
    {
        "irradiance": "irradiance.chart_bias > 0.025, irradiance.chart_colour > 0.01,"
        " irradiance.chart_noise > 0.1",
        "ao": "ao.chart_bias > 0.02, ao.chart_noise > 0.06",
    },
    judge_charts,
)
