# mypy: disable-error-code="no-untyped-def"
"""One step of the conjugate gradients that solve the radiosity equation, in one pass over memory per vector.

Based on: Saad, Iterative methods for sparse linear systems, 2003, algorithm 9.1.
"""

from __future__ import annotations

import numpy as np

from baker.trace.jit import kernel, larger, scratch

_three = scratch((3,), np.float64)


@kernel
def conjugate_step(product, albedo, weight, direction, exitance, rest, allowed, dark, active, size, worst):
    """Advance the solution of (I - rho F) x = rest by one step, for each colour of its own.

    product : (P, 3) float64, F direction; overwritten
    albedo, weight : (P, 3) float64, rho and A / rho
    direction, exitance, rest : (P, 3) float64, search direction, solution and residual; changed in place
    allowed : (P, 3) float64, residual allowed, as a share of exitance
    dark : (3,) float64, exitance that the residual is held against at least
    active : (3,) uint8, colours to advance; set to 0 where the direction has no curvature left
    size : (3,) float64, weighted squared norm of the residual; renewed
    worst : (3,) float64 output, largest residual as a share of what is allowed
    """
    n = len(rest)
    curvature, step, turn = _three(), _three(), _three()
    for i in range(n):
        for c in range(3):
            product[i, c] = direction[i, c] - albedo[i, c] * product[i, c]
            curvature[c] += weight[i, c] * direction[i, c] * product[i, c]
    for c in range(3):
        if not curvature[c] > 0.0:
            active[c] = 0
        if active[c] != 0:
            step[c] = size[c] / curvature[c]
            turn[c] = size[c]
            size[c] = worst[c] = 0.0
    for i in range(n):
        for c in range(3):
            if active[c] == 0:
                continue
            exitance[i, c] += step[c] * direction[i, c]
            rest[i, c] -= step[c] * product[i, c]
            size[c] += weight[i, c] * rest[i, c] * rest[i, c]
            light = allowed[i, c] * larger(exitance[i, c], dark[c])
            # Not as a quotient: both are 0 where no light is.
            if abs(rest[i, c]) > worst[c] * light:
                worst[c] = abs(rest[i, c]) / light
    for c in range(3):
        turn[c] = size[c] / turn[c] if active[c] != 0 else 0.0
    for i in range(n):
        for c in range(3):
            direction[i, c] = rest[i, c] + turn[c] * direction[i, c]
