"""Defines the settings of fixes and repairs."""

from __future__ import annotations

from typing import ClassVar, Literal

from baker.core.settings import BakeSettings
from baker.core.settings_model import Settings, same_setting, setting


class RepairSettings(Settings):
    """Settings of fixes and repairs. Values are validated when an object is created."""

    table: ClassVar[str] = "repair"
    what: ClassVar[str] = "repair setting"

    repair: bool = setting(
        False,
        "Fix, and also repair the shape of meshes: non-manifold edges, holes, orientation, slivers"
        " (needs pip install pymeshlab).",
    )
    resolution: int = setting(
        1024, "Width of the page for which lightmap uv are tested and made.", unit="texels", ge=16, le=16384
    )
    up: Literal["y", "z"] = same_setting(BakeSettings, "up")
    scale: float = same_setting(BakeSettings, "scale")
    allow_outside: bool = same_setting(BakeSettings, "allow_outside")
    threads: int | None = same_setting(BakeSettings, "threads")
