"""Reports vertex colours that make a material black."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from baker.checks.context import CheckContext
from baker.checks.finding import RawFinding
from baker.checks.rule import check

# BLACK: vertex colours count as black if all components of all vertices are below this number.
# COLOURED: a material counts as black if all components of its base colour factor are below this number.
BLACK, COLOURED = 0.01, 0.05


@check(
    "black-colours",
    group="light",
    severity="warning",
    fix="take COLOR_0 off the mesh, or paint it white where the material is to be seen as it is",
)
def black_colours(context: CheckContext) -> Iterator[RawFinding]:
    """A primitive whose vertex colours are all black although its material is not.

    The base colour is multiplied by the vertex colour (COLOR_0 in glTF), so such a surface reflects less than
    1 % of the light. Usually the vertex colours were never painted, or contain data for the shader of an
    engine, such as wind or wetness. Only vertices that faces use are tested.
    """
    for m, facts in enumerate(context.meshes):
        for k, primitive in enumerate(facts.source.primitives):
            if primitive.colour is None:
                continue
            faces = facts.good[facts.primitive[facts.good] == k]
            material = context.scene.materials[primitive.material]
            if not len(faces) or max(material.base_colour[:3]) < COLOURED:
                continue
            used = np.unique(facts.triangle[faces]) - facts.vertex_start[k]
            if np.nan_to_num(primitive.colour[used, :3], nan=1.0).max() < BLACK:
                text = (
                    "the vertex colours (COLOR_0) are black all over and take away the base colour of "
                    f"material '{material.name}'"
                )
                yield RawFinding(text, context.location(m), len(faces), primitive=primitive.index)
