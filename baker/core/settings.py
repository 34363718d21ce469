"""Defines the settings of a bake, with description, unit, range and default.

The flags of the command line, the keys of the configuration file, the keywords of `baker.bake` and the
settings page of the docs are generated from `BakeSettings`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, ClassVar, Literal

from baker.core.encoding import encoding_options, encodings_in_words
from baker.core.errors import SettingsError
from baker.core.light_limits import BRIGHTEST
from baker.core.object_settings import ObjectRules
from baker.core.settings_model import (
    FILES,
    SCENE,
    Names,
    Numbers,
    Settings,
    Text,
    allow_outside_setting,
    seed_setting,
    setting,
    threads_setting,
)

# Titles of groups of settings in the help of the command line.
BAKE, LIGHT, OCCLUSION = "Bake", "Light and noise", "Ambient occlusion"
PAGES = "Lightmap uv and pages"
# Hemisphere rays per texel of each preset. They are also the default of `light_samples` and `ao_samples`.
QUALITY_SAMPLES = {"preview": 16, "medium": 64, "high": 256, "ultra": 1024}


class CommonSettings(Settings):
    """All settings of a bake except the options of encodings."""

    table: ClassVar[str] = "bake"

    channels: Names = setting(
        ("irradiance", "ao"), "Channels to bake. Default for a scene without light: ao.", group=FILES
    )
    resolution: int = setting(
        1024, "Width and height of each page.", unit="texels", ge=16, le=16384, group=BAKE
    )
    density: float | None = setting(
        None,
        "Texels per metre; adds pages as needed.",
        unit="texels/m",
        gt=0,
        allow_inf_nan=False,
        group=BAKE,
    )
    max_pages: int = setting(16, "Largest number of pages if `density` is set.", ge=1, le=256, group=PAGES)
    budget: str | None = setting(
        None,
        "Number of pages and their width, such as 2x1024: all objects get the largest density that fits.",
        metavar="NxSIZE",
        group=PAGES,
    )
    padding: int = setting(4, "Empty texels between charts.", unit="texels", ge=0, le=64, group=PAGES)
    uv: Literal["auto", "keep", "unwrap"] = setting(
        "auto", "Keep TEXCOORD_1 as lightmap uv, or unwrap; `auto` keeps it if it is valid.", group=PAGES
    )
    instances: Literal["share", "unique"] = setting(
        "share",
        "Instances of a mesh share one mesh and TEXCOORD_1 in scene.glb, or each has its own copy.",
        group=PAGES,
    )
    unwrapper: Literal["xatlas"] = setting(
        "xatlas", "Library that cuts surfaces into charts and packs them.", group=PAGES
    )
    quality: Literal["preview", "medium", "high", "ultra"] = setting(
        "medium", "Preset of `samples`: preview 16, medium 64, high 256, ultra 1024.", group=BAKE
    )
    samples: int | None = setting(
        None, "Hemisphere rays per texel; default: by `quality`.", ge=1, le=65536, group=LIGHT
    )
    light_samples: int | None = setting(
        None, "Rays per texel to emissive surfaces; default: `samples`.", ge=1, le=65536, group=LIGHT
    )
    ao_samples: int | None = setting(
        None, "AO rays per texel; default: `samples`.", ge=1, le=65536, group=OCCLUSION
    )
    ao_distance: Text = setting(
        "10%",
        "Maximum distance of AO: metres, `10%` of the scene's diagonal, or `inf`.",
        unit="m",
        group=OCCLUSION,
        metavar="DISTANCE",
    )
    sky: Numbers | None = setting(
        None, "Sky radiance R,G,B in cd/m2. Default: black.", unit="cd/m2", group=BAKE, metavar="R,G,B"
    )
    sky_strength: float = setting(1.0, "Factor of the sky radiance.", ge=0, allow_inf_nan=False, group=LIGHT)
    bounces: int | None = setting(
        None, "Number of reflections of light; default: until converged.", ge=0, le=1000, group=LIGHT
    )
    denoise: bool = setting(True, "Denoise with Open Image Denoise.", group=LIGHT)
    encode: Names = setting((), f"Additional file formats of each page: {encodings_in_words()}.", group=FILES)
    export: Names = setting(
        (),
        "Engines for which a subfolder is written: `three`, `babylon`, `godot`, `unity` ..., see ENGINES.md.",
        group=BAKE,
    )
    include: Names = setting(
        (),
        "Bake only objects with these node names or node paths; `*` and `?` are wildcards.",
        repeated=True,
        group=SCENE,
    )
    exclude: Names = setting(
        (),
        "Leave out objects and lights with these node names or node paths, and their descendants.",
        repeated=True,
        group=SCENE,
    )
    object: ObjectRules = setting(
        (),
        "Settings of the objects with these node names or node paths, and of their descendants.",
        repeated=True,
        metavar="'GLOB KEY=VALUE ...'",
        group=SCENE,
    )
    name_rules: bool = setting(
        True,
        "Leave out collision hulls and lower levels of detail, recognised by their names, like `UCX_Wall`.",
        group=SCENE,
    )
    up: Literal["y", "z"] = setting("y", "Up axis, for file formats that do not specify one.", group=SCENE)
    scale: float = setting(
        1.0,
        "Metres per unit, for file formats that do not specify their unit.",
        unit="m",
        gt=0,
        allow_inf_nan=False,
        group=SCENE,
    )
    scene_name: Text | None = setting(
        None,
        "Name or number of the scene in a glTF file; default: the file's default scene.",
        group=SCENE,
        metavar="NAME|N",
    )
    variant: str | None = setting(
        None,
        "Material variant of a glTF file; default: the materials without a variant.",
        group=SCENE,
        metavar="NAME",
    )
    animation: Text | None = setting(
        None,
        "Name or number of the animation that poses a glTF scene; default with `time`: the first one.",
        group=SCENE,
        metavar="NAME|N",
    )
    time: float | None = setting(
        None,
        "Time of the animation that poses a glTF scene; default: the pose of the file, with `animation` 0.",
        unit="s",
        ge=0,
        allow_inf_nan=False,
        group=SCENE,
        metavar="SECONDS",
    )
    missing_textures: Literal["error", "white", "grey", "magenta"] = setting(
        "error",
        "Colour that replaces unreadable textures of base colour, emission and alpha, or error.",
        group=SCENE,
    )
    split: Literal["groups", "objects", "none"] = setting(
        "groups",
        "What becomes an object of an OBJ file: each object and group, each object, or the whole file.",
        group=SCENE,
    )
    unlit: Literal["block", "lit"] = setting(
        "block",
        "Unlit materials of glTF only block light (`block`), or also reflect it like others (`lit`).",
        group=SCENE,
    )
    allow_outside: bool = allow_outside_setting()
    seed: int = seed_setting()
    threads: int | None = threads_setting()

    @classmethod
    def complete(cls, values: dict[str, Any]) -> dict[str, Any]:
        """Return the values with `resolution` and `max_pages` set to those of `budget`."""
        if values.get("budget") is None:
            return values
        pages, width = parse_budget(values["budget"])
        for name, value in (("max_pages", pages), ("resolution", width)):
            if str(values.get(name, value)) != str(value):
                message = f"`budget` and `{name}` contradict each other; leave one out"
                raise SettingsError(f"{message} (was '{values['budget']}')", object="budget")
        return {**values, "max_pages": pages, "resolution": width}

    def check(self) -> None:
        """Raise `SettingsError` if `sky` or `ao_distance` is invalid, or `channels` is empty."""
        super().check()
        if max(self.sky_radiance) > BRIGHTEST:
            raise SettingsError(f"`sky` is above {BRIGHTEST:.0e} cd/m2 (was '{self.sky}')", object="sky")
        self.ao_reach(1.0)
        if not self.channels:
            raise SettingsError("`channels` names nothing to bake", object="channels")

    @property
    def hemisphere_samples(self) -> int:
        """Return the hemisphere rays per texel: `samples`, or the preset `quality` if `samples` is None."""
        return self.samples if self.samples is not None else QUALITY_SAMPLES[self.quality]

    @property
    def sky_radiance(self) -> tuple[float, float, float]:
        """Return the radiance of the constant sky, RGB, cd/m2; 0 if `sky` is None."""
        if self.sky is None:
            return (0.0, 0.0, 0.0)
        red, green, blue = parse_sky(self.sky)
        return (red * self.sky_strength, green * self.sky_strength, blue * self.sky_strength)

    def ao_reach(self, diagonal: float) -> float:
        """Return the AO distance, metres or inf, of a scene whose bounding box has this diagonal, metres."""
        return ao_metres(self.ao_distance, diagonal)


if TYPE_CHECKING:

    class BakeSettings(CommonSettings):
        """All settings of a bake. Type checkers see only the common settings."""

else:

    class BakeSettings(*reversed(encoding_options().values()), CommonSettings):
        """All settings of a bake: the common settings and the options of each encoding."""


def ao_metres(distance: str, diagonal: float) -> float:
    """Return an AO distance in metres.

    Parameters
    ----------
    distance : str
        Metres, a percentage of the diagonal such as "10%", or "inf".
    diagonal : float
        Diagonal of the scene's bounding box, metres.

    Returns
    -------
    float
        Above 0; may be inf.

    Raises
    ------
    SettingsError
        If `distance` has another form, or is not positive.
    """
    text = distance.strip()
    try:
        metres = float(text[:-1]) / 100.0 * diagonal if text.endswith("%") else float(text)
    except ValueError:
        metres = -1.0
    if not metres > 0:
        raise SettingsError(
            f"`ao_distance` is not a positive number of metres, a percentage or inf (was '{distance}')",
            object="ao_distance",
        )
    return metres


def parse_budget(text: object) -> tuple[int, int]:
    """Return the number of pages and the width of a page of the setting `budget`.

    Parameters
    ----------
    text : object
        A text such as "2x1024".

    Returns
    -------
    pages : int
    width : int
        Texels.

    Raises
    ------
    SettingsError
        If the text has another form.
    """
    numbers = str(text).lower().split("x")
    if len(numbers) != 2 or not all(number.strip().isdecimal() for number in numbers):
        message = "`budget` is not a number of pages and their width, like 2x1024"
        raise SettingsError(f"{message} (was {text!r})", object="budget")
    return int(numbers[0]), int(numbers[1])


def parse_sky(text: str) -> tuple[float, float, float]:
    """Return the radiance of a constant sky.

    Parameters
    ----------
    text : str
        Three numbers separated by commas, or one number for all three.

    Returns
    -------
    tuple of three floats
        Red, green, blue, cd/m2.

    Raises
    ------
    SettingsError
        If the text has another form, or a number is negative, infinite or NaN.
    """
    try:
        values = [float(part) for part in text.split(",")]
    except ValueError:
        values = []
    if len(values) == 1:
        values *= 3
    if len(values) != 3 or any(not 0.0 <= v < float("inf") for v in values):
        message = f"`sky` is not three numbers R,G,B of zero or more, like 1,1,1 (was '{text}')"
        raise SettingsError(message, object="sky")
    return (values[0], values[1], values[2])


def make_settings(values: Mapping[str, Any]) -> BakeSettings:
    """Return the settings of a bake; an invalid value raises `SettingsError`.

    Parameters
    ----------
    values : mapping of str to object
        Values by name of the setting. Dashes in names are read as underscores.

    Returns
    -------
    BakeSettings
        With defaults for settings that `values` does not contain.
    """
    return BakeSettings.make(values)
