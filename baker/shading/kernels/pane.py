# mypy: disable-error-code="no-untyped-def"
"""Computes the colour of the light that passes a triangle which lets light through.

    alpha blending:  lerp(1, c, a)
    pane:            c (1 - F),   F = F0 + (1 - F0) (1 - cos)^5

A pane is a surface of KHR_materials_transmission; its alpha a is the share that it does not transmit. F is
the share that a smooth surface reflects; cos is the cosine of the angle between the ray and the normal of the
triangle.

Based on: Khronos Group, glTF 2.0 Specification, appendix B; Schlick, An inexpensive BRDF model, 1994.
"""

from __future__ import annotations

import math

import numpy as np

from baker.kernels.alpha import CUTOFF
from baker.kernels.transmittance import COLOUR, COLOUR_EDGE_1, COLOUR_EDGE_2, filter_colour_at
from baker.trace.jit import inner, larger, smaller
from baker.trace.packets import DIR_X

# Column CUTOFF of a pane is this number minus F0. It is -1 for alpha blending.
PANE = -2.0


@inner
def is_pane(row, k):
    """Return whether the triangle in row k of an `AlphaTable` or `TransmittanceTable` is a pane."""
    return row[k, CUTOFF] <= np.float32(PANE)


@inner
def passed_colour_at(row, k, pack, b1, b2, cosine, rgba, out):
    """Write the colour of the light that passes the triangle in row k at barycentrics (b1, b2); return alpha.

    row : (K, 21) float32, see `TransmittanceTable`; pack : TexturePack
    cosine : cosine between ray and normal, 0 to 1
    rgba : (4,) float64, working memory; out : (3,) float32 output
    """
    alpha = filter_colour_at(row, k, pack, b1, b2, rgba, out)
    if is_pane(row, k):
        low = PANE - np.float64(row[k, CUTOFF])
        off = 1.0 - smaller(cosine, 1.0)
        share = (1.0 - low) * (1.0 - off * off * off * off * off)
        for c in range(3):
            colour = np.float64(row[k, COLOUR + c])
            colour += b1 * row[k, COLOUR_EDGE_1 + c] + b2 * row[k, COLOUR_EDGE_2 + c]
            out[c] = share * smaller(larger(colour * rgba[c], 0.0), 1.0)
    return alpha


@inner
def cosine_of(ray, hit, n, lane):
    """Return the absolute cosine between a ray and the normal of the triangle that it hits.

    ray, hit : (12 * n,) and (6 * n,) float32, arrays that Embree passes to a filter; n : packet width
    """
    dot = normal = direction = 0.0
    for axis in range(3):
        a, b = np.float64(hit[axis * n + lane]), np.float64(ray[(DIR_X + axis) * n + lane])
        dot += a * b
        normal += a * a
        direction += b * b
    length = math.sqrt(normal * direction)
    return abs(dot) / length if length > 0.0 else 1.0
