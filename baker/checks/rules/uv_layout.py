"""Checks the layout of a lightmap uv: missing, not finite, outside the page, overlapping, degenerate."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from baker.checks.context import CheckContext
from baker.checks.finding import MOST_FACES, RawFinding
from baker.checks.rule import check
from baker.checks.rules.bad_faces import faces_found
from baker.checks.uv_facts import UvFacts
from baker.core.readable import number
from baker.uv.check import EDGE_SLACK, MOST_LOST, PAGE_TOLERANCE

_UNWRAP = "unwrap the object (`fix` does, a bake with `uv='auto'` does so, too)"


def laid_out(context: CheckContext, *, valid: bool = True) -> Iterator[tuple[int, UvFacts]]:
    """Yield index and lightmap uv of each mesh that has a lightmap uv.

    If `valid` is true, meshes with a uv that is not finite or outside the page are left out.
    """
    for m in range(len(context.meshes)):
        uv = context.uv(m)
        if len(uv.rows) and (uv.valid or not valid):
            yield m, uv


def worst_first(faces: NDArray[np.int64], badness: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return faces (n,) sorted by `badness` (n,), the largest first."""
    return faces[np.argsort(-badness, kind="stable")]


@check(
    "uv.missing",
    group="uv",
    severity="info",
    fix="nothing to do for a bake, which unwraps it; unwrap it yourself to keep control",
)
def missing(context: CheckContext) -> Iterator[RawFinding]:
    """Objects without a lightmap uv (TEXCOORD_1).

    A bake unwraps them. With `uv='keep'` a bake does not unwrap, so a missing lightmap uv is an error.
    """
    severity = "error" if context.settings.uv == "keep" else None
    for m, facts in enumerate(context.meshes):
        lacking = len(facts.good) - len(context.uv(m).rows)
        if lacking:
            some = "it has" if lacking == len(facts.good) else f"{lacking} faces have"
            percent = 100.0 * lacking / len(facts.good)
            location = context.location(m)
            yield RawFinding(f"{some} no TEXCOORD_1", location, lacking, percent=percent, severity=severity)


@check("uv.not_finite", group="uv", severity="error", fix=_UNWRAP)
def not_finite(context: CheckContext) -> Iterator[RawFinding]:
    """A lightmap uv with NaN or infinite coordinates."""
    for m, uv in laid_out(context, valid=False):
        bad = uv.faces[~uv.finite]
        if len(bad):
            yield faces_found(context, m, bad, "{some} with a TEXCOORD_1 that is not finite")


@check("uv.out_of_range", group="uv", severity="error", fix=_UNWRAP)
def out_of_range(context: CheckContext) -> Iterator[RawFinding]:
    """A lightmap uv with coordinates outside 0..1.

    A lightmap does not repeat, so surfaces outside 0..1 have no texels.
    """
    for m, uv in laid_out(context, valid=False):
        bad = uv.finite & uv.outside
        if bad.any():
            low, high = float(uv.uv[uv.finite].min()), float(uv.uv[uv.finite].max())
            text = f"{{some}} with a TEXCOORD_1 outside 0 to 1 (it reaches from {low:.4g} to {high:.4g})"
            yield faces_found(context, m, uv.faces[bad], text)


@check("uv.overlap", group="uv", severity="error", fix=_UNWRAP)
def overlap(context: CheckContext) -> Iterator[RawFinding]:
    """Faces of one object that overlap in the lightmap uv and therefore share texels.

    Both faces show the light of one of the faces. Overlaps are searched on a grid of twice the resolution of
    the page, at most 8192 x 8192 points. The percentage is the number of repeated coverings of points by
    faces, divided by the number of all coverings: 50 % if every point is covered twice. Up to 0.1 % is
    accepted as rounding. Ten pairs of faces are listed.
    """
    from baker.checks.kernels.uv_pairs import COVERED, COVERED_AGAIN, LISTED, OVERLAPPING, cover_pairs

    resolution = context.settings.resolution
    side = min(2 * resolution, 8192)
    for m, uv in laid_out(context):
        owner = np.zeros((side, side), np.int32)
        pairs, counts = np.zeros((MOST_FACES, 2), np.int64), np.zeros(4, np.int64)
        cover_pairs(np.ascontiguousarray(uv.uv) * side, EDGE_SLACK, owner, pairs, counts)
        covered, doubled = int(counts[COVERED]), int(counts[COVERED_AGAIN])
        if doubled > max(2, PAGE_TOLERANCE * (covered + doubled)):
            percent = 100.0 * doubled / (covered + doubled)
            noted = uv.faces[pairs[: counts[LISTED]]]
            text = f"{number(percent)}% of its texels at {resolution} belong to more than one face"
            found = faces_found(context, m, noted[:, 1], text)
            both = tuple((int(a), int(b)) for a, b in uv.facts.local[noted])
            yield replace(found, count=int(counts[OVERLAPPING]), percent=percent, pairs=both)


@check("uv.degenerate", group="uv", severity="warning", fix=_UNWRAP)
def degenerate(context: CheckContext) -> Iterator[RawFinding]:
    """Faces without area in the lightmap uv.

    Such faces have no texels. The finding is an error if they make up more than 1 % of the object's surface,
    or if the area of the whole layout is at most one texel.
    """
    resolution = context.settings.resolution
    for m, uv in laid_out(context):
        flat = np.abs(uv.signed_area) == 0
        lost = float(uv.area[flat].sum()) / max(float(uv.area.sum()), 1e-300)
        if not float(np.abs(uv.signed_area).sum()) * resolution**2 > 1.0:
            text = f"the whole TEXCOORD_1 covers less than one texel of a page of {resolution}"
            yield replace(faces_found(context, m, uv.faces, text), severity="error")
        elif flat.any():
            text = f"{{some}} without area in TEXCOORD_1, {number(100 * lost)}% of the surface"
            found = faces_found(context, m, worst_first(uv.faces[flat], uv.area[flat]), text)
            yield replace(found, percent=100.0 * lost, severity="error" if lost > MOST_LOST else None)


@check("uv.flipped", group="uv", severity="warning", fix=_UNWRAP)
def flipped(context: CheckContext) -> Iterator[RawFinding]:
    """Faces whose orientation in uv differs from that of most of their chart.

    The chart is folded at these faces.
    """
    for m, uv in laid_out(context):
        sign = np.sign(uv.signed_area)
        major = np.sign(uv.per_chart(uv.signed_area))
        bad = uv.faces[sign * major[uv.chart] < 0]
        if len(bad):
            text = "{some} turned over against the rest of their chart in TEXCOORD_1"
            yield faces_found(context, m, bad, text)


@check(
    "uv.mirrored",
    group="uv",
    severity="info",
    fix="mirror these charts if an engine uses tangents of the lightmap uv",
)
def mirrored(context: CheckContext) -> Iterator[RawFinding]:
    """Charts that are mirrored in uv while other charts of the object are not.

    Irradiance is not affected, but directional lightmaps in tangent space are.
    """
    for m, uv in laid_out(context):
        area = uv.per_chart(uv.signed_area)
        # Exporters differ in the direction of v, so the orientation of the larger area counts as not
        # mirrored.
        usual = np.sign(area.sum()) or 1.0
        odd = np.flatnonzero(area * usual < 0)
        if len(odd):
            faces = uv.faces[np.isin(uv.chart, odd)]
            some = "1 chart" if len(odd) == 1 else f"{len(odd)} charts"
            yield replace(faces_found(context, m, faces, f"{some} of TEXCOORD_1 mirrored"), count=len(odd))
