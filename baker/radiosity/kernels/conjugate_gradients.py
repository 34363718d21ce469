# mypy: disable-error-code="no-untyped-def"
"""Computes one step of conjugate gradients for `radiosity.solve`, for three colours at once.

Based on: Saad, Iterative methods for sparse linear systems, 2003, algorithm 9.1.
"""

from __future__ import annotations

import numpy as np

from baker.trace.jit import kernel, larger, scratch

_three = scratch((3,), np.float64)


@kernel
def conjugate_step(
    product, albedo, weight, direction, exitance, residual, allowed, dark, active, size, worst
):
    """Advance the solution x of (I - rho F) x = b by one step, for each colour separately.

    product : (P, 3) float64, F times `direction`; overwritten
    albedo : (P, 3) float64, rho
    weight : (P, 3) float64, A / rho, the weight of the scalar product; A is the patch area
    direction : (P, 3) float64, search direction; updated
    exitance : (P, 3) float64, x, the solution; updated
    residual : (P, 3) float64, b - (I - rho F) x; updated
    allowed : (P, 3) float64, allowed residual, as a share of max(exitance, `dark`)
    dark : (3,) float64, lx
    active : (3,) uint8, 1 for colours to advance; set to 0 if the curvature along `direction` is not positive
    size : (3,) float64, weighted squared norm of the residual; updated
    worst : (3,) float64 output, largest ratio of residual to allowed residual over all patches
    """
    n = len(residual)
    curvature, step, ratio = _three(), _three(), _three()
    # Apply I - rho F to the direction, and compute the step length.
    for i in range(n):
        for c in range(3):
            product[i, c] = direction[i, c] - albedo[i, c] * product[i, c]
            curvature[c] += weight[i, c] * direction[i, c] * product[i, c]
    for c in range(3):
        if not curvature[c] > 0.0:
            active[c] = 0
        if active[c] != 0:
            step[c] = size[c] / curvature[c]
            ratio[c] = size[c]
            size[c] = worst[c] = 0.0
    # Advance solution and residual, and find the largest residual.
    for i in range(n):
        for c in range(3):
            if active[c] == 0:
                continue
            exitance[i, c] += step[c] * direction[i, c]
            residual[i, c] -= step[c] * product[i, c]
            size[c] += weight[i, c] * residual[i, c] * residual[i, c]
            light = allowed[i, c] * larger(exitance[i, c], dark[c])
            # Compare products, because a quotient would be 0 / 0 without light.
            if abs(residual[i, c]) > worst[c] * light:
                worst[c] = abs(residual[i, c]) / light
    # Choose the next direction.
    for c in range(3):
        ratio[c] = size[c] / ratio[c] if active[c] != 0 else 0.0
    for i in range(n):
        for c in range(3):
            direction[i, c] = residual[i, c] + ratio[c] * direction[i, c]
