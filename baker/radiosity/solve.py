"""Solves for the irradiance E of each patch from light that was reflected at least once, for R, G and B.

    E = F (s + rho E)        F: form factors, s: direct light that patches reflect, rho: albedo

With the exitance M = s + rho E, which is the radiosity without emission, and the patch areas A, this becomes

    (A / rho - A F) M = A s / rho

The matrix A / rho - A F is symmetric by reciprocity, and positive definite for rho < 1. Conjugate gradients,
preconditioned by A / rho, need a few dozen products with F. Jacobi iteration would need thousands of products
in a closed scene of albedo 0.99. If the number of bounces is fixed, one product is computed for each bounce
after the first.

The norms of conjugate gradients are sums over all patches. Patches of a dim room beside a sunlit street
contribute almost nothing to these sums, so the iteration could stop before these patches have converged.
Therefore the residual of each patch and colour is compared with the exitance of that patch. Conjugate
gradients are then started again for the residual of the patches that have not converged.

Based on: Goral et al., Modeling the interaction of light between diffuse surfaces, 1984; Neumann,
New efficient algorithms with positive definite radiosity matrix, 1994; Saad, Iterative methods for
sparse linear systems, 2003, algorithm 9.1; Higham, Accuracy and stability of numerical algorithms, 2002,
chapter 12 (iterative refinement).
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from baker.core.progress import Progress, report
from baker.core.readable import number
from baker.core.scene import SceneWarning
from baker.core.stage import Stage
from baker.radiosity.form_factors import FormFactorMatrix
from baker.radiosity.kernels.conjugate_gradients import conjugate_step
from baker.radiosity.kernels.form_factor import multiply, multiply_coloured

# Largest relative error of the exitance of a converged patch, as estimated from its residual.
TOLERANCE = 3e-5
# Largest total number of iterations of conjugate gradients.
MAX_ITERATIONS = 1000
# Number of stored matrix elements for each thread beyond the first.
_PART = 250_000
# Lower limit of the exitance with which a patch's residual is compared, as a share of the largest source
# exitance of the same colour. Because of this limit, nearly black patches do not delay the solve.
_DARK = 1e-15
# Share of its initial value to which conjugate gradients reduce the residual norm of a colour. They are then
# started again, because the search directions have lost orthogonality, and the updated residual differs from
# the true residual.
_REDUCTION = 1e-12
# Upper limit of albedo: with albedo 1, a closed scene has no solution.
MAX_ALBEDO = 0.999
# Lower limit of albedo: the symmetric form divides by albedo.
MIN_ALBEDO = 1e-4


@dataclass(frozen=True)
class Solution:
    """Indirect irradiance of P patches, and the error of the solve.

    Attributes
    ----------
    irradiance : (P, 3) float64, lx
        RGB of light that was reflected at least once.
    iterations : int
        Number of iterations of conjugate gradients; with a fixed number of bounces, of products with the
        matrix.
    residual : float
        |s + rho F M - M| / |s|, with Euclidean norms over the patches; the largest of the three colours. It
        is 0 for a fixed number of bounces.
    patch_error : float
        Largest |s + rho F M - M| / ((1 - rho) max(M, dark)) of all patches and colours, with `dark` of
        `_Goal`. It is an estimate of the largest relative error of a patch's exitance M. In a closed scene of
        uniform light and albedo, it is an upper bound of that error. It is 0 for a fixed number of bounces.
    """

    irradiance: NDArray[np.float64]
    iterations: int
    residual: float
    patch_error: float

    def figures(self) -> dict[str, float]:
        """Return iterations and errors by name, for `bake.json`."""
        return {
            "iterations": self.iterations,
            "residual": self.residual,
            "patch_error": self.patch_error,
        }


def solve_radiosity(
    matrix: FormFactorMatrix,
    source: NDArray[np.float64],
    albedo: NDArray[np.float64],
    area: NDArray[np.float64],
    *,
    bounces: int | None,
    progress: Progress,
    threads: int = 1,
) -> Solution:
    """Solve for the reflected irradiance of patches.

    Parameters
    ----------
    matrix : FormFactorMatrix
        F of P patches.
    source : (P, 3) float64, lx
        s, the direct light that patches reflect.
    albedo : (P, 3) float64
        0 to 1; clipped to `MIN_ALBEDO` and `MAX_ALBEDO`.
    area : (P,) float64, m2
        Areas of the patches.
    bounces : int or None
        Number of reflections; None means until converged. The final gather adds the last bounce, so N bounces
        need N - 1 products here.
    progress : Progress
        Called at the start and for each iteration.
    threads : int
        Largest number of threads for products. Each matrix row is summed by one thread, so the result does
        not depend on the number.

    Returns
    -------
    Solution
        Not converged if `patch_error` is above `TOLERANCE`.
    """
    report(progress, Stage.SOLVE, 0.0)
    albedo = np.clip(albedo, MIN_ALBEDO, MAX_ALBEDO)
    if bounces is not None:
        irradiance = np.zeros_like(source)
        steps = max(bounces - 1, 0)
        with _Product(matrix, threads) as product:
            for step in range(steps):
                irradiance = product(source + albedo * irradiance)
                report(progress, Stage.SOLVE, (step + 1) / steps)
        return Solution(irradiance, steps, 0.0, 0.0)
    with _Product(matrix, threads) as product:
        return _converge(product, source, albedo, area[:, None], progress)


def _converge(
    product: _Product,
    source: NDArray[np.float64],
    albedo: NDArray[np.float64],
    area: NDArray[np.float64],
    progress: Progress,
) -> Solution:
    """Repeat conjugate gradients until every patch has converged; see `solve_radiosity`.

    source, albedo : (P, 3) float64; area : (P, 1) float64, m2
    """
    exitance = source.copy()
    goal = _Goal(TOLERANCE * (1.0 - albedo), _DARK * source.max(axis=0, initial=0.0))
    iterations = 0
    while True:
        irradiance = product(exitance)
        rest = source + albedo * irradiance - exitance
        share = goal.share(rest, exitance)
        if (share <= 1.0).all() or iterations >= MAX_ITERATIONS:
            break
        # Set residuals that are far below their limits to 0. The rounding errors of such bright patches would
        # exceed the residuals of dim patches.
        rest[share <= goal.MARGIN] = 0.0
        before = iterations
        iterations = _conjugate_gradients(product, exitance, rest, albedo, area, goal, progress, before)
        if iterations == before:
            break
    norms = np.linalg.norm(source, axis=0)
    lit = norms > 0
    remainder = np.linalg.norm(source + albedo * irradiance - exitance, axis=0)
    residual = float((remainder[lit] / norms[lit]).max(initial=0.0))
    return Solution(irradiance, iterations, residual, TOLERANCE * float(share.max(initial=0.0)))


def solve_warnings(solution: Solution) -> list[SceneWarning]:
    """Return a warning if the solve ended before every patch converged."""
    if solution.patch_error <= TOLERANCE:
        return []
    message = (
        f"bounced light is exact to {number(100 * solution.patch_error)} % only: the solve ended after"
        f" {solution.iterations} iterations; lower base colours near 1 in closed rooms, or set `bounces`"
    )
    return [SceneWarning("solve-not-converged", message)]


def apply(matrix: FormFactorMatrix, exitance: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the product of F and `exitance`, (P, 3) float64: the irradiance that the exitance causes."""
    with _Product(matrix, 1) as product:
        return product(exitance)


class _Product:
    """Multiplies the form-factor matrix F by vectors, on a pool of threads.

    Parameters
    ----------
    matrix : FormFactorMatrix
        F of P patches.
    threads : int
        Largest number of threads. Each matrix row is summed by one thread, so the result does not depend on
        the number.
    """

    def __init__(self, matrix: FormFactorMatrix, threads: int) -> None:
        self._matrix = matrix
        parts = min(threads, 1 + len(matrix.value) // _PART)
        inner = np.searchsorted(matrix.first, len(matrix.value) * np.arange(1, parts) / parts)
        self._cut = np.concatenate([[0], inner, [len(matrix.first) - 1]])
        self._pool = ThreadPoolExecutor(parts) if parts > 1 else None

    def __enter__(self) -> _Product:
        return self

    def __exit__(self, *_: object) -> None:
        if self._pool is not None:
            self._pool.shutdown()

    def __call__(self, exitance: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the product of F and `exitance`; both are (P, 3) float64."""
        matrix, irradiance = self._matrix, np.zeros_like(exitance)
        exitance = np.ascontiguousarray(exitance)

        def rows(begin: int, end: int) -> None:
            first, out = matrix.first[begin : end + 1], irradiance[begin:end]
            if matrix.transmittance is None:
                multiply(first, matrix.column, matrix.value, exitance, out)
            else:
                multiply_coloured(first, matrix.column, matrix.value, matrix.transmittance, exitance, out)

        if self._pool is None:
            rows(0, len(exitance))
        else:
            list(self._pool.map(rows, self._cut[:-1], self._cut[1:]))
        return irradiance


@dataclass(frozen=True)
class _Goal:
    """Allowed residual of each patch and colour.

    Attributes
    ----------
    tolerance : (P, 3) float64, allowed residual as a share of max(exitance, `dark`)
    dark : (3,) float64, lx, lower limit of the exitance of each colour, see `_DARK`
    """

    # Limit of the residual as a share of the allowed residual. Conjugate gradients stop for a colour if no
    # patch exceeds this limit.
    MARGIN: ClassVar[float] = 0.5
    tolerance: NDArray[np.float64]
    dark: NDArray[np.float64]

    def share(self, rest: NDArray[np.float64], exitance: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return (P, 3) float64: the residual `rest` divided by the allowed residual; 0 where `rest` is 0."""
        allowed = self.tolerance * np.maximum(exitance, self.dark)
        return np.divide(np.abs(rest), allowed, out=np.zeros_like(rest), where=rest != 0.0)


def _conjugate_gradients(
    product: Callable[[NDArray[np.float64]], NDArray[np.float64]],
    exitance: NDArray[np.float64],
    rest: NDArray[np.float64],
    albedo: NDArray[np.float64],
    area: NDArray[np.float64],
    goal: _Goal,
    progress: Progress,
    iteration: int,
) -> int:
    """Add the approximate solution x of (I - rho F) x = rest to `exitance`; return the new iteration count.

    I - rho F is symmetric in the scalar product weighted by A / rho.

    product : multiplies F by a (P, 3) array
    exitance, rest : (P, 3) float64, lx, M and its residual; changed in place
    albedo : (P, 3) float64; area : (P, 1) float64, m2
    iteration : int, number of iterations so far
    """
    weight = area / albedo
    direction = rest.copy()
    size = (weight * rest * rest).sum(axis=0)
    enough = _REDUCTION**2 * size
    worst = goal.share(rest, exitance).max(axis=0, initial=0.0)
    active = np.ones(3, np.uint8)
    while iteration < MAX_ITERATIONS:
        report(progress, Stage.SOLVE, min(iteration / 50, 0.99))
        active[(worst <= goal.MARGIN) | (size <= enough)] = 0
        if not active.any():
            break
        image = product(direction)
        conjugate_step(
            image, albedo, weight, direction, exitance, rest, goal.tolerance, goal.dark, active, size, worst
        )
        iteration += 1
    return iteration


def energy_audit(
    matrix: FormFactorMatrix,
    area: NDArray[np.float64],
    direct: NDArray[np.float64],
    reflected: NDArray[np.float64],
    indirect: NDArray[np.float64],
    albedo: NDArray[np.float64],
) -> dict[str, float]:
    """Return the luminous flux from lights to surfaces, the absorbed flux and the escaped flux.

    Parameters
    ----------
    matrix : FormFactorMatrix
        F of P patches.
    area : (P,) float64, m2
        Areas of the patches.
    direct : (P, 3) float64, lx
        Direct irradiance of the patches.
    reflected : (P, 3) float64, lx
        Part of the direct irradiance that the patches reflect.
    indirect : (P, 3) float64, lx
        Irradiance of the patches by light that was reflected at least once.
    albedo : (P, 3) float64
        0 to 1.

    Returns
    -------
    dict of str to float
        Fluxes in lm, means of R, G and B. `emitted` arrives at surfaces directly from lights. `absorbed` ends
        at surfaces, including the black backs of one-sided surfaces and BLEND surfaces. `escaped` leaves the
        scene after a reflection. Except for the residual of the solve and the error of the matrix row sums,
        emitted = absorbed + escaped.
    """
    flux = area[:, None] / 3.0
    leaving = reflected + albedo * indirect
    escaped = float((flux * leaving * matrix.open).sum())
    lost = matrix.lost[:, None] + (matrix.sky[:, None] - matrix.open)
    if matrix.transmittance is not None:
        # Add the light that coloured surfaces between patches absorb.
        lost = lost + matrix.row_sums()[:, None] - apply(matrix, np.ones_like(leaving))
    backs = float((flux * leaving * lost).sum())
    absorbed = float((flux * (direct + indirect - leaving)).sum()) + backs
    return {"emitted": float((flux * direct).sum()), "absorbed": absorbed, "escaped": escaped}
