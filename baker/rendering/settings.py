"""What a picture is to show, checked before any work."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

from baker.core.errors import SettingsError
from baker.core.names import unknown_name
from baker.pathtracer.estimators import estimator_named

AOVS = ("albedo", "normal", "depth")
DEFAULT_SPP = 64


@dataclass(frozen=True)
class RenderSettings:
    """What is rendered.

    Attributes
    ----------
    camera : str or None
        Numbers as `parse_camera` takes them, or the name or number of one of the file's own (`named_camera`);
        None takes the file's first camera.
    width, height : int
    spp : int or None
        Samples of each pixel, rounded up to whole passes, of which there are at least two; None renders until
        the time limit (64 without one).
    time_limit : float or None
        Seconds from the start, loading included. Two passes are always made.
    estimator : str
    max_depth : int or None
        Vertices of a path after the camera: 1 shows lamps and directly lit surfaces. None is unlimited.
    ao : bool
        Ambient occlusion instead of light; `ao_distance` in metres or per cent of the diagonal.
    aov : tuple of str
        Of `AOVS`.
    denoise : bool
    lightmap : Path or None
        Output folder of a bake: the scene is lit by its maps, without any path.
    sky : str or None
        As `bake` takes it, with its strength; None with `lightmap` is the bake's own.
    """

    camera: str | None = None
    width: int = 640
    height: int = 480
    spp: int | None = None
    time_limit: float | None = None
    estimator: str = "mis"
    max_depth: int | None = None
    ao: bool = False
    ao_distance: str | None = None
    aov: tuple[str, ...] = ()
    denoise: bool = False
    lightmap: Path | None = None
    sky: str | None = None
    sky_strength: float | str = 1.0
    seed: int = 0
    threads: int | None = None

    def __post_init__(self) -> None:
        """Refuse what makes no sense."""
        for name in ("width", "height"):
            if not 1 <= getattr(self, name) <= 16384:
                raise SettingsError(f"--{name} must be 1 to 16384", object=name)
        if self.spp is not None and self.spp < 1:
            raise SettingsError("--spp must be at least 1", object="spp")
        if self.time_limit is not None and not 0 < self.time_limit < math.inf:
            raise SettingsError("--time-limit must be a number of seconds above 0", object="time_limit")
        if self.max_depth is not None and self.max_depth < 1:
            raise SettingsError("--max-depth must be at least 1", object="max_depth")
        if self.ao and self.lightmap is not None:
            raise SettingsError("--ao and --lightmap exclude each other", object="ao")
        if self.max_depth is not None and (self.ao or self.lightmap is not None):
            other = "--ao" if self.ao else "--lightmap"
            raise SettingsError(f"--max-depth bounds paths; {other} traces none", object="max_depth")
        if self.ao_distance is not None and not self.ao:
            raise SettingsError("--ao-distance needs --ao", object="ao_distance")
        estimator_named(self.estimator)
        unknown = [name for name in self.aov if name not in AOVS]
        if unknown:
            raise unknown_name("AOV", unknown[0], AOVS, object="aov")

    @property
    def goal(self) -> int | None:
        """Return the samples of a pixel after which rendering ends; None if only time ends it."""
        if self.spp is not None:
            return self.spp
        return None if self.time_limit is not None else DEFAULT_SPP
