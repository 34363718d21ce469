"""Settings of a pass as a tuple of integers, the argument of kernels.

This function is not in `estimators`, so that the command line can import the names of estimators without
loading kernels.
"""

from __future__ import annotations

from baker.pathtracer.estimators import Estimator, PassOptions, PathSettings
from baker.pathtracer.rng import seed_salt


def path_settings(
    estimator: Estimator, strata: int | bool, options: PassOptions, number: int
) -> PathSettings:
    """Return the settings of a pass in the form that kernels take.

    Parameters
    ----------
    estimator : Estimator
        Options of its paths; `strata` of the estimator is ignored.
    strata : int or bool
        Whether the first two random pairs of a path are stratified.
    options : PassOptions
        The limit of reflections and the seed.
    number : int
        Number of the pass.

    Returns
    -------
    PathSettings
        All fields are int, so that Numba compiles each kernel once.
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
