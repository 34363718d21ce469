"""Maps or charts that were shifted, maps blurred, bent by a curve, rounded to few levels, or cut off."""

from __future__ import annotations

from typing import Any

import numpy as np

from baker.core.lightmap import TexelStatus
from baker.metrics.fillings import misfilled_share
from baker.metrics.levels import cut_off, few_levels
from baker.metrics.misalignment import best_shift, exponent, is_blurred
from baker.verification.judgements.judgement import Evidence, Judged, Judgement

# A shifted chart fits this much better where it should be; there are many, and few texels tell of each.
_CHART_BETTER = 0.5


def judge(evidence: Evidence) -> Judged:
    """Return what is wrong with the map as a picture."""
    mine = evidence.texels
    telling = (mine | evidence.steep) & ~evidence.points.gap
    places = evidence.compared.of(mine)
    page = evidence.stored.mean(axis=3, dtype="float64")
    truth, error = (a[telling].mean(axis=1) for a in evidence.compared[1:3])
    where = (page, evidence.pages.covered, evidence.points.pixel[telling], truth, error)
    down, right = best_shift(*where)
    charts = _shifted_charts(evidence)
    power = exponent(places.value.mean(axis=1), places.reference.mean(axis=1))
    figures: dict[str, Any] = {
        "shifted": int((down, right) != (0, 0)),
        "shifted_charts": len(charts),
        "exponent_error": None if power is None else power - 1.0,
        "blurred": int(is_blurred(*where[:4])),
        "few_levels": int(few_levels(evidence.stored, evidence.pages.covered)),
        "cut_off": cut_off(evidence.stored, evidence.pages.covered, places, evidence.points.pixel[mine]),
        "misfilled_share": misfilled_share(
            evidence.stored, evidence.pages.covered, evidence.bake.status == TexelStatus.DILATED
        ),
        "shift": [down, right],
        "exponent": power,
    }
    name = evidence.channel
    remarks = {
        "shifted": f"{name} fits better {down} rows and {right} columns further: the page is shifted",
        "shifted_charts": f"{name} of {'; '.join(charts)}",
        "blurred": f"{name} is off where its light curves, as a blurred page is",
        "few_levels": f"{name} holds few, evenly spaced levels: the page was rounded",
        "misfilled_share": f"{name} beyond the borders of charts is not like that at the borders (dilation)",
        "cut_off": f"{name} is cut off at its largest value",
    }
    if power is not None:
        remarks["exponent_error"] = (
            f"{name} follows the {power:.2f}th power of the truth: a curve was applied"
        )
    return Judged(figures, remarks)


def _shifted_charts(evidence: Evidence) -> list[str]:
    """Return what is said of each chart that fits better one texel further."""
    points, size = evidence.points, evidence.bake.atlas.resolution
    telling = np.flatnonzero((evidence.texels | evidence.steep | evidence.scarce) & ~points.gap)
    page = evidence.stored.mean(axis=3, dtype="float64")
    truth, error = (a.mean(axis=1) for a in evidence.compared[1:3])
    found = []
    for number in np.unique(points.chart[telling]):
        mine = telling[points.chart[telling] == number]
        where = (page, evidence.pages.covered, points.pixel[mine], truth[mine], error[mine])
        down, right = best_shift(*where, _CHART_BETTER)
        if (down, right) != (0, 0):
            first, rest = divmod(int(points.pixel[mine[0]]), size * size)
            owner = evidence.bake.scene.instances[int(points.owner[mine[0]])].name
            found.append(
                f"the chart at row {rest // size}, column {rest % size} of page {first}, of '{owner}', fits"
                f" better {down} rows and {right} columns further"
            )
    return found


DISTORTION = Judgement(
    "distortion",
    ("shifted", "shifted_charts", "exponent_error", "blurred", "few_levels", "cut_off", "misfilled_share"),
    {
        "irradiance": "irradiance.shifted > 0, irradiance.shifted_charts > 0,"
        " irradiance.exponent_error > 0.05, irradiance.blurred > 0,"
        " irradiance.few_levels > 0, irradiance.cut_off > 0.02, irradiance.misfilled_share > 0.05",
        "ao": "ao.shifted > 0, ao.shifted_charts > 0, ao.blurred > 0, ao.few_levels > 0",
    },
    judge,
)
