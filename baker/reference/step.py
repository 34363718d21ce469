"""How the steps of a path are compiled: without reference counts.

Numba counts the references to every array argument on entry and exit of a function, two atomic operations
each, unless it can prove them useless, which it cannot where a function returns from several places. A step
of a path makes no array and keeps none: it is compiled without the counts.
"""

from __future__ import annotations

from typing import Any

from numba import njit

step: Any = njit(cache=True, nogil=True, error_model="numpy", _nrt=False)  # type: ignore[call-overload]
