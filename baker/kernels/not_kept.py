"""Says when compiled kernels cannot be kept for the next run."""

from __future__ import annotations

from baker.core.scene import SceneWarning
from baker.kernels.surface import place_points


def cache_warnings() -> list[SceneWarning]:
    """Return a warning if compiled kernels cannot be kept for the next run."""
    # One kernel answers for all: the folders are of one install.
    if place_points._cache.cache_path is not None:
        return []
    message = (
        "no folder can be written to keep compiled kernels in, so each run compiles them anew, for up to a"
        " minute; make one writable: ~/.cache, or any, named by NUMBA_CACHE_DIR"
    )
    return [SceneWarning("kernels-not-kept", message)]
