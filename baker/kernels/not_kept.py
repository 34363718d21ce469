"""Warns if this installation cannot store compiled kernels for the next run."""

from __future__ import annotations

from baker.core.scene import SceneWarning
from baker.kernels.surface import place_points


def cache_warnings() -> list[SceneWarning]:
    """Return the warning `kernels-not-kept` if Numba has no writable folder for compiled kernels.

    Returns
    -------
    list of SceneWarning
        One warning, or none.
    """
    # Check one kernel, because all kernels use the same folder.
    if place_points._cache.cache_path is not None:
        return []
    message = (
        "no folder can be written to keep compiled kernels in, so each run compiles them again, for up to a"
        " minute; make one writable: ~/.cache, or any, named by NUMBA_CACHE_DIR"
    )
    return [SceneWarning("kernels-not-kept", message)]
