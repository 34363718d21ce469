"""Defines the settings of `verify`: number of points, effort of path tracing, and limits."""

from __future__ import annotations

from typing import ClassVar

from baker.core.settings_model import Settings, seed_setting, setting, threads_setting

# Time limit of path tracing if neither `spp` nor `time_limit` is set, seconds.
DEFAULT_TIME = 40.0


class VerifySettings(Settings):
    """The settings of a verification."""

    table: ClassVar[str] = "verify"
    what: ClassVar[str] = "verify setting"

    texels: int = setting(
        2000,
        "Number of random texels to compare. Points at edges are added. Texels that differ from all their "
        "neighbours, that have large gradients or that have rare light levels are added, too.",
        ge=1,
    )
    spp: int | None = setting(None, "Fixed number of paths for each texel.", ge=1)
    target_se: float = setting(0.005, "Relative standard error at which path tracing of a texel stops.", gt=0)
    time_limit: float | None = setting(
        None,
        "Time for path tracing; `inf` is no limit. Default: 40, or no limit if `spp` is set.",
        unit="s",
        metavar="SECONDS",
        gt=0,
    )
    fail_if: str | None = setting(
        None,
        'Conditions for failure, separated by commas: "irradiance.p95 > 0.05, ao.rmse > 0.02". '
        "Default: the limits of `baker` for each channel.",
        metavar="EXPR",
    )
    seed: int = seed_setting()
    threads: int | None = threads_setting()

    @property
    def seconds(self) -> float | None:
        """Return the time limit of path tracing in seconds, None for no limit."""
        if self.time_limit is None:
            return DEFAULT_TIME if self.spp is None else None
        return None if self.time_limit == float("inf") else self.time_limit
