"""Builds the settings of a pass as a tuple of integers, which kernels take as an argument.

`path_settings` is not in `pathtracer.estimators`, so that the command line can import the names of estimators
without loading kernels.
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
        The estimator; its field `strata` is ignored.
    strata : int or bool
        Whether samples at the first vertex are stratified, see `Estimator.strata`.
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
