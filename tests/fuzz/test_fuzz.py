"""A few random mutations for each target; `tests/fuzz/run.py` runs many.

With NUMBA_BOUNDSCHECK=1 and NUMBA_CACHE_DIR set to a separate folder, kernels are compiled with checked
indices, and the tests use other seeds.
"""

from __future__ import annotations

import numba
import numpy as np
import pytest
from numba.core.errors import NumbaError
from targets import ANSWERS, TARGETS, scenes_of

from baker.trace.jit import kernel

CHECKED = bool(numba.config.BOUNDSCHECK)
SEEDS = range(100_000, 100_020) if CHECKED else range(6)
# {target that reads only text files: number of its mutations}. These targets run on one scene.
TEXT = {"config": 50, "jobs": 20}
CASES = [(name, k) for name in TARGETS for k in range(1 if name in TEXT else len(scenes_of(name)))]


@pytest.mark.parametrize(("name", "scene"), CASES, ids=[f"{n}-{scenes_of(n)[k].stem[-9:]}" for n, k in CASES])
def test_mutations_are_baked_or_refused_with_a_sentence(name, scene, tmp_path):
    before = ANSWERS.copy()
    for seed in range(TEXT[name]) if name in TEXT else SEEDS:
        found = TARGETS[name](scenes_of(name)[scene], tmp_path, np.random.default_rng(seed))
        assert found is None, f"python tests/fuzz/run.py {name} --scene {scene} --only {seed}\n{found}"
    # Some mutations are accepted and some are refused. Otherwise they would test little.
    assert ANSWERS["accepted"] > before["accepted"]
    assert ANSWERS["refused"] > before["refused"]


@kernel
def _item(values, k):
    return values[k]


@pytest.mark.skipif(not CHECKED, reason="needs NUMBA_BOUNDSCHECK=1")
def test_kernels_check_indices():
    assert _item(np.arange(3.0), 2) == 2.0
    with pytest.raises((IndexError, NumbaError)):
        _item(np.arange(3.0), 3)
