"""Detects shifted maps and charts, and maps that were blurred, gamma-encoded, quantised or clamped."""

from __future__ import annotations

from typing import Any

import numpy as np

from baker.core.lightmap import TexelStatus
from baker.metrics.dilation import misfilled_share
from baker.metrics.levels import cut_off, few_levels
from baker.metrics.misalignment import best_shift, exponent, is_blurred
from baker.verification.criteria.criterion import ChannelData, Criterion, CriterionResult

# Ratio of the squared errors with and without a shift, below which a chart counts as shifted. It is smaller
# than the ratio for a whole map (`metrics.misalignment`). With many charts of few texels each, some charts
# fit better by chance if they are shifted.
_CHART_BETTER = 0.5


def evaluate(data: ChannelData) -> CriterionResult:
    """Compute the metrics of distortions that affect the map as an image."""
    mine = data.texels
    chosen = (mine | data.steep) & ~data.points.gap
    compared = data.compared.of(mine)
    page = data.stored.mean(axis=3, dtype="float64")
    truth, error = (a[chosen].mean(axis=1) for a in data.compared[1:3])
    where = (page, data.pages.covered, data.points.pixel[chosen], truth, error)
    down, right = best_shift(*where)
    charts = _shifted_charts(data)
    power = exponent(compared.value.mean(axis=1), compared.reference.mean(axis=1))
    metrics: dict[str, Any] = {
        "shifted": int((down, right) != (0, 0)),
        "shifted_charts": len(charts),
        "exponent_error": None if power is None else power - 1.0,
        "blurred": int(is_blurred(*where[:4])),
        "few_levels": int(few_levels(data.stored, data.pages.covered)),
        "cut_off": cut_off(data.stored, data.pages.covered, compared, data.points.pixel[mine]),
        "misfilled_share": misfilled_share(
            data.stored, data.pages.covered, data.bake.status == TexelStatus.DILATED
        ),
        "shift": [down, right],
        "exponent": power,
    }
    name = data.channel
    remarks = {
        "shifted": f"{name} fits better if moved by {down} rows and {right} columns: the page is shifted",
        "shifted_charts": f"{name} of {'; '.join(charts)}",
        "blurred": f"{name} has errors where its light curves: the page was blurred",
        "few_levels": f"{name} holds few, evenly spaced levels: the page was rounded",
        "misfilled_share": f"{name} in the padding differs from that at the borders of charts (dilation)",
        "cut_off": f"{name} is cut off at its largest value",
    }
    if power is not None:
        remarks["exponent_error"] = (
            f"{name} follows the reference to the power of {power:.2f}: a curve such as gamma was applied"
        )
    return CriterionResult(metrics, remarks)


def _shifted_charts(data: ChannelData) -> list[str]:
    """Return a phrase for each chart that fits the reference better if it is shifted."""
    points, size = data.points, data.bake.atlas.resolution
    chosen = np.flatnonzero((data.texels | data.steep | data.scarce) & ~points.gap)
    page = data.stored.mean(axis=3, dtype="float64")
    truth, error = (a.mean(axis=1) for a in data.compared[1:3])
    found = []
    for number in np.unique(points.chart[chosen]):
        mine = chosen[points.chart[chosen] == number]
        where = (page, data.pages.covered, points.pixel[mine], truth[mine], error[mine])
        down, right = best_shift(*where, _CHART_BETTER)
        if (down, right) != (0, 0):
            first, rest = divmod(int(points.pixel[mine[0]]), size * size)
            owner = data.bake.scene.instances[int(points.owner[mine[0]])].name
            found.append(
                f"the chart at row {rest // size}, column {rest % size} of page {first}, of '{owner}', fits"
                f" better if moved by {down} rows and {right} columns"
            )
    return found


DISTORTION = Criterion(
    "distortion",
    ("shifted", "shifted_charts", "exponent_error", "blurred", "few_levels", "cut_off", "misfilled_share"),
    {
        "irradiance": "irradiance.shifted > 0, irradiance.shifted_charts > 0,"
        " irradiance.exponent_error > 0.05, irradiance.blurred > 0,"
        " irradiance.few_levels > 0, irradiance.cut_off > 0.02, irradiance.misfilled_share > 0.05",
        "ao": "ao.shifted > 0, ao.shifted_charts > 0, ao.blurred > 0, ao.few_levels > 0",
    },
    evaluate,
)
