"""Defines the settings of `baker inspect`."""

from __future__ import annotations

from baker.core.settings_model import RunSettings, allow_outside_setting


class InspectSettings(RunSettings):
    """The settings of `baker inspect`."""

    allow_outside: bool = allow_outside_setting()
