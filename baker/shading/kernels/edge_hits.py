# mypy: disable-error-code="no-untyped-def"
"""Hits on edges that triangles of one surface share: a ray through such an edge crosses the surface once.

Embree's ROBUST test never lets a ray slip between two triangles. In turn it may report both of them where a
ray meets their edge to within rounding, and all triangles around a vertex. Hits on edges are rare, so those
of each ray are remembered, and the next ones are compared with them. Two surfaces at the same place are two
crossings: only triangles of one connected surface (`alpha.SURFACE`) are taken for one.

Based on: Woop, Benthin and Wald, Watertight ray/triangle intersection, 2013.
"""

from __future__ import annotations

import numpy as np

from baker.trace.jit import inner
from baker.trace.packets import BLEND_EDGE_HITS, BLEND_EDGES, EDGE_HITS

# A hit lies on an edge if a barycentric coordinate is at most this. Embree accepts coordinates down to minus
# 1.2e-7, and two triangles of one edge are both met only within that.
EDGE = 1.0e-6
# Distances of one crossing differ by at most this share, by rounding.
SAME = np.float32(4.0e-6)


@inner
def on_edge(b1, b2):
    """Tell whether barycentric coordinates lie on an edge of a triangle."""
    return b1 <= EDGE or b2 <= EDGE or 1.0 - b1 - b2 <= EDGE


@inner
def crossed_before(context, words, number, surface, distance):
    """Tell whether ray `number` met an edge of the same surface at the same distance; if not, remember it.

    context, words : what the filter function finds behind the query's context, as float32 and uint32
    surface : float32, `alpha.SURFACE`; distance : float32, in units of the ray's direction
    """
    first = BLEND_EDGE_HITS + number * (2 * EDGE_HITS)
    count = np.int64(words[BLEND_EDGES + number])
    for k in range(count if count < EDGE_HITS else EDGE_HITS):
        near = abs(context[first + 2 * k] - distance) <= SAME * distance
        if near and context[first + 2 * k + 1] == surface:
            return True
    place = first + 2 * (count % EDGE_HITS)
    context[place], context[place + 1] = distance, surface
    words[BLEND_EDGES + number] = np.uint32(count + 1)
    return False
