"""Checks a lightmap uv at the resolution of the bake: chart size, padding, density, stretch, filling."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from baker.checks.context import CheckContext
from baker.checks.finding import RawFinding
from baker.checks.rule import check
from baker.checks.rules.bad_faces import faces_found
from baker.checks.rules.uv_layout import laid_out
from baker.checks.uv_facts import UvFacts
from baker.core.readable import number

# Area of a chart below which it is reported, texels.
SMALLEST_CHART = 4.0
# A chart is reported if its texels per metre differ from the object's median by more than this factor. A
# factor of 4 is two mip levels.
DENSITY_FACTOR = 4.0
# Ratio of singular values above which a face counts as stretched, and share of an object's surface above
# which the stretched faces are reported.
STRETCH, MOST_STRETCHED = 4.0, 0.05
# Area of a layout as a share of its bounding rectangle. Below this share, the layout is reported.
LEAST_FILLED = 0.4
# Share of an object's surface whose faces are points in TEXCOORD_0, above which TEXCOORD_0 may be a lookup of
# palette colours.
PALETTE_SHARE = 0.9


@check(
    "uv.tiny_chart",
    group="uv",
    severity="warning",
    fix="give these charts more room, join them with neighbours, or raise `resolution`",
)
def tiny_chart(context: CheckContext) -> Iterator[RawFinding]:
    """Charts with an area of less than four texels.

    The light of such a chart is nearly a single value, which bilinear lookup mixes with the padding.
    """
    resolution = context.settings.resolution
    for m, uv in laid_out(context):
        texels = uv.per_chart(np.abs(uv.signed_area)) * resolution**2
        small = np.flatnonzero((texels < SMALLEST_CHART) & (texels > 0))
        if len(small):
            faces = uv.faces[np.isin(uv.chart, small)]
            some = "1 chart covers" if len(small) == 1 else f"{len(small)} of {uv.n_charts} charts cover"
            found = faces_found(context, m, faces, f"{some} less than four texels at {resolution}")
            yield replace(found, count=len(small), percent=100.0 * len(small) / uv.n_charts)


@check(
    "uv.padding",
    group="uv",
    severity="warning",
    fix="leave at least two texels between charts at the resolution used, or unwrap again",
)
def padding(context: CheckContext) -> Iterator[RawFinding]:
    """Charts so close to each other that bilinear lookup mixes them.

    A lookup at the border of a chart also reads the neighbouring texels. If one of them is part of another
    chart, its light appears as a bright or dark line.
    """
    for m, uv in laid_out(context):
        close, covered = _close(uv, context.settings.resolution)
        if close:
            percent = 100.0 * close / covered
            yield RawFinding(
                f"{number(percent)}% of its texels touch another chart's: bilinear lookup mixes them",
                context.location(m),
                close,
                percent=percent,
            )


@check(
    "uv.padding_mip",
    group="uv",
    severity="info",
    fix="use 2^level texels and more between charts, or sample the lightmap without mipmaps",
)
def padding_mip(context: CheckContext) -> Iterator[RawFinding]:
    """Charts that bilinear lookup mixes at the mip level `mip` (default 2).

    A texel of level n covers 2^n x 2^n texels of the page. Only lightmaps that are sampled with mipmaps are
    affected. Objects that `uv.padding` reports are not reported again.
    """
    coarse = context.settings.resolution >> context.mip
    for m, uv in laid_out(context):
        if coarse < 1 or uv.n_charts < 2 or _close(uv, context.settings.resolution)[0]:
            continue
        close, covered = _close(uv, coarse)
        if close:
            percent = 100.0 * close / covered
            yield RawFinding(
                f"{number(percent)}% of its texels at mip level {context.mip} touch another chart's",
                context.location(m),
                close,
                percent=percent,
            )


def _close(uv: UvFacts, resolution: int) -> tuple[int, int]:
    """Return the number of texels next to a texel of another chart, and the number of covered texels.

    `resolution` is the width of the page, texels.
    """
    from baker.uv.kernels.uv_overlap import count_close, mark_charts

    owner = np.zeros((resolution, resolution), np.int32)
    mark_charts(np.ascontiguousarray(uv.uv) * resolution, uv.chart, owner)
    return int(count_close(owner, 1)), max(int(np.count_nonzero(owner)), 1)


@check(
    "uv.density",
    group="uv",
    severity="warning",
    fix="scale these charts to the size of the others",
)
def density(context: CheckContext) -> Iterator[RawFinding]:
    """Charts whose texels per metre differ from the object's median by a factor of more than four.

    The median is weighted by area. At the border between such a chart and another chart, a shadow changes
    from sharp to blurred.
    """
    for m, uv in laid_out(context):
        flat, real = uv.per_chart(np.abs(uv.signed_area)), uv.per_chart(uv.area)
        usable = (flat > 0) & (real > 0)
        if usable.sum() < 2:
            continue
        with np.errstate(divide="ignore", invalid="ignore"):
            per_metre = np.sqrt(flat / real)
        middle = _weighted_median(per_metre[usable], real[usable])
        ratio = np.where(usable, per_metre / middle, 1.0)
        odd = np.flatnonzero((ratio > DENSITY_FACTOR) | (ratio < 1.0 / DENSITY_FACTOR))
        if len(odd):
            worst = ratio[odd][np.argmax(np.abs(np.log(ratio[odd])))]
            faces = uv.faces[np.isin(uv.chart, odd)]
            some = "1 chart has" if len(odd) == 1 else f"{len(odd)} of {uv.n_charts} charts have"
            found = faces_found(
                context, m, faces, f"{some} up to {number(worst)} times the usual texels per metre"
            )
            yield replace(found, count=len(odd), percent=100.0 * float(real[odd].sum() / real.sum()))


def _weighted_median(value: NDArray[np.float64], weight: NDArray[np.float64]) -> float:
    order = np.argsort(value)
    total = np.cumsum(weight[order])
    return float(value[order[np.searchsorted(total, 0.5 * total[-1])]])


@check(
    "uv.stretch",
    group="uv",
    severity="warning",
    fix="cut these charts more often, or unwrap again",
)
def stretch(context: CheckContext) -> Iterator[RawFinding]:
    """A lightmap uv in which more than 5 % of the surface has a stretch above four.

    Stretch is the ratio of the larger to the smaller singular value of the map from surface to uv. Texels on
    stretched faces are strips: shadows look blurred along the strips and sharp across them.
    """
    for m, uv in laid_out(context):
        ratio = _anisotropy(uv)
        bad = ratio > STRETCH
        share = float(uv.area[bad].sum()) / max(float(uv.area.sum()), 1e-300)
        if share > MOST_STRETCHED:
            order = np.argsort(-uv.area[bad], kind="stable")
            text = (
                f"{{some}}, {number(100 * share)}% of the surface, stretched over {STRETCH:g} times one way"
            )
            yield replace(faces_found(context, m, uv.faces[bad][order], text), percent=100.0 * share)


def _anisotropy(uv: UvFacts) -> NDArray[np.float64]:
    """Return the stretch of each face, (F,) float64, see `stretch`; 1 for faces without uv area."""
    corner = uv.facts.corner[uv.rows]
    e1, e2 = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
    length = np.maximum(np.sqrt(np.einsum("fx,fx->f", e1, e1)), 1e-300)
    # Compute the corners' coordinates in the plane of the face: (0, 0), (length, 0), (x2, y2).
    x2 = np.einsum("fx,fx->f", e1, e2) / length
    y2 = 2.0 * uv.area / length
    d1, d2 = uv.uv[:, 1] - uv.uv[:, 0], uv.uv[:, 2] - uv.uv[:, 0]
    along = d1 / length[:, None]
    across = (d2 - along * x2[:, None]) / np.maximum(y2, 1e-300)[:, None]
    a, c = np.einsum("fx,fx->f", along, along), np.einsum("fx,fx->f", across, across)
    b = np.einsum("fx,fx->f", along, across)
    middle, half = 0.5 * (a + c), np.sqrt(0.25 * (a - c) ** 2 + b * b)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.sqrt((middle + half) / np.maximum(middle - half, 0.0))
    return np.asarray(np.where(uv.signed_area == 0, 1.0, np.nan_to_num(ratio, nan=1.0, posinf=1e9)))


@check(
    "uv.utilisation",
    group="uv",
    severity="info",
    fix="pack the charts closer, or unwrap again",
)
def utilisation(context: CheckContext) -> Iterator[RawFinding]:
    """A lightmap uv that fills less than 40 % of its bounding rectangle.

    The rest of the rectangle is unused memory.
    """
    for m, uv in laid_out(context):
        low, high = uv.uv.min(axis=(0, 1)), uv.uv.max(axis=(0, 1))
        rectangle = float(np.prod(high - low))
        filled = float(np.abs(uv.signed_area).sum())
        if rectangle > 0 and filled < LEAST_FILLED * rectangle:
            percent = 100.0 * filled / rectangle
            yield RawFinding(
                f"its TEXCOORD_1 fills {number(percent)}% of its rectangle",
                context.location(m),
                percent=percent,
            )


@check(
    "uv.palette",
    group="uv",
    severity="info",
    fix="nothing to do for a bake; never use TEXCOORD_0 as lightmap uv here",
)
def palette(context: CheckContext) -> Iterator[RawFinding]:
    """Objects whose TEXCOORD_0 only looks up the colours of a palette.

    Faces with more than 90 % of the surface are single points in this uv set, so it cannot be used as a
    lightmap uv. Some engines use TEXCOORD_0 for the lightmap if TEXCOORD_1 is missing. An object is reported
    if it has at least twice as many faces as different points in this uv set, rounded to 1/256.
    """
    for m, facts in enumerate(context.meshes):
        uv = UvFacts(facts, 0)
        if not len(uv.rows) or not uv.finite.all():
            continue
        # A face counts as a point if its uv area is less than one texel of a texture of 1024 x 1024.
        point = np.abs(uv.signed_area) * 1024.0**2 < 1.0
        share = float(uv.area[point].sum()) / max(float(uv.area.sum()), 1e-300)
        if share <= PALETTE_SHARE:
            continue
        # Round uv to multiples of 1/256. Combine u and v to one number, because sorting numbers is faster.
        step = np.clip(np.round(uv.uv[point].reshape(-1, 2) * 256.0), -(2.0**20), 2.0**20).astype(np.int64)
        colours = len(np.unique(step[:, 0] * 2**22 + step[:, 1]))
        if len(uv.rows) >= 2 * colours:
            text = f"its TEXCOORD_0 looks up {colours} colours for {number(100 * share)}% of the surface"
            yield RawFinding(text, context.location(m), int(point.sum()), percent=100.0 * share)
