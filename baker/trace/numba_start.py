"""Starts Numba without scipy.linalg, for processes of the command line.

Before Numba compiles its first function, it imports scipy.linalg to support `np.dot` in kernels. The import
takes 0.15 to 0.3 s, and is not needed because no kernel of this program uses `np.dot`.
"""

from __future__ import annotations

import sys


def skip_blas() -> None:
    """Import Numba's array functions without scipy.linalg.

    `sys.modules["scipy"]` is set to None during the import, and restored afterwards. From then on, Numba
    functions of this process cannot use `np.dot` and `np.linalg`. So a program that imports `baker` as a
    library must not call this function. If scipy.linalg is already loaded, this function does nothing.
    """
    if "scipy.linalg" in sys.modules:
        return
    # With the entry None, `import scipy.linalg` raises ImportError, which Numba handles. `import numba`
    # itself has loaded scipy, but not scipy.linalg.
    loaded = sys.modules.get("scipy")
    sys.modules["scipy"] = None  # type: ignore[assignment]
    try:
        import numba.np.arraymath  # noqa: F401
    finally:
        del sys.modules["scipy"]
        if loaded is not None:
            sys.modules["scipy"] = loaded
