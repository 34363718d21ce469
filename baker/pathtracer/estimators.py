"""Defines the estimators of the rendering equation: how each estimator samples directions and lights.

With `uniform`, `cosine`, `stratified` and `bsdf`, paths hit emitters and the sky at random. `light` samples a
light at every vertex. `mis` and `mis-power` combine both techniques by multiple importance sampling. `bdpt`
connects paths from the eye with paths from lights (`bidirectional`). Paths cannot hit lights without area, so
every estimator samples these lights or starts paths at them.

Based on: Kajiya, The rendering equation, 1986; Veach, Robust Monte Carlo methods for light transport
simulation, 1997, ch. 8 and 9.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from baker.core.names import unknown_name


class Estimator(NamedTuple):
    """How an estimator samples directions and lights.

    Attributes
    ----------
    hemisphere : int
        Distribution of directions. 0: proportional to the BSDF; 1: uniform over the hemisphere; 2:
        cosine-weighted.
    aim : int
        Sampling of emitters and the sky. 0: never. 1: at every vertex; emission that a path hits is then
        added only if the camera sees it directly or in mirrors. 2: at every vertex, combined by MIS with
        emission that a path hits.
    strata : int
        1 if the samples at each path's first vertex are stratified. Two pairs of random numbers choose the
        point on the light and the direction; over the samples of a pass, each pair is a scrambled
        (0,2)-sequence.
    power : int
        1 for the power heuristic of MIS (exponent 2), 0 for the balance heuristic.
    both : int
        1 if a second path starts at a light and every vertex of one path is connected to every vertex of the
        other (`bidirectional`).
    """

    hemisphere: int
    aim: int
    strata: int = 0
    power: int = 0
    both: int = 0


@dataclass(frozen=True)
class PassOptions:
    """How a pass samples paths; `irradiance` defines a pass.

    Attributes
    ----------
    estimator : str
        A key of `ESTIMATORS`.
    stratify : bool
        If true, paths from surface points are stratified (`Estimator.strata`) with every estimator.
    max_bounces : int or None
        Largest number of reflections between the light and the surface point, or between the light and the
        first surface that a camera sees. None: no limit.
    seed : int
        Seed of all random numbers.
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
        See `PassOptions`; -1: no limit.
    seed : int
        Seed of all random numbers.
    number_of_pass : int
        Number of the pass, from 0.
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
    """Return the estimator with a name.

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
        If no estimator has that name.
    """
    if name not in ESTIMATORS:
        raise unknown_name("estimator", name, ESTIMATORS, object="estimator")
    return ESTIMATORS[name]
