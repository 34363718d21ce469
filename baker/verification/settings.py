"""Settings of `verify`: how much is path-traced, and the limits."""

from __future__ import annotations

from typing import ClassVar

from baker.core.settings_model import Settings, seed_setting, setting, threads_setting

# Time limit of path tracing where neither samples nor a time are given, seconds.
DEFAULT_TIME = 40.0


class VerifySettings(Settings):
    """Holds the settings of a verification, checked."""

    table: ClassVar[str] = "verify"
    what: ClassVar[str] = "verify setting"

    texels: int = setting(
        2000, "Texels compared at their centres; points at edges and outliers are added.", ge=1
    )
    spp: int | None = setting(None, "Fixed number of paths for each texel.", ge=1)
    target_se: float = setting(0.005, "Relative standard error at which a texel is good enough.", gt=0)
    time_limit: float | None = setting(
        None,
        "Time for path tracing; default: 40 without `spp`, else none. `inf` is none.",
        unit="s",
        metavar="SECONDS",
        gt=0,
    )
    fail_if: str | None = setting(None, 'Limits: "irradiance.p95 > 0.05, ao.rmse > 0.02".', metavar="EXPR")
    seed: int = seed_setting()
    threads: int | None = threads_setting()

    @property
    def seconds(self) -> float | None:
        """Return the time limit of path tracing in seconds, None without one."""
        if self.time_limit is None:
            return DEFAULT_TIME if self.spp is None else None
        return None if self.time_limit == float("inf") else self.time_limit
