"""Random numbers of a path: SplitMix64 from a state that names the path.

A number depends on (seed, pass, point, sample) and on how many the path has drawn before, on nothing else.

Based on: Steele, Lea and Flood, Fast splittable pseudorandom number generators, 2014.
"""

from __future__ import annotations

import numpy as np

from baker.reference.step import step

_u = np.uint64
_STEP = np.uint64(0x9E3779B97F4A7C15)
_INV_2_53 = 1.0 / 9007199254740992.0


@step
def mix64(x):  # type: ignore[no-untyped-def]
    """Return a well-mixed uint64 of a uint64."""
    x = _u(x ^ (x >> _u(30)))
    x = _u(x * _u(0xBF58476D1CE4E5B9))
    x = _u(x ^ (x >> _u(27)))
    x = _u(x * _u(0x94D049BB133111EB))
    return _u(x ^ (x >> _u(31)))


@step
def path_state(seed, number, point, sample):  # type: ignore[no-untyped-def]
    """Return the state (uint64) of sample `sample` of point `point` in pass `number`."""
    x = mix64(_u(_u(seed) + _STEP))
    x = mix64(_u(x ^ _u(_u(number) + _u(1)) * _u(0xD1342543DE82EF95)))
    x = mix64(_u(x ^ _u(_u(point) + _u(1)) * _u(0x2545F4914F6CDD1D)))
    return mix64(_u(x ^ _u(_u(sample) + _u(1)) * _STEP))


@step
def draw(state, lane):  # type: ignore[no-untyped-def]
    """Advance `state` (16,) uint64 of a lane and return a float64 in [0, 1)."""
    state[lane] = _u(state[lane] + _STEP)
    return np.float64(mix64(state[lane]) >> _u(11)) * _INV_2_53
