"""The radiosity solve: what all bounces add to the light that arrives at each patch.

    E = F (s + rho E)        s: exitance of the first reflection, rho: albedo, for three colours at once

Gauss-Seidel sweeps until the relative change is small, or N Jacobi steps for N bounces.
Based on: Goral et al., 1984; Cohen and Wallace, 1993, ch. 5.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baker.core.progress import Progress, report
from baker.kernels.form_factor import gauss_seidel_step, jacobi_step
from baker.radiosity.form_factors import FormFactorMatrix

STAGE = "solve"
TOLERANCE = 1e-5
MAX_SWEEPS = 2000


@dataclass(frozen=True)
class Solution:
    """Light of all bounces at patches.

    Attributes
    ----------
    irradiance : (P, 3) float64, lx, indirect: at least once reflected
    iterations : int
    residual : float, |E - F (s + rho E)| / |E|
    """

    irradiance: NDArray[np.float64]
    iterations: int
    residual: float


def solve_radiosity(
    matrix: FormFactorMatrix,
    source: NDArray[np.float64],
    albedo: NDArray[np.float64],
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
    bounces : int or None
        Number of reflections; None means until converged. The final gather adds one more bounce from
        these values, so N bounces need N - 1 steps here.
    """
    report(progress, STAGE, 0.0)
    source = np.ascontiguousarray(source)
    albedo = np.ascontiguousarray(np.minimum(albedo, 0.999))
    irradiance = np.zeros_like(source)
    exitance = source.copy()
    arrays = (matrix.first, matrix.column, matrix.value)
    iterations = 0
    if bounces is not None:
        for iterations in range(1, max(bounces - 1, 0) + 1):  # noqa: B007 - the count is reported
            jacobi_step(*arrays, source, exitance, albedo, irradiance)
            report(progress, STAGE, iterations / bounces)
        return Solution(irradiance, iterations, 0.0)
    residual = 0.0
    for iterations in range(1, MAX_SWEEPS + 1):  # noqa: B007 - the count is reported
        change, size = gauss_seidel_step(*arrays, albedo, exitance, irradiance)
        residual = float(np.sqrt(change / size)) if size > 0 else 0.0
        report(progress, STAGE, min(iterations / 50, 0.99), f"residual {residual:.1e}")
        if residual < TOLERANCE:
            break
    return Solution(irradiance, iterations, residual)


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
        included; escaped: reflected out of the scene. emitted = absorbed + escaped up to the
        solver's residual and the balance of the matrix's rows.
    """
    flux = area[:, None] / 3.0
    leaving = reflected + albedo * indirect
    escaped = float((flux * leaving * matrix.sky[:, None]).sum())
    backs = float((flux * leaving * matrix.lost[:, None]).sum())
    absorbed = float((flux * (direct + indirect - leaving)).sum()) + backs
    return {"emitted": float((flux * direct).sum()), "absorbed": absorbed, "escaped": escaped}
