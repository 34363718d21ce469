"""Reports meshes whose lightmap uv overlap each other on one page."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from baker.checks.context import CheckContext
from baker.checks.finding import RawFinding
from baker.checks.rule import check
from baker.checks.rules.uv_layout import laid_out
from baker.uv.check import EDGE_SLACK, PAGE_TOLERANCE

# Number of rows and columns of the grid on which overlaps are searched.
_SIDE = 512


@check(
    "uv.shared",
    group="uv",
    severity="info",
    fix="nothing to do for a bake, which packs these objects again; lay them out together to keep their uv",
)
def shared(context: CheckContext) -> Iterator[RawFinding]:
    """Objects whose TEXCOORD_1 overlaps that of another object.

    The lightmap uv of each object is valid alone, but together they do not fit on one page. An example is
    a kit in which the uv of each object fills 0..1. A bake then packs the layouts of the objects as
    rectangles, and writes their positions to `bake.json` as `uv_scale` and `uv_offset`. Overlaps are searched
    on a grid of 512 x 512 points. Instances of the same mesh are not compared.
    """
    from baker.checks.kernels.uv_pairs import cover_pairs

    taken = np.full((_SIDE, _SIDE), -1, np.int32)
    clash: set[int] = set()
    first: tuple[int, int] | None = None
    for m, uv in laid_out(context):
        owner = np.zeros((_SIDE, _SIDE), np.int32)
        corner = np.ascontiguousarray(uv.uv) * _SIDE
        cover_pairs(corner, EDGE_SLACK, owner, np.zeros((0, 2), np.int64), np.zeros(4, np.int64))
        mine = owner > 0
        before = taken[mine]
        met = before[before >= 0]
        if len(met) > max(2, PAGE_TOLERANCE * len(before)):
            clash.update([m, *(int(k) for k in np.unique(met))])
            first = first or (int(met[0]), m)
        taken[mine] = m
    if first is not None:
        one, two = (context.location(m) for m in first)
        text = f"the TEXCOORD_1 of {len(clash)} meshes overlap, as those of '{one.object}' and '{two.object}'"
        yield RawFinding(text, one, len(clash))
