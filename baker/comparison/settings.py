"""Defines the settings of a comparison of two bakes."""

from __future__ import annotations

from typing import ClassVar

from baker.core.settings_model import Settings, seed_setting, setting, threads_setting


class DiffSettings(Settings):
    """Settings of a comparison of two bakes. Values are validated when an object is created."""

    table: ClassVar[str] = "diff"
    what: ClassVar[str] = "diff setting"

    texels: int = setting(20000, "Number of texels of A to compare.", ge=1)
    flip: bool = setting(True, "Also compute the FLIP error of the pages.")
    fail_if: str | None = setting(
        None,
        'Conditions for failure, separated by commas: "irradiance.p95 > 0.05, ao.flip > 0.02". '
        "Default: none.",
        metavar="EXPR",
    )
    seed: int = seed_setting()
    threads: int | None = threads_setting()
