"""What a bake can be told: every setting once, with its meaning, unit, range and default.

The command line, the configuration file and the settings page of the docs are made from this class.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal

from baker.core.encoding import encoding_options, encodings_in_words
from baker.core.errors import SettingsError
from baker.core.light_limits import BRIGHTEST
from baker.core.names import unknown_name
from baker.core.options import BaseModel, ConfigDict, Field, ValidationError

# Hemisphere rays per texel for each preset. Light samples per texel are as many.
QUALITY_SAMPLES = {"preview": 16, "medium": 64, "high": 256, "ultra": 1024}

# Settings that are lists of names: with commas on the command line.
_LISTS = {"channels", "encode", "exclude", "export", "include"}
# Lists that may be given several times.
REPEATED = frozenset({"exclude", "include"})


class CommonSettings(BaseModel):
    """The settings of a bake that no plugin brings."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    channels: tuple[str, ...] = Field(("irradiance", "ao"), description="What to bake.")
    resolution: int = Field(1024, ge=16, le=16384, description="Page width and height in texels, exact.")
    density: float | None = Field(None, gt=0, description="Texels per metre; pages overflow into more.")
    max_pages: int = Field(16, ge=1, le=256, description="Most pages that --density may fill.")
    padding: int = Field(4, ge=0, le=64, description="Empty texels between charts.")
    uv: Literal["auto", "keep", "unwrap"] = Field("auto", description="Keep a valid TEXCOORD_1, or unwrap.")
    unwrapper: Literal["xatlas"] = Field("xatlas", description="Library that cuts and packs charts.")
    quality: Literal["preview", "medium", "high", "ultra"] = Field(
        "medium", description="Preset of samples: preview 16, medium 64, high 256, ultra 1024."
    )
    samples: int | None = Field(
        None, ge=1, le=65536, description="Hemisphere rays per texel; default by quality."
    )
    light_samples: int | None = Field(
        None, ge=1, le=65536, description="Shadow rays per texel; default: samples."
    )
    ao_samples: int | None = Field(None, ge=1, le=65536, description="AO rays per texel; default: samples.")
    ao_distance: str = Field(
        "10%", description="Reach of AO: metres, `10%` of the scene's diagonal, or `inf`."
    )
    sky: str | None = Field(None, description="Sky radiance R,G,B in cd/m2.")
    sky_strength: float = Field(1.0, ge=0, allow_inf_nan=False, description="Factor on the sky.")
    bounces: int | None = Field(
        None, ge=0, le=1000, description="Reflections of light; default: until converged."
    )
    denoise: bool = Field(True, description="Denoise with Open Image Denoise.")
    encode: tuple[str, ...] = Field((), description=f"Further files of each page: {encodings_in_words()}.")
    export: tuple[str, ...] = Field(
        (), description="Folders ready for engines: `three`, `babylon`, `godot`, `unity` ..., see ENGINES.md."
    )
    include: tuple[str, ...] = Field(
        (), description="Bake only objects with these names or paths of nodes (`*` and `?` stand for others)."
    )
    exclude: tuple[str, ...] = Field(
        (), description="Leave out objects and lights with these names or paths of nodes, and what is below."
    )
    up: Literal["y", "z"] = Field("y", description="Up axis of OBJ, PLY, STL and OFF files.")
    scale: float = Field(1.0, gt=0, description="Metres per unit of OBJ, PLY, STL and OFF files.")
    seed: int = Field(0, ge=0, le=2**31 - 1, description="Seed of all random numbers.")
    threads: int | None = Field(None, ge=1, le=1024, description="Threads; default: all cores.")

    @property
    def hemisphere_samples(self) -> int:
        """Return the hemisphere rays per texel that `samples` or `quality` asks for."""
        return self.samples if self.samples is not None else QUALITY_SAMPLES[self.quality]

    @property
    def sky_radiance(self) -> tuple[float, float, float]:
        """Return the constant sky's radiance in cd/m2 (black if none was asked for)."""
        if self.sky is None:
            return (0.0, 0.0, 0.0)
        red, green, blue = parse_sky(self.sky)
        return (red * self.sky_strength, green * self.sky_strength, blue * self.sky_strength)

    def ao_reach(self, diagonal: float) -> float:
        """Return the AO distance in metres for a scene of this diagonal (may be inf)."""
        text = self.ao_distance.strip()
        try:
            reach = float(text[:-1]) / 100.0 * diagonal if text.endswith("%") else float(text)
        except ValueError:
            reach = -1.0
        if not reach > 0:
            raise SettingsError(
                f"ao_distance '{self.ao_distance}' is not a positive number of metres, a percentage or inf"
            )
        return reach


if TYPE_CHECKING:

    class BakeSettings(CommonSettings):
        """All settings of a bake, checked; a type checker sees those of no plugin."""

else:

    class BakeSettings(*reversed(encoding_options().values()), CommonSettings):
        """All settings of a bake, checked: common ones, and the options of each encoding."""


def parse_sky(text: str) -> tuple[float, float, float]:
    """Return R, G, B of a `--sky` value, or raise `SettingsError`."""
    try:
        values = [float(part) for part in text.split(",")]
    except ValueError:
        values = []
    if len(values) == 1:
        values *= 3
    if len(values) != 3 or any(not 0.0 <= v < float("inf") for v in values):
        raise SettingsError(f"sky '{text}' is not three numbers R,G,B of zero or more, like 1,1,1")
    return (values[0], values[1], values[2])


def make_settings(values: dict[str, Any]) -> BakeSettings:
    """Check `values` and return settings.

    Parameters
    ----------
    values : dict
        Setting names and values; a dash in a name counts as an underscore.

    Raises
    ------
    SettingsError
        For an unknown name (with the nearest known one) or a value out of range.
    """
    known = list(BakeSettings.model_fields)
    clean: dict[str, Any] = {}
    for key, value in values.items():
        name = key.replace("-", "_")
        if name not in known:
            raise unknown_name("setting", key, known, object=key)
        if name in {"ao_distance", "sky"} and isinstance(value, int | float):
            value = str(value)
        if name == "sky" and isinstance(value, list | tuple):
            value = ",".join(str(v) for v in value)
        if name in REPEATED and isinstance(value, list | tuple):
            value = ",".join(map(str, value))
        if name in _LISTS and isinstance(value, str):
            value = [part.strip() for part in value.split(",") if part.strip()]
        clean[name] = value
    try:
        settings = BakeSettings(**clean)
    except ValidationError as error:
        first = error.errors()[0]
        name = ".".join(str(part) for part in first["loc"])
        raise SettingsError(f"{name}: {first['msg']} (was {first['input']!r})", object=name) from None
    if max(settings.sky_radiance) > BRIGHTEST:
        raise SettingsError(f"sky: {settings.sky} is above {BRIGHTEST:.0e} cd/m2", object="sky")
    settings.ao_reach(1.0)
    if not settings.channels:
        raise SettingsError("channels names nothing to bake", object="channels")
    return settings
