"""Baker: radiosity lightmaps and ambient occlusion for game assets.

>>> import baker
>>> result = baker.bake("level.glb", out="out", resolution=1024)  # doctest: +SKIP
>>> result.lightmaps["irradiance"].value.shape  # doctest: +SKIP
(1, 1024, 1024, 3)
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from baker.core.errors import BakerError, Cancelled, InputError, ResourceError, SettingsError
from baker.core.progress import Progress, silent

if TYPE_CHECKING:
    from baker.core.atlas import Atlas
    from baker.core.lightmap import BakeResult
    from baker.core.scene import Scene

__all__ = [
    "BakerError",
    "Cancelled",
    "InputError",
    "ResourceError",
    "Scene",
    "SettingsError",
    "bake",
    "load",
    "unwrap",
]
__version__ = "0.1.0"


def __getattr__(name: str) -> Any:
    """Import `baker.Scene` when it is first asked for: NumPy takes a moment."""
    if name == "Scene":
        from baker.core.scene import Scene

        return Scene
    raise AttributeError(f"module 'baker' has no attribute '{name}'")


def load(path: str | Path, *, up: str = "y", scale: float = 1.0) -> Scene:
    """Read a scene file.

    Parameters
    ----------
    path : str or Path
        A file of a format in `baker.io.importers`; `baker bake --help` lists the suffixes.
    up, scale : str, float
        Up axis and metres per unit of formats other than glTF.

    Raises
    ------
    InputError
        If the file is unreadable, malformed, or holds nothing to bake.
    """
    from baker.io.load import load_scene

    return load_scene(path, up=up, scale=scale)


def unwrap(scene: Scene, *, progress: Progress = silent, **settings: Any) -> Atlas:
    """Give every instance of a scene its place in the lightmap pages.

    Parameters
    ----------
    scene : Scene
    progress : Progress
    settings
        Any of `baker.core.settings.BakeSettings`: resolution, density, padding, uv ...

    Raises
    ------
    SettingsError, InputError, Cancelled
    """
    from baker.core.settings import make_settings
    from baker.uv.unwrap import unwrap_scene

    return unwrap_scene(scene, make_settings(settings), progress)


def bake(
    scene: Scene | str | Path,
    *,
    out: str | Path | None = None,
    progress: Progress = silent,
    force: bool = False,
    **settings: Any,
) -> BakeResult:
    """Bake a scene.

    Parameters
    ----------
    scene : Scene, str or Path
    out : str or Path, optional
        Folder to write; None keeps everything in memory.
    progress : Progress
        Is told stage and fraction; a truthy answer cancels.
    force : bool
        Replace an `out` that baker did not write.
    settings
        Any of `baker.core.settings.BakeSettings`: channels, resolution, samples ...

    Returns
    -------
    BakeResult
        `result.lightmaps["irradiance"].value` is (pages, H, W, 3) float32, lx.

    Raises
    ------
    SettingsError, InputError, ResourceError, Cancelled
    """
    from baker.core.settings import make_settings
    from baker.pipeline.bake import bake as run

    return run(scene, settings=make_settings(settings), out=out, progress=progress, force=force)
