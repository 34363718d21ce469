"""A quicker start of Numba for processes that are all ours.

Before Numba runs its first function it asks whether scipy's BLAS is there, for `np.dot` in kernels, and
scipy.linalg takes 0.15 to 0.3 s to load, a tenth of a small bake. No kernel here uses it.
"""

from __future__ import annotations

import sys


def skip_blas() -> None:
    """Let Numba start without scipy: call it before anything else imports Numba's array functions.

    Kernels of this process can then not use `np.dot` and `np.linalg`; a program that merely imports `baker`
    must not be changed like this.
    """
    if "scipy.linalg" in sys.modules:
        return
    # An entry of None makes an import fail at once. `import numba` loads scipy, but not its BLAS.
    loaded = sys.modules.get("scipy")
    sys.modules["scipy"] = None  # type: ignore[assignment]
    try:
        import numba.np.arraymath  # noqa: F401
    finally:
        del sys.modules["scipy"]
        if loaded is not None:
            sys.modules["scipy"] = loaded
