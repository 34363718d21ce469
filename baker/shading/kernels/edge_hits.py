# mypy: disable-error-code="no-untyped-def"
"""Merges hits of a ray on an edge that triangles share, so that they are one crossing of the surface.

With Embree's ROBUST flag, no ray passes between two adjacent triangles. But if a ray meets the common edge of
two triangles up to rounding errors, Embree reports hits on both triangles. At a vertex, hits on all triangles
around the vertex are reported. Such hits are rare, so the edge hits of each ray are stored and compared with
later edge hits. Only hits on triangles of one connected surface (`kernels.alpha.SURFACE`) are merged, because
two different surfaces at the same position must be crossed separately.

Based on: Woop, Benthin and Wald, Watertight ray/triangle intersection, 2013.
"""

from __future__ import annotations

import numpy as np

from baker.trace.jit import inner
from baker.trace.packets import BLEND_EDGE_HITS, BLEND_EDGES, EDGE_HITS

# Limit of the smallest barycentric coordinate of a hit. Up to this limit, the hit is treated as lying on an
# edge. Embree accepts coordinates down to -1.2e-7, so a ray hits both triangles at an edge only within 1.2e-7
# of the edge.
EDGE = 1.0e-6
# Limit of the relative difference of the distances of two hits. Up to this limit, the hits are treated as the
# same crossing, because rounding may cause such a difference.
SAME = np.float32(4.0e-6)


@inner
def on_edge(b1, b2):
    """Return whether barycentrics (b1, b2) lie on an edge of a triangle."""
    return b1 <= EDGE or b2 <= EDGE or 1.0 - b1 - b2 <= EDGE


@inner
def crossed_before(context, words, number, surface, distance):
    """Return whether ray `number` has already hit an edge of the surface at this distance; store new hits.

    context, words : (CONTEXT_WORDS,) float32 and uint32 views of the same memory, see `packets`
    surface : float32, number of the surface (`kernels.alpha.SURFACE`)
    distance : float32, distance of the hit in units of the direction's length
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
