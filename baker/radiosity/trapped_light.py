"""Warns about nearly white surfaces that mostly face each other, so that little light is absorbed.

The share of a patch's light that remains after n reflections is

    s_n = (rho F) s_{n-1},   s_0 = 1        rho: albedo, F: form factors

In a closed scene of uniform albedo rho, s_n = rho^n, and the sum of direct and reflected light is 1 / (1 -
rho) times the direct light.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from baker.core.scene import SceneWarning
from baker.radiosity.form_factors import FormFactorMatrix
from baker.radiosity.solve import MAX_ALBEDO, Solution, apply, solve_warnings

# Limit of the albedo of a patch. Above this limit, the patch is tested.
NEARLY_WHITE = 0.98
# Number n of reflections in the test.
REFLECTIONS = 20
# Limit of the ratio of all light to direct light. Above this limit, there is a warning. A closed scene of
# albedo 0.95 has exactly this ratio.
MOST_GAIN = 20.0


def light_warnings(
    solution: Solution,
    matrix: FormFactorMatrix,
    albedo: NDArray[np.float64],
    area: NDArray[np.float64],
    bounces: int | None,
) -> list[SceneWarning]:
    """Return warnings about reflected light: the solve did not converge, or little light is absorbed.

    Parameters
    ----------
    solution : Solution
        Result of the solve.
    matrix : FormFactorMatrix
        F of P patches.
    albedo : (P, 3) float64
        0 to 1.
    area : (P,) float64, m2
        Areas of the patches.
    bounces : int or None
        Number of reflections of the solve; None means until converged.

    Returns
    -------
    list of SceneWarning
        `solve-not-converged` and `albedo`, each if it applies.
    """
    return [*solve_warnings(solution), *trapped_light(matrix, albedo, area, bounces)]


def trapped_light(
    matrix: FormFactorMatrix,
    albedo: NDArray[np.float64],
    area: NDArray[np.float64],
    bounces: int | None,
) -> list[SceneWarning]:
    """Return a warning if all bounces multiply the light of some patches by more than `MOST_GAIN`.

    Parameters
    ----------
    matrix : FormFactorMatrix
        F of P patches.
    albedo : (P, 3) float64
        0 to 1.
    area : (P,) float64, m2
        Areas of the patches.
    bounces : int or None
        Number of reflections of the solve; None means until converged. With fewer than `MOST_GAIN` bounces
        there is no warning, because N bounces multiply light by at most N + 1.
    """
    white = albedo.max(axis=1) > NEARLY_WHITE
    if not white.any() or (bounces is not None and bounces < MOST_GAIN):
        return []
    albedo = np.minimum(albedo, MAX_ALBEDO)
    left = np.ones_like(albedo)
    for _ in range(REFLECTIONS):
        left = albedo * apply(matrix, left)
    left = left.max(axis=1)
    trapped = white & (left > (1.0 - 1.0 / MOST_GAIN) ** REFLECTIONS)
    if not trapped.any():
        return []
    share = 100.0 * float(area[trapped].sum() / area.sum())
    each = float(np.average(left[trapped], weights=area[trapped])) ** (1.0 / REFLECTIONS)
    # Limit the share of light that remains after each reflection, because row sums of F are estimated with
    # rays and may slightly exceed 1.
    most = 1.0 / (1.0 - min(each, MAX_ALBEDO))
    message = (
        f"surfaces that reflect over {100 * NEARLY_WHITE:g} % see little but each other "
        f"({share:.3g} % of the surface): all bounces together multiply light there by about {most:.3g}"
    )
    if most > 0.5 / (1.0 - MAX_ALBEDO):
        message += f", and without the bake's limit of albedo {MAX_ALBEDO} it would grow without bound"
    message += "; lower their base colour to 0.9 or less (`baker check` names the materials)"
    return [SceneWarning("albedo", message)]
