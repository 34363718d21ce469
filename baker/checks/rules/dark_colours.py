"""Reports vertex colours that darken the base colour of a material to less than 30 %."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from baker.checks.context import CheckContext
from baker.checks.finding import RawFinding
from baker.checks.rule import check
from baker.checks.rules.vertex_colours import BLACK, COLOURED
from baker.core.readable import percent

# DARK: mean vertex colour, over R, G and B and over the surface, below which the colours count as dark.
# WHITE: smallest component of the base colour factor from which on a material without a texture counts as
# white. The vertex colours are then the colour of the surface.
DARK, WHITE = 0.3, 0.9


@check(
    "dark-colours",
    group="light",
    severity="warning",
    fix="take COLOR_0 off the mesh if it has AO, masks or other data; keep it if the surface is dark",
)
def dark_colours(context: CheckContext) -> Iterator[RawFinding]:
    """Vertex colours that take away more than 70 % of the base colour of a material.

    The base colour is multiplied by the vertex colour (COLOR_0 in glTF). If the material already has a
    texture or a colour, dark vertex colours usually are ambient occlusion or data for the shader of an
    engine. The surface then reflects too little light. The mean of the vertex colours over the surface is
    tested. Vertex colours on a white material without a texture are not reported. The rule `black-colours`
    reports vertex colours that are black everywhere.
    """
    for m, facts in enumerate(context.meshes):
        for k, primitive in enumerate(facts.source.primitives):
            material = context.scene.materials[primitive.material]
            base = material.base_colour[:3]
            white = material.base_colour_texture is None and min(base) >= WHITE
            rows = np.flatnonzero(facts.primitive[facts.good] == k) if primitive.colour is not None else ()
            if primitive.colour is None or not len(rows) or white or max(base) < COLOURED:
                continue
            corner = facts.triangle[facts.good[rows]] - facts.vertex_start[k]
            colour = np.clip(np.nan_to_num(primitive.colour[corner, :3], nan=1.0), 0.0, 1.0)
            mean = float(np.average(colour.mean(axis=(1, 2)), weights=facts.area[rows]))
            if mean < DARK and colour.max() >= BLACK:
                name = f"material '{material.name}'" if material.name else "the default material"
                text = f"the vertex colours (COLOR_0) take {percent(1.0 - mean)} of the base colour of {name}"
                yield RawFinding(
                    text,
                    context.location(m),
                    len(rows),
                    percent=100.0 * (1.0 - mean),
                    primitive=primitive.index,
                )
