"""The settings of a pass, as an argument of kernels.

They are not in `estimators`, so that the command line can read the names of estimators without loading
kernels.
"""

from __future__ import annotations

from baker.pathtracer.estimators import Estimator, PassOptions, PathSettings
from baker.pathtracer.rng import seed_salt


def path_settings(
    estimator: Estimator, strata: int | bool, options: PassOptions, number: int
) -> PathSettings:
    """Return the settings of a pass for kernels.

    Parameters
    ----------
    estimator : Estimator
        Its `strata` is replaced by the next parameter.
    strata : int or bool
        Whether the first two random pairs of a path are stratified.
    options : PassOptions
        Number of reflections and seed.
    number : int
        The pass.

    Returns
    -------
    PathSettings
        All numbers are int, so that kernels are compiled once.
    """
    return PathSettings(
        estimator.hemisphere,
        estimator.aim,
        int(strata),
        estimator.power,
        -1 if options.max_bounces is None else options.max_bounces,
        options.seed,
        number,
        seed_salt(options.seed),
    )
