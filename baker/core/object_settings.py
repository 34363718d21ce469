"""Defines the settings that objects may have individually, and the text form of the rules that set them.

A rule is a text such as `'props/* cast=false density=2x'`: a wildcard pattern of node names or node paths,
then keys with values. `baker.io.object_rules` determines the settings of each object of a scene.
"""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Literal

from baker.core.errors import SettingsError
from baker.core.settings_model import Convert, Settings, Text, setting

# Key of a rule, written as a table, that contains its pattern.
MATCH = "match"


class ObjectSettings(Settings):
    """Settings of one object. The defaults leave the object as a bake without these settings treats it."""

    what: ClassVar[str] = "object key"

    receive: bool = setting(
        True, "Whether the object gets texels. Without texels, it still blocks and reflects light."
    )
    cast: bool = setting(
        True,
        "Whether rays hit the object. If false, it casts no shadow, reflects and emits no light, and has no "
        "effect on AO; it still gets texels.",
    )
    visible_to_ao: bool | None = setting(
        None, "Whether AO rays of all objects hit this object; default: the value of `cast`."
    )
    density: Text | None = setting(
        None,
        "Texels per metre, such as 40; or a factor on the density of objects without this key, such as 2x.",
        metavar="NUMBER|NUMBERx",
    )
    group: Text = setting("", "Name of a group. The objects of a group have pages of their own.")
    samples: float = setting(
        1.0,
        "Factor on the numbers of rays per texel: `samples`, `light_samples` and `ao_samples`.",
        ge=1.0 / 16.0,
        le=16.0,
        allow_inf_nan=False,
    )
    double_sided: bool | None = setting(
        None, "Whether the object's materials are double-sided; default: as in the file."
    )
    emissive: bool = setting(True, "Whether the object's emissive materials emit light.")
    bounce: bool = setting(True, "Whether the object reflects light. If false, it is black to all rays.")
    uv: Literal["auto", "keep", "unwrap"] | None = setting(
        None,
        "Keep TEXCOORD_1 of the object as lightmap uv, or unwrap; default: the setting `uv` of the bake.",
    )
    exclude: bool = setting(
        False, "Leave the object out of the bake; it stays in scene.glb without a lightmap."
    )

    def check(self) -> None:
        """Raise `SettingsError` if `density` is invalid."""
        super().check()
        density_of(self.density)

    @property
    def texels_per_metre(self) -> float | None:
        """Return the absolute density, texels per metre; None if none is set."""
        value, relative = density_of(self.density)
        return None if relative else value

    @property
    def density_factor(self) -> float:
        """Return the factor on the density; 1 if no factor is set."""
        value, relative = density_of(self.density)
        return value if relative else 1.0

    @property
    def resized(self) -> bool:
        """Return whether the object has a density of its own."""
        return density_of(self.density) != (1.0, True)

    @property
    def blocks_ao(self) -> bool:
        """Return whether AO rays hit the object."""
        return self.cast if self.visible_to_ao is None else self.visible_to_ao

    def given(self) -> dict[str, Any]:
        """Return the settings that differ from the defaults, as plain JSON values."""
        return {
            name: value
            for name, value in self.model_dump(mode="json").items()
            if value != type(self).model_fields[name].default
        }


def density_of(text: str | None) -> tuple[float, bool]:
    """Return the number of the key `density`, and whether it is a factor.

    Parameters
    ----------
    text : str or None
        Texels per metre such as "40", or a factor such as "2x".

    Returns
    -------
    value : float
        1 for None.
    relative : bool
        Whether `value` is a factor on the density of other objects.

    Raises
    ------
    SettingsError
        If the text has another form, or the number is not positive.
    """
    if text is None:
        return 1.0, True
    relative = text.strip().lower().endswith("x")
    try:
        value = float(text.strip()[:-1] if relative else text)
    except ValueError:
        value = 0.0
    if not 0.0 < value < float("inf"):
        message = "`density` is neither texels per metre, like 40, nor a factor, like 2x"
        raise SettingsError(f"{message} (was '{text}')", object="density")
    return value, relative


def parse_rule(rule: str) -> tuple[str, dict[str, str]]:
    """Return the pattern and the values of a rule.

    Parameters
    ----------
    rule : str
        A pattern, then pairs key=value, separated by spaces. A pattern with spaces is quoted.

    Returns
    -------
    pattern : str
        The pattern of names.
    values : dict of str to str
        Values by key, which are not validated yet.

    Raises
    ------
    SettingsError
        If the text has another form.
    """
    try:
        words = shlex.split(rule)
    except ValueError as error:
        raise SettingsError(f"`object` '{rule}' has a quote without end ({error})", object="object") from None
    if not words or "=" in words[0]:
        message = f"`object` starts with a pattern of names, like 'props/* cast=false' (was '{rule}')"
        raise SettingsError(message, object="object")
    values = {}
    for word in words[1:]:
        key, found, value = word.partition("=")
        if not found:
            message = f"`object` '{rule}': '{word}' is not of the form key=value"
            raise SettingsError(f"{message}; quote a pattern that has spaces", object="object")
        if key in values:
            raise SettingsError(f"`object` '{rule}': '{key}' is given twice", object="object")
        values[key] = value
    if not values:
        message = f"`object` '{rule}' sets nothing; write pattern and keys in one text, 'props/* density=40'"
        raise SettingsError(message, object="object")
    return words[0], values


def object_settings(values: Mapping[str, Any], where: str) -> ObjectSettings:
    """Return validated settings of an object.

    Parameters
    ----------
    values : mapping of str to object
        Values by key.
    where : str
        Start of the message of an error, such as "extras.baker".

    Returns
    -------
    ObjectSettings
        The settings; only the keys in `values` are given.

    Raises
    ------
    SettingsError
        For an unknown key, with the nearest known key, and for an invalid value.
    """
    try:
        return ObjectSettings(**values)
    except SettingsError as error:
        # Backquotes mark settings of the bake, which the command line prints as flags.
        message = error.message.replace("`", "'")
        raise SettingsError(f"{where}: {message}", object=error.object) from None


def _rules(value: Any) -> Any:
    """Return rules, given as a text, a table or a list of these, as a list of texts with valid keys."""
    items = [value] if isinstance(value, str | Mapping) else value
    if not isinstance(items, list | tuple):
        return value
    return [_rule(item) for item in items]


def _rule(item: Any) -> str:
    """Return a rule, given as a text or as a table, as text."""
    if isinstance(item, Mapping):
        pattern = item.get(MATCH)
        if not isinstance(pattern, str) or not pattern:
            message = f"[[object]] needs the key '{MATCH}' with a pattern of names, like {MATCH} = 'props/*'"
            raise SettingsError(message, object="object")
        words = [f"{key}={_word(value)}" for key, value in item.items() if key != MATCH]
        item = " ".join(shlex.quote(word) for word in (pattern, *words))
    if not isinstance(item, str):
        raise SettingsError(f"`object` is a list of rules like 'props/* cast=false' (was {item!r})")
    object_settings(parse_rule(item)[1], f"`object` '{item}'")
    return item


def _word(value: Any) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)


# Rules in order, as texts; later rules override earlier ones.
ObjectRules = Annotated[tuple[str, ...], Convert(_rules)]
# The settings of an object to which nothing applies.
NEUTRAL = ObjectSettings()
