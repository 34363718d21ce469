# mypy: disable-error-code="no-untyped-def"
"""Merges the hits of a ray on an edge that triangles share: the ray crosses their surface once.

With Embree's ROBUST test no ray passes between two triangles, but both are reported where a ray meets
their edge to within rounding, and all triangles around a vertex. Hits on edges are rare, so those of each ray
are stored, and later ones are compared with them. Two surfaces at the same position are two crossings: only
triangles of one connected surface (`alpha.SURFACE`) are merged.

Based on: Woop, Benthin and Wald, Watertight ray/triangle intersection, 2013.
"""

from __future__ import annotations

import numpy as np

from baker.trace.jit import inner
from baker.trace.packets import BLEND_EDGE_HITS, BLEND_EDGES, EDGE_HITS

# A hit lies on an edge if a barycentric coordinate is at most this. Embree accepts coordinates down to minus
# 1.2e-7, and two triangles of one edge are both hit only within that.
EDGE = 1.0e-6
# Rounding changes the distance of a crossing by at most this share.
SAME = np.float32(4.0e-6)


@inner
def on_edge(b1, b2):
    """Return whether barycentrics (b1, b2) lie on an edge of a triangle."""
    return b1 <= EDGE or b2 <= EDGE or 1.0 - b1 - b2 <= EDGE


@inner
def crossed_before(context, words, number, surface, distance):
    """Return whether ray `number` has hit an edge of the surface at the same distance; store this hit if not.

    context, words : (CONTEXT_WORDS,) float32 and uint32, one memory, see `packets`
    surface : float32, `alpha.SURFACE`; distance : float32, in units of the direction's length
    """
    first = BLEND_EDGE_HITS + number * (2 * EDGE_HITS)
    count = np.int64(words[BLEND_EDGES + number])
    for k in range(count if count < EDGE_HITS else EDGE_HITS):
        near = abs(context[first + 2 * k] - distance) <= SAME * distance
        if near and context[first + 2 * k + 1] == surface:
            return True
    at = first + 2 * (count % EDGE_HITS)
    context[at], context[at + 1] = distance, surface
    words[BLEND_EDGES + number] = np.uint32(count + 1)
    return False
