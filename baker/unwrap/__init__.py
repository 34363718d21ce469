"""Lightmap uv: cut with xatlas, or kept from the input, then packed into pages and checked."""

import sys
from types import ModuleType
from typing import Any

from baker.core.atlas import Atlas
from baker.core.progress import Progress, silent
from baker.core.scene import Scene
from baker.core.settings import BakeSettings


def unwrap_scene(scene: Scene, settings: BakeSettings, progress: Progress = silent) -> Atlas:
    """Lay out all instances in lightmap pages; see `baker.unwrap.unwrap.unwrap_scene`."""
    # Imported here so that a worker process, and `baker --help`, start without it.
    from baker.unwrap.unwrap import unwrap_scene as run

    return run(scene, settings, progress)


__all__ = ["unwrap_scene"]


class _CallablePackage(ModuleType):
    """Keeps `baker.unwrap(scene)` working: once imported, the package hides the function of that name."""

    def __call__(self, scene: Scene, *, progress: Progress = silent, **settings: Any) -> Atlas:
        """Lay out all instances; see the function in `baker/__init__.py`."""
        from baker.core.settings import make_settings

        return unwrap_scene(scene, make_settings(settings), progress)


sys.modules[__name__].__class__ = _CallablePackage
