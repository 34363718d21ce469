"""How much `verify` path-traces, and by what it judges."""

from __future__ import annotations

from dataclasses import dataclass

from baker.core.errors import SettingsError


@dataclass(frozen=True)
class VerifySettings:
    """How much is path-traced.

    Attributes
    ----------
    texels : int
        Texels judged at their middles; points at edges and suspects come on top.
    spp : int or None
        Paths for each texel; None goes on until `target_se` or the time limit.
    target_se : float
        Relative standard error at which a texel is good enough.
    time_limit : float or None
        Seconds of path tracing.
    fail_if : str or None
        Limits; None takes those of `judgements.default_limits`.
    seed, threads
    """

    texels: int = 2000
    spp: int | None = None
    target_se: float = 0.005
    time_limit: float | None = 40.0
    fail_if: str | None = None
    seed: int = 0
    threads: int | None = None

    def __post_init__(self) -> None:
        """Refuse what makes no sense."""
        if self.texels < 1:
            raise SettingsError("--texels must be at least 1", object="texels")
        if self.spp is not None and self.spp < 1:
            raise SettingsError("--spp must be at least 1", object="spp")
        if not self.target_se > 0:
            raise SettingsError("--target-se must be above 0", object="target_se")
        if self.time_limit is not None and not self.time_limit > 0:
            raise SettingsError("--time-limit must be above 0", object="time_limit")
