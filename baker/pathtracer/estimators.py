"""Estimators of the rendering equation, by name, and the options of paths that each sets.

With `uniform`, `cosine`, `stratified` and `bsdf`, paths hit lights at random; `light` samples lights from
every vertex; `mis` combines both by multiple importance sampling; `bdpt` connects paths from the eye with
paths from lights. Lights without area cannot be hit, so every estimator samples them, or starts paths at
them.

Based on: Kajiya, The rendering equation, 1986; Veach, Robust Monte Carlo methods for light transport
simulation, 1997, ch. 8 and 9.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from baker.core.names import unknown_name


class Estimator(NamedTuple):
    """The options of a path.

    Attributes
    ----------
    hemisphere : int
        0: directions follow the BSDF; 1: uniform over the hemisphere; 2: cosine over it.
    aim : int
        Sampling of lights with area and the sky: 0 never; 1 at every vertex, and emission that paths hit is
        ignored; 2 combined with hits by MIS.
    strata : int
        1: the first two random pairs of a pass's samples are a scrambled (0,2)-sequence.
    power : int
        MIS by the power heuristic (exponent 2) instead of the balance heuristic.
    both : int
        1: a second path starts at a light, and the two are connected in all ways (`bidirectional`).
    """

    hemisphere: int
    aim: int
    strata: int = 0
    power: int = 0
    both: int = 0


@dataclass(frozen=True)
class PassOptions:
    """How a pass samples paths.

    Attributes
    ----------
    estimator : str
        A key of `ESTIMATORS`.
    stratify : bool
        Stratify the first directions at points of surfaces, even if the estimator does not.
    max_bounces : int or None
        Reflections before light arrives at a point, or between light and the first surface that a camera
        sees; None is unlimited.
    seed : int
        Of all random numbers.
    """

    estimator: str = "mis"
    stratify: bool = True
    max_bounces: int | None = None
    seed: int = 0


DEFAULT_OPTIONS = PassOptions()


class PathSettings(NamedTuple):
    """The settings of a pass, as kernels take them.

    Attributes
    ----------
    hemisphere, aim, strata, power : int
        See `Estimator`.
    max_bounces : int
        -1: no limit.
    seed : int
    number_of_pass : int
    salt : int
        `rng.seed_salt` of the seed.
    """

    hemisphere: int
    aim: int
    strata: int
    power: int
    max_bounces: int
    seed: int
    number_of_pass: int
    salt: int


ESTIMATORS = {
    "uniform": Estimator(1, 0),
    "cosine": Estimator(2, 0),
    "stratified": Estimator(2, 0, strata=1),
    "light": Estimator(0, 1),
    "bsdf": Estimator(0, 0),
    "mis": Estimator(0, 2),
    "mis-power": Estimator(0, 2, power=1),
    "bdpt": Estimator(0, 2, both=1),
}


def estimator_named(name: str) -> Estimator:
    """Return an estimator.

    Parameters
    ----------
    name : str
        A key of `ESTIMATORS`.

    Returns
    -------
    Estimator
        Its options.

    Raises
    ------
    SettingsError
        If there is none of that name.
    """
    if name not in ESTIMATORS:
        raise unknown_name("estimator", name, ESTIMATORS, object="estimator")
    return ESTIMATORS[name]
