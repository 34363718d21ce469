"""After `skip_blas`, Numba does not import SciPy, and kernels still run."""

from __future__ import annotations

import subprocess
import sys

import pytest

SHOW = """
import sys
{first}
if {skip}:
    from baker.trace.numba_start import skip_blas
    skip_blas()
import numpy as np
from baker.radiosity.kernels.form_factor import multiply
first, column, value = np.array([0, 1], np.int64), np.zeros(1, np.int32), np.ones(1, np.float32)
light, out = np.full((1, 3), 2.0), np.zeros((1, 3))
multiply(first, column, value, light, out)
assert (out == 2).all()
print("scipy.linalg" in sys.modules)
import scipy.linalg
"""


@pytest.mark.parametrize("first", ["", "import numba"])
@pytest.mark.parametrize("skip", [True, False])
def test_scipy_is_loaded_only_without_the_skip(skip, first):
    script = SHOW.format(skip=skip, first=first)
    shown = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert shown.returncode == 0, shown.stderr
    assert shown.stdout.strip() == str(not skip)
