"""Defines the base of all settings: pydantic models whose fields become flags, configuration keys and docs.

Every command has a subclass of `Settings`. Each field is made with `setting`, which takes its description,
unit, range and default. `docs/make_settings_page.py` makes the settings page of the fields, `cli/command.py`
makes flags of them, and `docs/make_keywords.py` makes keywords of the Python API.
"""

from __future__ import annotations

from collections.abc import Mapping
from copy import copy
from typing import Annotated, Any, ClassVar, Self

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError

from baker.core.errors import SettingsError
from baker.core.names import unknown_setting

# Largest number of characters of an invalid value that an error quotes.
_LONGEST = 80
# Titles of groups of settings in the help: settings that every command has, settings of the files that a bake
# writes, and settings of reading scene files.
RUN, FILES, SCENE = "Run", "Files", "Scene"


def setting(
    default: Any,
    description: str,
    *,
    unit: str = "",
    metavar: str = "",
    group: str = "",
    repeated: bool = False,
    **bounds: Any,
) -> Any:
    """Return a field of a settings model.

    Parameters
    ----------
    default : object
        Default value.
    description : str
        Effect of the setting, one sentence.
    unit : str
        Unit of the value; empty for values without a unit.
    metavar : str
        Placeholder of the value in the help; by default, it is derived from the type.
    group : str
        Title of the group of the setting in the help; empty for the common options of a command.
    repeated : bool
        Whether the flag may be given several times, in which case its values are concatenated.
    **bounds : object
        Arguments of `pydantic.Field` that limit the value: ge, gt, le, lt, allow_inf_nan.

    Returns
    -------
    FieldInfo
        Declared as Any, so that the field can be annotated with the type of its value.
    """
    extra: dict[str, Any] = {"unit": unit, "metavar": metavar, "group": group, "repeated": repeated}
    return Field(default, description=description, json_schema_extra=extra, **bounds)


def same_setting(model: type[Settings], name: str) -> Any:
    """Return a copy of a field of another model, so that two models can share a setting.

    Parameters
    ----------
    model : type of Settings
        The model that declares the setting.
    name : str
        Name of the setting.

    Returns
    -------
    FieldInfo
        Declared as Any, like the result of `setting`.
    """
    return copy(model.model_fields[name])


def _split(value: Any) -> Any:
    """Split a text, or each text of a list, at commas; return the names without repeats.

    Values of other types are returned unchanged.
    """
    if isinstance(value, list | tuple) and all(isinstance(part, str) for part in value):
        value = ",".join(value)
    if not isinstance(value, str):
        return value
    return list(dict.fromkeys(part.strip() for part in value.split(",") if part.strip()))


def _one_name(value: Any) -> Any:
    """Return a text as a list with one element; return other values unchanged."""
    return [value] if isinstance(value, str) else value


def _as_list_text(value: Any) -> Any:
    """Return a number, or a flat list joined with commas, as text; return other values unchanged."""
    value = _plain(value)
    if isinstance(value, list | tuple) and all(not isinstance(part, list | tuple | dict) for part in value):
        return ",".join(map(str, value))
    return _as_text(value)


def _as_text(value: Any) -> Any:
    """Return a number as text; return other values unchanged."""
    value = _plain(value)
    return str(value) if isinstance(value, int | float) and not isinstance(value, bool) else value


def _plain(value: Any) -> Any:
    """Convert a NumPy number or array to a Python number or list; return other values unchanged."""
    return value.tolist() if hasattr(value, "dtype") and hasattr(value, "tolist") else value


# Marks a type whose values a function converts before validation.
Convert = BeforeValidator
# A list of names, given as a list or as one text with commas.
Names = Annotated[tuple[str, ...], BeforeValidator(_split)]
# A list of texts that may contain commas, given as a list or, if it has one element, as a text.
Texts = Annotated[tuple[str, ...], BeforeValidator(_one_name)]
# A text, given as a text or as a number.
Text = Annotated[str, BeforeValidator(_as_text)]
# A text of numbers separated by commas, given as a text, as a number or as a list of numbers.
Numbers = Annotated[str, BeforeValidator(_as_list_text)]


class Settings(BaseModel):
    """Base class of settings models; an invalid value raises `SettingsError`.

    Attributes
    ----------
    table : str
        Name of the table of the configuration file that contains these settings; empty if there is none.
    what : str
        Kind of setting in messages about unknown names: "there is no {what} 'x'".
    """

    model_config = ConfigDict(frozen=True, extra="forbid")
    table: ClassVar[str] = ""
    what: ClassVar[str] = "setting"

    def __init__(self, **values: Any) -> None:
        clean: dict[str, Any] = {}
        for key, value in values.items():
            name = key.replace("-", "_")
            if name not in type(self).model_fields:
                raise unknown_setting(self.what, key, list(type(self).model_fields), object=key)
            if name in clean:
                raise SettingsError(f"'{key}' is given twice", object=key)
            clean[name] = value
        try:
            super().__init__(**type(self).complete(clean))
        except ValidationError as error:
            first = error.errors()[0]
            name = str(first["loc"][0]) if first["loc"] else ""
            text = first["msg"].removesuffix(" for <class 'pathlib.Path'>")
            message = f"`{name}`{text[5:]}" if text.startswith("Input ") else f"`{name}`: {text}"
            was = repr(first["input"])
            was = was if len(was) <= _LONGEST else f"{was[:_LONGEST]}..."
            raise SettingsError(f"{message} (was {was})", object=name) from None
        self.check()

    def __setattr__(self, name: str, value: Any) -> None:
        raise SettingsError(
            f"settings are not changed in place; changed({name}=...) returns a copy", object=name
        )

    @classmethod
    def complete(cls, values: dict[str, Any]) -> dict[str, Any]:
        """Return the given values by name, with those of settings that follow from other settings."""
        return values

    def check(self) -> None:
        """Raise `SettingsError` for invalid values or combinations that types and bounds do not exclude."""

    @classmethod
    def make(cls, values: Mapping[str, Any], *, file: str | None = None) -> Self:
        """Return the settings with given values.

        Parameters
        ----------
        values : mapping of str to object
            Values by name of the setting. Dashes in names are read as underscores.
        file : str or None
            File that contains the values, which the error names.

        Returns
        -------
        Settings
            An object of the class that the method is called on.

        Raises
        ------
        SettingsError
            For an unknown name, a name that is given twice, or an invalid value.
        """
        try:
            return cls(**values)
        except SettingsError as error:
            if file is None:
                raise
            raise SettingsError(error.message, file=file, object=error.object) from None

    def changed(self, **values: Any) -> Self:
        """Return a copy with some values replaced, after validation.

        Parameters
        ----------
        **values : object
            New values by name of the setting.

        Returns
        -------
        Settings
            An object of the same class.
        """
        return type(self)(**{**{name: getattr(self, name) for name in self.model_fields_set}, **values})

    def is_given(self, name: str) -> bool:
        """Return whether a setting was given, even if its value is the default.

        Parameters
        ----------
        name : str
            Name of the setting.

        Returns
        -------
        bool
            False if the setting was left out and therefore has its default.
        """
        return name in self.model_fields_set


def seed_setting() -> Any:
    """Return the field `seed`, which all commands share.

    Returns
    -------
    FieldInfo
        For `seed: int`.
    """
    return setting(0, "Seed of all random numbers.", group=RUN, ge=0, le=2**31 - 1)


def threads_setting() -> Any:
    """Return the field `threads`, which all commands share.

    Returns
    -------
    FieldInfo
        For `threads: int | None`.
    """
    return setting(None, "Number of threads; default: all cores.", group=RUN, ge=1, le=1024)


def allow_outside_setting() -> Any:
    """Return the field `allow_outside`, which all commands that read scene files share.

    Returns
    -------
    FieldInfo
        For `allow_outside: bool`.
    """
    return setting(False, "Also read referenced files outside the scene's folder.", group=SCENE)


class RunSettings(Settings):
    """The settings that every command accepts."""

    seed: int = seed_setting()
    threads: int | None = threads_setting()
