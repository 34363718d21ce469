"""A faster start of Numba for processes of the command line.

Before Numba compiles its first function it imports scipy.linalg, for `np.dot` in kernels. That takes 0.15 to
0.3 s, a tenth of a small bake, and no kernel here uses it.
"""

from __future__ import annotations

import sys


def skip_blas() -> None:
    """Import Numba's array functions without scipy.linalg.

    `sys.modules["scipy"]` is None while they are imported, and restored afterwards. Kernels of this process
    can then not use `np.dot` and `np.linalg`, so a program that imports `baker` as a library must not call
    this. It has no effect if scipy.linalg is loaded already.
    """
    if "scipy.linalg" in sys.modules:
        return
    # An entry of None makes the import fail at once. `import numba` loads scipy, but not scipy.linalg.
    loaded = sys.modules.get("scipy")
    sys.modules["scipy"] = None  # type: ignore[assignment]
    try:
        import numba.np.arraymath  # noqa: F401
    finally:
        del sys.modules["scipy"]
        if loaded is not None:
            sys.modules["scipy"] = loaded
