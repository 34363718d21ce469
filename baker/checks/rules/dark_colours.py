"""Reports vertex colours that take away most of the base colour of a material."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from baker.checks.context import CheckContext
from baker.checks.finding import RawFinding
from baker.checks.rule import check
from baker.checks.rules.vertex_colours import BLACK, COLOURED
from baker.core.readable import percent

# Mean of the vertex colours below which they count as dark. Base colour factor from which a material without
# a texture counts as white; vertex colours are then the colour of the surface.
DARK, WHITE = 0.3, 0.9


@check(
    "dark-colours",
    group="light",
    severity="warning",
    fix="take COLOR_0 off the mesh if it has AO, masks or other data; keep it if the surface is dark",
)
def dark_colours(context: CheckContext) -> Iterator[RawFinding]:
    """Vertex colours that take away more than 70 % of the base colour of a coloured material.

    glTF multiplies the base colour by COLOR_0. If the material has a texture or a colour already, dark vertex
    colours usually are ambient occlusion or data for the shader of an engine. The surface then reflects too
    little light. Vertex colours on a white material without a texture are not reported, and black ones have
    the code `black-colours`.
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
