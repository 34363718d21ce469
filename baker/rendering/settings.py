"""The settings of a rendered picture."""

from __future__ import annotations

from pathlib import Path
from typing import ClassVar, Literal

from baker.core.errors import SettingsError
from baker.core.names import unknown_name
from baker.core.object_settings import ObjectRules
from baker.core.settings import BakeSettings, ao_metres
from baker.core.settings_model import Names, Numbers, Settings, Text, same_setting, setting

# Names of the layers that `aov` can request.
AOVS = ("albedo", "normal", "depth")
# Default number of paths per pixel.
DEFAULT_SPP = 64


class RenderSettings(Settings):
    """Settings of a rendered picture, with validation."""

    table: ClassVar[str] = "render"
    what: ClassVar[str] = "render setting"

    camera: Numbers | None = setting(
        None,
        "Position, target and vertical field of view in degrees; or name or number of a camera in the file. "
        "Default: the file's first camera.",
        metavar="PX,PY,PZ,TX,TY,TZ,FOV|NAME|NUMBER",
    )
    width: int = setting(640, "Width of the picture.", unit="pixels", ge=1, le=16384)
    height: int = setting(480, "Height of the picture.", unit="pixels", ge=1, le=16384)
    spp: int | None = setting(
        None,
        "Number of paths per pixel; at least two are traced. Default: 64, or no limit with `time_limit`.",
        ge=1,
    )
    time_limit: float | None = setting(
        None,
        "Stop after this time, which includes loading. At least two paths per pixel are traced.",
        unit="s",
        metavar="SECONDS",
        gt=0,
        allow_inf_nan=False,
    )
    estimator: str = setting(
        "mis",
        "Estimator: uniform, cosine, stratified, light, bsdf, mis, mis-power or bdpt.",
        metavar="NAME",
    )
    max_depth: int | None = setting(
        None,
        "Largest number of surface points that reflect light on a path; 1 is direct light only. "
        "Default: no limit.",
        ge=1,
    )
    ao: bool = setting(False, "Render ambient occlusion.")
    ao_distance: Text | None = setting(
        None,
        "Largest distance of occluders for `ao`: metres, `10%` of the scene's diagonal, or `inf`.",
        unit="m",
        metavar="DISTANCE",
    )
    aov: Names = setting((), "Further layers: albedo, normal, depth.")
    denoise: bool = setting(False, "Run Open Image Denoise over the picture.")
    lightmap: Path | None = setting(
        None,
        "Output folder of a bake. Instead of the input, its scene is rendered, lit by its lightmaps, without "
        "path tracing.",
        metavar="OUT",
    )
    sky: Numbers | None = setting(
        None,
        "Sky radiance R,G,B in cd/m2. Default: black; with `lightmap`, the sky of the bake.",
        unit="cd/m2",
        metavar="R,G,B",
    )
    sky_strength: float = same_setting(BakeSettings, "sky_strength")
    scene_name: Text | None = same_setting(BakeSettings, "scene_name")
    variant: str | None = same_setting(BakeSettings, "variant")
    animation: Text | None = same_setting(BakeSettings, "animation")
    time: float | None = same_setting(BakeSettings, "time")
    missing_textures: Literal["error", "white", "grey", "magenta"] = same_setting(
        BakeSettings, "missing_textures"
    )
    split: Literal["groups", "objects", "none"] = same_setting(BakeSettings, "split")
    unlit: Literal["block", "lit"] = same_setting(BakeSettings, "unlit")
    include: Names = same_setting(BakeSettings, "include")
    exclude: Names = same_setting(BakeSettings, "exclude")
    object: ObjectRules = same_setting(BakeSettings, "object")
    name_rules: bool = same_setting(BakeSettings, "name_rules")
    allow_outside: bool = same_setting(BakeSettings, "allow_outside")
    seed: int = same_setting(BakeSettings, "seed")
    threads: int | None = same_setting(BakeSettings, "threads")

    def check(self) -> None:
        """Raise `SettingsError` for values that cannot be combined."""
        if self.ao and self.lightmap is not None:
            raise SettingsError("`ao` and `lightmap` exclude each other", object="ao")
        if self.max_depth is not None and (self.ao or self.lightmap is not None):
            other = "`ao`" if self.ao else "`lightmap`"
            raise SettingsError(f"`max_depth` bounds paths; {other} traces none", object="max_depth")
        if self.ao_distance is not None:
            if not self.ao:
                raise SettingsError("`ao_distance` needs `ao`", object="ao_distance")
            ao_metres(self.ao_distance, 1.0)
        # The property raises an error for an invalid sky.
        self.sky_radiance  # noqa: B018
        if self.estimator != "mis":
            if self.ao or self.lightmap is not None:
                other = "`ao`" if self.ao else "`lightmap`"
                message = f"`estimator` chooses how paths are traced; {other} traces none"
                raise SettingsError(message, object="estimator")
            from baker.pathtracer.estimators import estimator_named

            estimator_named(self.estimator)
        unknown = [name for name in self.aov if name not in AOVS]
        if unknown:
            raise unknown_name("AOV", unknown[0], AOVS, object="aov")

    @property
    def sky_radiance(self) -> tuple[float, float, float]:
        """Return the radiance of the constant sky, cd/m2; black if `sky` is not set."""
        return BakeSettings(sky=self.sky, sky_strength=self.sky_strength).sky_radiance

    def ao_reach(self, diagonal: float) -> float:
        """Return the largest distance of occluders, metres; may be inf.

        diagonal : diagonal of the scene's bounding box, metres
        """
        return (
            BakeSettings().ao_reach(diagonal)
            if self.ao_distance is None
            else ao_metres(self.ao_distance, diagonal)
        )

    @property
    def goal(self) -> int | None:
        """Return the number of samples per pixel at which rendering ends; None if only time is limited."""
        if self.spp is not None:
            return self.spp
        return None if self.time_limit is not None else DEFAULT_SPP
