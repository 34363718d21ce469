"""The settings of a rendered picture."""

from __future__ import annotations

from pathlib import Path
from typing import ClassVar

from baker.core.errors import SettingsError
from baker.core.names import unknown_name
from baker.core.settings import BakeSettings, ao_metres
from baker.core.settings_model import Names, Numbers, Settings, Text, same_setting, setting

AOVS = ("albedo", "normal", "depth")
DEFAULT_SPP = 64


class RenderSettings(Settings):
    """Holds the settings of a picture, checked."""

    table: ClassVar[str] = "render"
    what: ClassVar[str] = "render setting"

    camera: Numbers | None = setting(
        None,
        "Position, target, vertical field of view in degrees; or one of the file's own; default: its first.",
        metavar="PX,PY,PZ,TX,TY,TZ,FOV|NAME|NUMBER",
    )
    width: int = setting(640, "Width of the picture.", unit="pixels", ge=1, le=16384)
    height: int = setting(480, "Height of the picture.", unit="pixels", ge=1, le=16384)
    spp: int | None = setting(
        None, "Paths for each pixel, at least two passes of them; default: 64, or by `time_limit`.", ge=1
    )
    time_limit: float | None = setting(
        None,
        "Stop after this time, loading included; two passes are always made.",
        unit="s",
        metavar="SECONDS",
        gt=0,
        allow_inf_nan=False,
    )
    estimator: str = setting(
        "mis", "One of uniform, cosine, stratified, light, bsdf, mis, mis-power, bdpt.", metavar="NAME"
    )
    max_depth: int | None = setting(
        None, "Longest path, in vertices after the camera; 1 is direct light only, default: unlimited.", ge=1
    )
    ao: bool = setting(False, "Render ambient occlusion.")
    ao_distance: Text | None = setting(
        None, "Maximum distance of AO: metres, `10%` of the scene's diagonal, or `inf`.", unit="m"
    )
    aov: Names = setting((), "Further layers: albedo, normal, depth.")
    denoise: bool = setting(False, "Run Open Image Denoise over the picture.")
    lightmap: Path | None = setting(None, "Light the scene by this bake instead.", metavar="OUT")
    sky: Numbers | None = setting(
        None, "Sky radiance R,G,B in cd/m2; default: black, with `lightmap` the bake's own.", unit="cd/m2"
    )
    sky_strength: float = same_setting(BakeSettings, "sky_strength")
    seed: int = same_setting(BakeSettings, "seed")
    threads: int | None = same_setting(BakeSettings, "threads")

    def check(self) -> None:
        """Raise `SettingsError` for values that do not go together."""
        if self.ao and self.lightmap is not None:
            raise SettingsError("`ao` and `lightmap` exclude each other", object="ao")
        if self.max_depth is not None and (self.ao or self.lightmap is not None):
            other = "`ao`" if self.ao else "`lightmap`"
            raise SettingsError(f"`max_depth` bounds paths; {other} traces none", object="max_depth")
        if self.ao_distance is not None:
            if not self.ao:
                raise SettingsError("`ao_distance` needs `ao`", object="ao_distance")
            ao_metres(self.ao_distance, 1.0)
        # Checks the sky.
        self.sky_radiance  # noqa: B018
        if self.estimator != "mis":
            from baker.pathtracer.estimators import estimator_named

            estimator_named(self.estimator)
        unknown = [name for name in self.aov if name not in AOVS]
        if unknown:
            raise unknown_name("AOV", unknown[0], AOVS, object="aov")

    @property
    def sky_radiance(self) -> tuple[float, float, float]:
        """Return the constant sky's radiance in cd/m2 (black if none is set)."""
        return BakeSettings(sky=self.sky, sky_strength=self.sky_strength).sky_radiance

    def ao_reach(self, diagonal: float) -> float:
        """Return the AO distance in metres for a scene of this diagonal (may be inf)."""
        return (
            BakeSettings().ao_reach(diagonal)
            if self.ao_distance is None
            else ao_metres(self.ao_distance, diagonal)
        )

    @property
    def goal(self) -> int | None:
        """Return the samples of a pixel after which rendering ends; None if only time ends it."""
        if self.spp is not None:
            return self.spp
        return None if self.time_limit is not None else DEFAULT_SPP
