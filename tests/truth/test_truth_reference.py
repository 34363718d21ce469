"""The estimators of the path tracer agree, and results are byte-identical for any number of threads.

`test_truth_metrics` compares the path tracer with closed forms.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from reference_runs import copies_of, traced
from tiny_scenes import Quad, box_quads, grey, quad_scene
from ztest import critical

from baker.core.scene import PunctualLight
from baker.pathtracer.estimators import ESTIMATORS


def room():
    walls = box_quads((0, 0, 0), (2, 2, 2), inward=True, material=grey(0.6))
    emitter = Quad((0.7, 1.3, 1.9), (0.6, 0, 0), (0, -0.6, 0), grey(0, 5.0))
    block = box_quads((0.3, 0.3, 0), (0.8, 0.8, 0.6), inward=False, material=grey(0.4))
    scene = quad_scene([*walls, emitter, *block])
    return replace(scene, lights=(PunctualLight("point", "p", 0, (0.3, 0.3, 0.3), (1.6, 0.4, 1.0)),))


def test_estimators_agree_pairwise():
    where = copies_of(np.random.default_rng(2).uniform((1.0, 1.0, 0), (1.9, 1.9, 0), (16, 3)), copies=1)
    found = {name: traced(room(), where, estimator=name, passes=24) for name in ESTIMATORS}
    # Random numbers of different points are independent.
    mean = {name: float(e.mean[:, 0].sum()) for name, e in found.items()}
    error = {name: math.sqrt((e.standard_error[:, 0] ** 2).sum()) for name, e in found.items()}
    pairs = [(a, b) for i, a in enumerate(mean) for b in list(mean)[:i]]
    bound = critical(len(pairs), 23 * 16)
    for a, b in pairs:
        assert abs(mean[a] - mean[b]) < bound * math.hypot(error[a], error[b]), f"{a} and {b}"
    # The standard error is at most 1 % for estimators that sample lights, and at most 4 % for the others.
    for name, how in ESTIMATORS.items():
        assert error[name] < (0.01 if how.aim else 0.04) * mean[name], name


@pytest.mark.parametrize("power", ["mis", "mis-power"])
@pytest.mark.parametrize(("half", "height"), [(0.5, 0.1), (0.05, 1.9), (0.5, 0.6)])
def test_mis_is_never_much_worse_than_either_part(power, half, height):
    # BSDF samples are better for a large near emitter, light samples for a small distant one. Half of the
    # emitter is hidden, so that both techniques have variance.
    emitter = Quad((-half, half, height), (2 * half, 0, 0), (0, -2 * half, 0), grey(0, 1.0))
    screen = Quad((0, -2, 0.9 * height), (4, 0, 0), (0, 4, 0), grey(0, double_sided=True))
    points = np.random.default_rng(3).uniform((-0.1, -0.1, 0), (0.1, 0.1, 0), (256, 3)) * (half, 1, 1)
    where = copies_of(points, copies=1)
    variance = {}
    for name in (power, "light", "bsdf"):
        scene = quad_scene([emitter, screen])
        found = traced(scene, where, estimator=name, passes=128, samples=4, stratify=False)
        variance[name] = float((found.standard_error**2).mean())
    assert variance[power] <= 1.1 * min(variance["light"], variance["bsdf"])


def test_same_bytes_on_any_number_of_threads():
    where = copies_of(np.random.default_rng(2).uniform((0.1, 0.1, 0), (1.9, 1.9, 0), (300, 3)), copies=1)
    one, other = (traced(room(), where, passes=2, samples=4, threads=n) for n in (1, 3))
    assert one.total.tobytes() == other.total.tobytes()
    assert one.squares.tobytes() == other.squares.tobytes()
