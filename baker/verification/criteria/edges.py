"""Compares bilinear lookups of the map with the reference at chart borders, next to walls, between texels."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from baker.metrics.error_metrics import beyond_noise, dark_floor
from baker.metrics.texel_area import look_up
from baker.verification.criteria.criterion import ChannelData, Criterion, CriterionResult
from baker.verification.criteria.groups import make_groups, worst_metrics

# Limits above which a point is wrong: error divided by the largest of value, reference and `dark_floor`, and
# error divided by the standard error. A wrong point exceeds both.
_WRONG, _Z = 0.5, 4.0
# Number of points below which no metrics are computed.
_MIN_POINTS = 8
# Weight of filled texels in the bilinear lookup at a point. Above this weight, the point is counted in the
# group of points beside filled texels.
_FILLED = 0.1


def evaluate(data: ChannelData) -> CriterionResult:
    """Compute metrics over all points at edges that are not in gaps."""
    points = data.points
    mine = data.edges & ~points.gap
    metrics: dict[str, Any] = dict.fromkeys(EDGES.metrics)
    metrics["edge_points"] = int(mine.sum())
    if mine.sum() < _MIN_POINTS:
        return CriterionResult(metrics)
    compared = data.compared.of(mine)
    v, r = compared.value.mean(axis=1), compared.reference.mean(axis=1)
    floor = np.full(len(r), dark_floor(compared.reference))
    for room in np.unique(points.room[mine]):
        same = points.room[mine] == room
        floor[same] = dark_floor(compared.reference[same])
    noise = np.where(np.isfinite(compared.standard_error), compared.standard_error, 0.0).mean(axis=1)
    error = np.abs(v - r) / np.maximum(r, np.maximum(floor, 1e-12))
    wrong = np.abs(v - r) > np.maximum(_WRONG * np.maximum(np.maximum(v, r), floor), _Z * noise)
    metrics["edge_median"], metrics["edge_p95"] = (float(np.percentile(error, q)) for q in (50, 95))
    apart = 0.5 * np.abs((compared.halves[0] - compared.halves[1]).mean(axis=1))
    metrics["edge_noise_floor"] = float(np.median(apart / np.maximum(r, np.maximum(floor, 1e-12))))
    metrics["edge_excess"] = beyond_noise(metrics["edge_median"], metrics["edge_noise_floor"])
    metrics["edge_wrong_share"] = float(wrong.mean())
    chosen, filled = np.flatnonzero(mine), filled_share(data) > _FILLED
    members = [
        ("points looked up beside filled texels", chosen[filled[chosen]]),
        ("points at edges", chosen[~filled[chosen]]),
    ]
    for number in np.unique(points.owner[chosen]):
        instance = data.bake.scene.instances[int(number)]
        name = f"points at edges of '{instance.name}' (node {instance.node})"
        members.append((name, chosen[points.owner[chosen] == number]))
    for room in np.unique(points.room[chosen]):
        members.append((f"points at edges in room {room}", chosen[points.room[chosen] == room]))
    worst, remarks = worst_metrics("edge", make_groups(data, members), data.channel)
    remarks |= {
        "edge_wrong_share": f"{int(wrong.sum())} of {len(v)} points at edges hold more than twice or less"
        f" than half the {data.channel} of path tracing",
    }
    return CriterionResult({**metrics, **worst}, remarks)


def filled_share(data: ChannelData) -> NDArray[np.float64]:
    """Return (n,) float64: the weight of texels without a measured value in each point's lookup."""
    covered = data.pages.covered[..., None].astype(np.float32)
    measured = look_up(covered, data.points.pixel, data.points.surface.offset)
    return np.asarray(1.0 - measured[:, 0], np.float64)


EDGES = Criterion(
    "edges",
    (
        "edge_points", "edge_median", "edge_p95", "edge_noise_floor", "edge_excess", "edge_bias",
        "edge_colour", "edge_noise", "edge_wrong_share",
    ),
    {
        "irradiance": "irradiance.edge_excess > 0.12, irradiance.edge_bias > 0.03,"
        " irradiance.edge_noise > 0.1, irradiance.edge_wrong_share > 0.08",
        "ao": "ao.edge_excess > 0.06, ao.edge_bias > 0.03, ao.edge_wrong_share > 0.05",
    },
    evaluate,
)  # fmt: skip
