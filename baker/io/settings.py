"""Defines the settings of reading scene files, and of `baker inspect`."""

from __future__ import annotations

from typing import ClassVar, Literal

from baker.core.settings import BakeSettings
from baker.core.settings_model import SCENE, RunSettings, Settings, Text, same_setting, setting


class LoadSettings(Settings):
    """Settings of reading a scene file. Each is the setting of the same name in `BakeSettings`."""

    what: ClassVar[str] = "load setting"

    up: Literal["y", "z"] = same_setting(BakeSettings, "up")
    scale: float = same_setting(BakeSettings, "scale")
    scene_name: Text | None = same_setting(BakeSettings, "scene_name")
    variant: str | None = same_setting(BakeSettings, "variant")
    animation: Text | None = same_setting(BakeSettings, "animation")
    time: float | None = same_setting(BakeSettings, "time")
    missing_textures: Literal["error", "white", "grey", "magenta"] = same_setting(
        BakeSettings, "missing_textures"
    )
    split: Literal["groups", "objects", "none"] = same_setting(BakeSettings, "split")
    unlit: Literal["block", "lit"] = same_setting(BakeSettings, "unlit")
    allow_outside: bool = same_setting(BakeSettings, "allow_outside")


class InspectSettings(RunSettings, LoadSettings):
    """The settings of `baker inspect`."""

    what: ClassVar[str] = "setting"

    objects: bool = setting(False, "List the settings of each object, and where they come from.", group=SCENE)
