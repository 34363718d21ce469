"""Points at edges, looked up bilinearly as engines do: chart borders, feet of walls, between texels."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from baker.metrics.error_metrics import beyond_noise, dark_floor
from baker.metrics.texel_area import look_up
from baker.verification.judgements.groups import make_groups, worst_figures
from baker.verification.judgements.judgement import Evidence, Judged, Judgement

# A point that is off by this share of the brighter of both, beyond so many standard errors, is plainly wrong.
_WRONG, _SURE = 0.5, 4.0
_LEAST = 8
# A lookup takes filled texels if they weigh more than this.
_FILLED = 0.1


def judge(evidence: Evidence) -> Judged:
    """Return figures over the points at edges that lie in no gap."""
    points = evidence.points
    mine = evidence.edges & ~points.gap
    figures: dict[str, Any] = dict.fromkeys(EDGES.figures)
    figures["edge_points"] = int(mine.sum())
    if mine.sum() < _LEAST:
        return Judged(figures)
    places = evidence.compared.of(mine)
    v, r = places.value.mean(axis=1), places.reference.mean(axis=1)
    floor = np.full(len(r), dark_floor(places.reference))
    for room in np.unique(points.room[mine]):
        same = points.room[mine] == room
        floor[same] = dark_floor(places.reference[same])
    noise = np.where(np.isfinite(places.standard_error), places.standard_error, 0.0).mean(axis=1)
    error = np.abs(v - r) / np.maximum(r, np.maximum(floor, 1e-12))
    wrong = np.abs(v - r) > np.maximum(_WRONG * np.maximum(np.maximum(v, r), floor), _SURE * noise)
    figures["edge_median"], figures["edge_p95"] = (float(np.percentile(error, q)) for q in (50, 95))
    apart = 0.5 * np.abs((places.halves[0] - places.halves[1]).mean(axis=1))
    figures["edge_noise_floor"] = float(np.median(apart / np.maximum(r, np.maximum(floor, 1e-12))))
    figures["edge_excess"] = beyond_noise(figures["edge_median"], figures["edge_noise_floor"])
    figures["edge_wrong_share"] = float(wrong.mean())
    chosen, filled = np.flatnonzero(mine), filled_share(evidence) > _FILLED
    members = [
        ("points looked up beside filled texels", chosen[filled[chosen]]),
        ("points at edges", chosen[~filled[chosen]]),
    ]
    for number in np.unique(points.owner[chosen]):
        instance = evidence.bake.scene.instances[int(number)]
        name = f"points at edges of '{instance.name}' (node {instance.node})"
        members.append((name, chosen[points.owner[chosen] == number]))
    for room in np.unique(points.room[chosen]):
        members.append((f"points at edges in room {room}", chosen[points.room[chosen] == room]))
    worst, remarks = worst_figures("edge", make_groups(evidence, members), evidence.channel)
    remarks |= {
        "edge_wrong_share": f"{int(wrong.sum())} of {len(v)} points at edges hold twice, or less than half,"
        f" the {evidence.channel} that they should",
    }
    return Judged({**figures, **worst}, remarks)


def filled_share(evidence: Evidence) -> NDArray[np.float64]:
    """Return how much of each point's lookup (n,) is of texels that hold nothing measured."""
    covered = evidence.pages.covered[..., None].astype(np.float32)
    measured = look_up(covered, evidence.points.pixel, evidence.points.places.middle)
    return np.asarray(1.0 - measured[:, 0], np.float64)


EDGES = Judgement(
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
    judge,
)  # fmt: skip
