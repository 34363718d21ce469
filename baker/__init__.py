"""Baker: radiosity lightmaps and ambient occlusion for game assets.

>>> import baker
>>> scene = baker.load("level.glb")  # doctest: +SKIP
>>> result = baker.bake(scene, out="out", resolution=1024)  # doctest: +SKIP
>>> result.lightmaps["irradiance"].value.shape  # doctest: +SKIP
(1, 1024, 1024, 3)

docs/API.md describes every function. Each name of the API is imported when it is first used.
"""

from __future__ import annotations

from baker.core.version import VERSION

# The command line imports this module before it can handle Ctrl-C, so do not import `typing`, which takes
# several milliseconds. Type checkers recognise the name `TYPE_CHECKING`.
TYPE_CHECKING = False
if TYPE_CHECKING:
    from typing import Any

    from baker.api.bakes import ao, bake, export, save
    from baker.api.results import batch, diff, render, verify, view
    from baker.api.scenes import check, load, repair, unwrap
    from baker.checks.run import CheckReport
    from baker.checks.settings import CheckSettings
    from baker.comparison.compare import DiffReport
    from baker.comparison.settings import DiffSettings
    from baker.core.atlas import Atlas
    from baker.core.errors import BakerError, Cancelled, InputError, ResourceError, SettingsError
    from baker.core.lightmap import BakeResult, Lightmap, TexelStatus
    from baker.core.progress import Progress
    from baker.core.scene import Scene
    from baker.core.settings import BakeSettings
    from baker.io.settings import LoadSettings
    from baker.jobs.report import BatchReport
    from baker.jobs.settings import BatchSettings
    from baker.rendering.render import Picture
    from baker.rendering.settings import RenderSettings
    from baker.repairs.fix_file import FixResult
    from baker.repairs.settings import RepairSettings
    from baker.uv.settings import UnwrapSettings
    from baker.verification.settings import VerifySettings
    from baker.verification.verify import VerifyReport
    from baker.viewer.server import ViewServer

__version__ = VERSION

# Names of the API by the module that defines them.
_HOMES = {
    "api.bakes": ("ao", "bake", "export", "save"),
    "api.results": ("batch", "diff", "render", "verify", "view"),
    "api.scenes": ("check", "load", "repair", "unwrap"),
    "checks.run": ("CheckReport",),
    "checks.settings": ("CheckSettings",),
    "comparison.compare": ("DiffReport",),
    "comparison.settings": ("DiffSettings",),
    "core.atlas": ("Atlas",),
    "core.errors": ("BakerError", "Cancelled", "InputError", "ResourceError", "SettingsError"),
    "core.lightmap": ("BakeResult", "Lightmap", "TexelStatus"),
    "core.progress": ("Progress",),
    "core.scene": ("Scene",),
    "core.settings": ("BakeSettings",),
    "io.settings": ("LoadSettings",),
    "jobs.report": ("BatchReport",),
    "jobs.settings": ("BatchSettings",),
    "rendering.render": ("Picture",),
    "rendering.settings": ("RenderSettings",),
    "repairs.fix_file": ("FixResult",),
    "repairs.settings": ("RepairSettings",),
    "uv.settings": ("UnwrapSettings",),
    "verification.settings": ("VerifySettings",),
    "verification.verify": ("VerifyReport",),
    "viewer.server": ("ViewServer",),
}
_HOME = {name: home for home, names in _HOMES.items() for name in names}

__all__ = [
    "Atlas",
    "BakeResult",
    "BakeSettings",
    "BakerError",
    "BatchReport",
    "BatchSettings",
    "Cancelled",
    "CheckReport",
    "CheckSettings",
    "DiffReport",
    "DiffSettings",
    "FixResult",
    "InputError",
    "Lightmap",
    "LoadSettings",
    "Picture",
    "Progress",
    "RenderSettings",
    "RepairSettings",
    "ResourceError",
    "Scene",
    "SettingsError",
    "TexelStatus",
    "UnwrapSettings",
    "VerifyReport",
    "VerifySettings",
    "ViewServer",
    "ao",
    "bake",
    "batch",
    "check",
    "diff",
    "export",
    "load",
    "render",
    "repair",
    "save",
    "unwrap",
    "verify",
    "view",
]


def __getattr__(name: str) -> Any:
    """Import a name of the API when it is first used (PEP 562)."""
    if name not in _HOME:
        raise AttributeError(f"module 'baker' has no attribute '{name}'")
    from importlib import import_module

    value = getattr(import_module(f"baker.{_HOME[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """Return the names of the API."""
    return [*__all__, "__version__"]
