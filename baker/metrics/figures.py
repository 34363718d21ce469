"""Explains each metric of `verify` and `diff` in one phrase, and defines how its value is written.

`FIGURES` is the only table of explanations. The text output, the HTML report and `docs/ACCURACY.md` use it.
The definitions are in `baker.metrics.error_metrics` and in the modules of `baker.verification.criteria`.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from baker.core.readable import number, percent

# Formats in which the value of a metric is written, see `Figure.kind`.
SHARE, SIGNED, COUNT, YES_NO, NUMBER, AREA = "share", "signed", "count", "yes or no", "number", "area"


class Figure(NamedTuple):
    """The explanation of a metric in reports, and the format of its value.

    Attributes
    ----------
    phrase : str
        What the metric means.
    kind : str
        How the value of the metric is written: `SHARE` in percent, `SIGNED` in percent with a sign, `COUNT`
        as an integer, `YES_NO` as a word, `NUMBER` without a unit, `AREA` in m2.
    """

    phrase: str
    kind: str


# Kind of group -> how a phrase names the group whose value is reported.
_GROUPS = {
    "whole": "all texels together",
    "region": "the worst room or light level of a room",
    "level": "the worst light level",
    "object": "the worst object",
    "chart": "the worst chart",
    "edge": "the worst group of points at edges",
}
_GROUP_FIGURES = {
    "bias": Figure("mean error of {}, without the part that noise can explain", SIGNED),
    "colour": Figure("colour shift of {}, without the part that noise can explain", SIGNED),
    "noise": Figure("scatter of the errors in {}, without the part that noise can explain", SHARE),
}
_WHOLE = {
    "texels": Figure("number of compared texels", COUNT),
    "bias": Figure("mean error relative to the mean light; + is too bright", SIGNED),
    "rmse": Figure("root of the mean squared error, in the unit of the channel", NUMBER),
    "nrmse": Figure("root of the mean squared error, relative to the mean light", SHARE),
    "relmse": Figure("mean of the squared relative errors", NUMBER),
    "median": Figure("half of the texels have a smaller relative error", SHARE),
    "p95": Figure("95 of 100 texels have a smaller relative error", SHARE),
    "p99": Figure("99 of 100 texels have a smaller relative error", SHARE),
    "max": Figure("largest relative error of a texel", SHARE),
    "noise_floor": Figure("the median that the noise of path tracing alone would give", SHARE),
    "noise_p95": Figure("the p95 that the noise of path tracing alone would give", SHARE),
    "z_rms": Figure(
        "root mean square of error / standard error of path tracing; about 1 for a bake without error", NUMBER
    ),
    "energy_ratio": Figure("all light of the map divided by all light of path tracing", NUMBER),
    "energy_ratio_se": Figure("standard error of energy_ratio", NUMBER),
    "colour_bias": Figure("bias of the colour with the largest error", SIGNED),
    "colour_median": Figure("median of the colour with the largest error", SHARE),
    "colour_p95": Figure("p95 of the colour with the largest error", SHARE),
    "median_excess": Figure("part of the median that is not noise of path tracing", SHARE),
}
_EDGES = {
    "edge_points": Figure(
        "number of compared points at chart borders, beside walls and between texels", COUNT
    ),
    "edge_median": Figure("median error of lookups at edges", SHARE),
    "edge_p95": Figure("95 of 100 lookups at edges have a smaller error", SHARE),
    "edge_noise_floor": Figure("the edge_median that the noise of path tracing alone would give", SHARE),
    "edge_excess": Figure("part of edge_median that is not noise of path tracing", SHARE),
    "edge_wrong_share": Figure(
        "share of lookups at edges that give over twice or under half the path-traced light", SHARE
    ),
}
_FAULTS = {
    "suspects": Figure("texels that differ strongly from all their neighbours", COUNT),
    "wrong_suspects": Figure(
        "texels that differ strongly from all their neighbours and from path tracing", COUNT
    ),
    "shifted": Figure("whether the page is shifted by a texel", YES_NO),
    "shifted_charts": Figure("number of charts that are shifted by a texel", COUNT),
    "shift": Figure("rows and columns by which the page is shifted", NUMBER),
    "exponent": Figure("exponent p of the best fit map = c (path tracing)^p; 1 is right", NUMBER),
    "exponent_error": Figure(
        "exponent minus 1; far from 0 if the map was encoded with a curve such as gamma", NUMBER
    ),
    "blurred": Figure("whether the page was blurred", YES_NO),
    "few_levels": Figure("whether the values were rounded to few levels", YES_NO),
    "cut_off": Figure(
        "share by which path tracing exceeds the map at texels with the map's largest value", SHARE
    ),
    "misfilled_share": Figure(
        "share of padding texels that do not continue the values of their chart", SHARE
    ),
}
_UNVERIFIED = {
    "area": Figure("surface of the scene", AREA),
    "invalid_area": Figure("surface on invalid texels, which the bake filled from their neighbours", AREA),
    "invalid_share": Figure("surface on invalid texels, which the bake filled from their neighbours", SHARE),
    "visible_invalid_share": Figure(
        "surface on invalid texels that is visible from points in the air", SHARE
    ),
    "uncovered_area": Figure("surface on all other texels without a measured value", AREA),
    "uncovered_share": Figure("surface on all other texels without a measured value", SHARE),
    "unresolved_area": Figure("surface where path tracing stayed too noisy", AREA),
    "unresolved_share": Figure("surface where path tracing stayed too noisy", SHARE),
    "gap_area": Figure("surface in gaps narrower than two texels", AREA),
    "gap_share": Figure("surface in gaps narrower than two texels", SHARE),
    "tilted_area": Figure("surface whose shading normal differs from its face normal", AREA),
    "tilted_share": Figure("surface whose shading normal differs from its face normal", SHARE),
    "unresolved": Figure(
        "number of texels whose path-traced value did not reach the target standard error", COUNT
    ),
    "flip": Figure("visible difference (FLIP): 0 none, 1 largest", NUMBER),
}


def _group_figures(prefix: str, where: str) -> dict[str, Figure]:
    kinds = ("noise",) if prefix == "level" else tuple(_GROUP_FIGURES)
    return {
        f"{prefix}_{kind}": Figure(_GROUP_FIGURES[kind].phrase.format(where), _GROUP_FIGURES[kind].kind)
        for kind in kinds
    }


_OF_GROUPS = {key: value for item in _GROUPS.items() for key, value in _group_figures(*item).items()}
FIGURES: dict[str, Figure] = {**_WHOLE, **_OF_GROUPS, **_EDGES, **_FAULTS, **_UNVERIFIED}


def figure_text(name: str, value: Any) -> str:
    """Return the value of a metric as text.

    Parameters
    ----------
    name : str
        Name of the metric. The value of a metric that is not in `FIGURES` is written as a number.
    value : number, list of numbers, or None
        Value of the metric.

    Returns
    -------
    str
        For example "1.52%" for the value 0.0152 of a metric of the kind `SHARE`; "-" without a value.
    """
    if value is None:
        return "-"
    if isinstance(value, list | tuple):
        return ", ".join(figure_text(name, each) for each in value)
    kind = _kind(name)
    if kind == COUNT:
        return str(int(value))
    if kind == YES_NO:
        return "yes" if value else "no"
    if kind in (SHARE, SIGNED):
        return percent(value, signed=kind == SIGNED)
    # A ratio near 1 needs four decimals, because its distance from 1 matters.
    text = f"{value:.4f}" if name in ("energy_ratio", "energy_ratio_se") else number(value)
    return f"{text} m2" if kind == AREA else text


def limit_text(name: str, operator: str, limit: float) -> str:
    """Return a limit on a metric as text, such as "> 1.5%"; "yes" if a yes-no metric must not be true."""
    if _kind(name) == YES_NO and operator == ">" and limit == 0:
        return "yes"
    shown = percent(limit) if _kind(name) in (SHARE, SIGNED) else f"{limit:g}"
    return f"{operator} {shown}"


def _kind(name: str) -> str:
    return FIGURES[name].kind if name in FIGURES else NUMBER
