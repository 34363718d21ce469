"""The radiosity solve: what all bounces add to the light that arrives at each patch.

    E = F (s + rho E)        s: exitance of the first reflection, rho: albedo, for three colours at once

With M = s + rho E this is (A / rho - A F) M = A s / rho, symmetric by reciprocity and positive definite
for rho < 1: conjugate gradients, preconditioned by A / rho, need a few dozen products even where
simple sweeps need thousands (a closed room of albedo 0.99). N bounces are N products instead.

Based on: Goral et al., Modeling the interaction of light between diffuse surfaces, 1984; Neumann,
New efficient algorithms with positive definite radiosity matrix, 1994; Saad, Iterative methods for
sparse linear systems, 2003, algorithm 9.1.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baker.core.progress import Progress, report
from baker.kernels.form_factor import multiply, multiply_coloured
from baker.radiosity.form_factors import FormFactorMatrix

STAGE = "solve"
TOLERANCE = 1e-5
MAX_ITERATIONS = 1000
# A closed room of albedo 1 has no solution: light would never end.
MAX_ALBEDO = 0.999
# Black patches get this albedo in the symmetric form, which divides by it.
MIN_ALBEDO = 1e-4


@dataclass(frozen=True)
class Solution:
    """Light of all bounces at patches.

    Attributes
    ----------
    irradiance : (P, 3) float64, lx, indirect: at least once reflected
    iterations : int
    residual : float, |s + rho F M - M| / |s|, the worst of the three colours
    """

    irradiance: NDArray[np.float64]
    iterations: int
    residual: float


def solve_radiosity(
    matrix: FormFactorMatrix,
    source: NDArray[np.float64],
    albedo: NDArray[np.float64],
    area: NDArray[np.float64],
    *,
    bounces: int | None,
    progress: Progress,
) -> Solution:
    """Solve for the reflected irradiance of patches.

    Parameters
    ----------
    source : (P, 3) float64, lx
        Light that patches reflect of what reached them directly.
    albedo : (P, 3) float64
    area : (P,) float64, m2
    bounces : int or None
        Number of reflections; None means until converged. The final gather adds one more bounce from
        these values, so N bounces need N - 1 products here.
    """
    report(progress, STAGE, 0.0)
    albedo = np.clip(albedo, MIN_ALBEDO, MAX_ALBEDO)
    if bounces is not None:
        irradiance = np.zeros_like(source)
        steps = max(bounces - 1, 0)
        for step in range(steps):
            irradiance = apply(matrix, source + albedo * irradiance)
            report(progress, STAGE, (step + 1) / steps)
        return Solution(irradiance, steps, 0.0)
    exitance, iterations = _conjugate_gradients(matrix, source, albedo, area[:, None], progress)
    irradiance = apply(matrix, exitance)
    remainder = source + albedo * irradiance - exitance
    norms = np.linalg.norm(source, axis=0)
    lit = norms > 0
    residual = float((np.linalg.norm(remainder, axis=0)[lit] / norms[lit]).max(initial=0.0))
    return Solution(irradiance, iterations, residual)


def apply(matrix: FormFactorMatrix, exitance: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return F exitance, (P, 3) float64: the irradiance that patches of that exitance give each other."""
    irradiance = np.zeros_like(exitance)
    rows, exitance = (matrix.first, matrix.column, matrix.value), np.ascontiguousarray(exitance)
    if matrix.tint is None:
        multiply(*rows, exitance, irradiance)
    else:
        multiply_coloured(*rows, matrix.tint, exitance, irradiance)
    return irradiance


def _conjugate_gradients(
    matrix: FormFactorMatrix,
    source: NDArray[np.float64],
    albedo: NDArray[np.float64],
    area: NDArray[np.float64],
    progress: Progress,
) -> tuple[NDArray[np.float64], int]:
    """Solve (A / rho - A F) M = A s / rho for three colours at once; return M and the iterations."""
    diagonal = area / albedo
    exitance = source.copy()
    # The first guess M = s leaves the residual A F s.
    rest = area * apply(matrix, source)
    goal = TOLERANCE * np.sqrt((area * source * source / albedo).sum(axis=0))
    scaled = rest / diagonal
    direction = scaled.copy()
    size = (rest * scaled).sum(axis=0)
    for iteration in range(MAX_ITERATIONS):
        if (np.sqrt(size) <= goal).all():
            return exitance, iteration
        report(progress, STAGE, min(iteration / 50, 0.99))
        image = diagonal * direction - area * apply(matrix, direction)
        curvature = (direction * image).sum(axis=0)
        step = np.where(curvature > 0, size / np.where(curvature > 0, curvature, 1.0), 0.0)
        exitance += step * direction
        rest -= step * image
        scaled = rest / diagonal
        before, size = size, (rest * scaled).sum(axis=0)
        direction = scaled + np.where(before > 0, size / np.where(before > 0, before, 1.0), 0.0) * direction
    return exitance, MAX_ITERATIONS


def energy_audit(
    matrix: FormFactorMatrix,
    area: NDArray[np.float64],
    direct: NDArray[np.float64],
    reflected: NDArray[np.float64],
    indirect: NDArray[np.float64],
    albedo: NDArray[np.float64],
) -> dict[str, float]:
    """Return the flux (lm, summed over RGB / 3) that lights bring to surfaces, and where it ends.

    Parameters
    ----------
    direct, reflected : (P, 3), lx, direct irradiance of patches and what they reflect of it
    indirect : (P, 3), lx

    Returns
    -------
    dict
        emitted: arriving at surfaces straight from lights; absorbed: by surfaces, black backs
        and panes included; escaped: reflected out of the scene. emitted = absorbed + escaped up to the
        solver's residual and the balance of the matrix's rows.
    """
    flux = area[:, None] / 3.0
    leaving = reflected + albedo * indirect
    escaped = float((flux * leaving * matrix.open).sum())
    lost = matrix.lost[:, None] + (matrix.sky[:, None] - matrix.open)
    if matrix.tint is not None:
        # Light that a coloured surface took out is in no patch's irradiance.
        lost = lost + matrix.row_sums()[:, None] - apply(matrix, np.ones_like(leaving))
    backs = float((flux * leaving * lost).sum())
    absorbed = float((flux * (direct + indirect - leaving)).sum()) + backs
    return {"emitted": float((flux * direct).sum()), "absorbed": absorbed, "escaped": escaped}
