"""Estimates the share of a bake that is done, and the time left, from reports of its stages."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping

# Weight of the assumption that work takes the expected time, seconds. The weight of the measured durations is
# the expected duration of the finished stages, seconds.
_PRIOR_SECONDS = 2.0
# Share of a stage that must be done before the stage's duration is extrapolated from its progress.
_ENOUGH = 0.1


class BakePlan:
    """Estimates the progress of a bake from expected seconds of its stages and from measured seconds.

    Parameters
    ----------
    expected : mapping of str to float
        Expected seconds of each stage, in the order in which the stages run.
    clock : callable
        Returns the time, seconds.
    """

    def __init__(self, expected: Mapping[str, float], clock: Callable[[], float] = time.monotonic) -> None:
        self._expected = dict(expected)
        self._clock = clock
        self._total = max(sum(self._expected.values()), 1e-9)
        self._position = {stage: index for index, stage in enumerate(self._expected)}
        self._stage = ""
        self._started = clock()
        self._share = 0.0
        # Work of finished stages: expected and measured seconds.
        self._planned = self._measured = 0.0
        self._compiled = False
        # The last estimate of the time left, and when it was made.
        self._left: tuple[float, float] | None = None

    def update(self, stage: str, fraction: float, *, compiling: bool = False) -> tuple[float, float | None]:
        """Return the progress of the bake after a report of a stage.

        Parameters
        ----------
        stage : str
            Name of the stage. Stages that are not in `expected` are parts of other stages. They do not change
            the share.
        fraction : float
            Share of the stage that is done, 0 to 1.
        compiling : bool
            Whether kernels are compiled in this stage, which makes its duration useless for an estimate.

        Returns
        -------
        share : float
            Share of the bake that is done, 0 to 1. It never falls.
        left : float or None
            Seconds until the end; None while kernels are compiled, or if there is no estimate yet.
        """
        now = self._clock()
        if stage in self._expected and stage != self._stage:
            self._finish_stage()
            self._stage, self._started, self._compiled = stage, now, False
        self._compiled |= compiling
        if stage not in self._expected:
            if compiling or self._left is None:
                return self._share, None
            then, left = self._left
            return self._share, max(left - (now - then), 0.0)
        position = self._position[stage]
        before = sum(seconds for name, seconds in self._expected.items() if self._position[name] < position)
        self._share = max(self._share, (before + fraction * self._expected[stage]) / self._total)
        if compiling:
            return self._share, None
        after = self._total - before - self._expected[stage]
        left = after * self._slowness() + self._left_of_stage(fraction)
        self._left = now, left
        return self._share, left

    def _finish_stage(self) -> None:
        """Add the last stage to the sums of finished stages, unless kernels were compiled in it."""
        if self._stage and not self._compiled:
            self._planned += self._expected[self._stage]
            self._measured += self._clock() - self._started

    def _slowness(self) -> float:
        """Return the estimated ratio of the real duration of work to its expected duration."""
        return (_PRIOR_SECONDS + self._measured) / (_PRIOR_SECONDS + self._planned)

    def _left_of_stage(self, fraction: float) -> float:
        """Return the estimated seconds until the end of the running stage."""
        if fraction >= _ENOUGH and not self._compiled:
            return (self._clock() - self._started) * (1 - fraction) / fraction
        return self._expected[self._stage] * (1 - fraction) * self._slowness()
