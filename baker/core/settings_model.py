"""The base of all settings: pydantic models whose fields become flags, configuration keys and docs.

Every command declares its settings as one subclass of `Settings`. A field is made with `setting`, which keeps
its meaning, unit, range and default in one place; `docs/make_settings_page.py` prints them, `cli/command.py`
makes flags of them, and `docs/make_keywords.py` makes the keywords of the Python API.
"""

from __future__ import annotations

from collections.abc import Mapping
from copy import copy
from typing import Annotated, Any, ClassVar, Self

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError

from baker.core.errors import SettingsError
from baker.core.names import unknown_name

# Characters of a wrong value that an error repeats.
_LONGEST = 80


def setting(
    default: Any,
    description: str,
    *,
    unit: str = "",
    metavar: str = "",
    repeated: bool = False,
    **bounds: Any,
) -> Any:
    """Return a field of a settings model.

    Parameters
    ----------
    default : object
        Value of the setting where nothing is given.
    description : str
        Effect of the setting, a sentence.
    unit : str
        Unit of its value, empty for numbers without one.
    metavar : str
        Placeholder of the value in the help; made from the type if empty.
    repeated : bool
        The flag may be given several times; the values are joined.
    **bounds : object
        Limits as pydantic names them: ge, gt, le, lt, allow_inf_nan.

    Returns
    -------
    FieldInfo
        Typed as Any, so that a field can be annotated with the type of its value.
    """
    extra: dict[str, Any] = {"unit": unit, "metavar": metavar, "repeated": repeated}
    return Field(default, description=description, json_schema_extra=extra, **bounds)


def same_setting(model: type[Settings], name: str) -> Any:
    """Return a field of another model, for a model that has the same setting.

    Parameters
    ----------
    model : type of Settings
        The model that declares the setting.
    name : str
        Of the setting.

    Returns
    -------
    FieldInfo
        Typed as Any, as that of `setting`.
    """
    return copy(model.model_fields[name])


def _split(value: Any) -> Any:
    """Return the names in a text with commas, or in a list of such texts; other values as they are."""
    if isinstance(value, list | tuple) and all(isinstance(part, str) for part in value):
        value = ",".join(value)
    return [part.strip() for part in value.split(",") if part.strip()] if isinstance(value, str) else value


def _one_name(value: Any) -> Any:
    """Return a text as a list of one; other values as they are."""
    return [value] if isinstance(value, str) else value


def _as_list_text(value: Any) -> Any:
    """Return numbers, and lists of them with commas, as text; other values as they are."""
    value = _plain(value)
    if isinstance(value, list | tuple) and all(not isinstance(part, list | tuple | dict) for part in value):
        return ",".join(map(str, value))
    return _as_text(value)


def _as_text(value: Any) -> Any:
    """Return a number as text; other values as they are."""
    value = _plain(value)
    return str(value) if isinstance(value, int | float) and not isinstance(value, bool) else value


def _plain(value: Any) -> Any:
    """Return a number or an array of numpy as a number or a list of Python; other values as they are."""
    return value.tolist() if hasattr(value, "dtype") and hasattr(value, "tolist") else value


# A list of names, written with commas in one text or as a list.
Names = Annotated[tuple[str, ...], BeforeValidator(_split)]
# A list of texts that may hold commas.
Texts = Annotated[tuple[str, ...], BeforeValidator(_one_name)]
# A text that may be given as a number.
Text = Annotated[str, BeforeValidator(_as_text)]
# A text of numbers with commas, which may be given as a number or a list of numbers.
Numbers = Annotated[str, BeforeValidator(_as_list_text)]


class Settings(BaseModel):
    """Holds the settings of one kind of work; an invalid value raises `SettingsError`.

    Attributes
    ----------
    table : str
        Table of a configuration file that holds these settings, empty if there is none.
    what : str
        Word for an unknown name in the error message.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")
    table: ClassVar[str] = ""
    what: ClassVar[str] = "setting"

    def __init__(self, **values: Any) -> None:
        clean: dict[str, Any] = {}
        for key, value in values.items():
            name = key.replace("-", "_")
            if name not in type(self).model_fields:
                raise unknown_name(self.what, key, list(type(self).model_fields), object=key)
            if name in clean:
                raise SettingsError(f"'{key}' is given twice", object=key)
            clean[name] = value
        try:
            super().__init__(**clean)
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

    def check(self) -> None:
        """Raise `SettingsError` for values that do not go together; a subclass may override it."""

    @classmethod
    def make(cls, values: Mapping[str, Any], *, file: str | None = None) -> Self:
        """Return settings of values by name.

        Parameters
        ----------
        values : mapping of str to object
            Names and values; a dash in a name counts as an underscore.
        file : str or None
            The file they come from, for the error.

        Returns
        -------
        Settings
            An object of the class itself.

        Raises
        ------
        SettingsError
            For an unknown name (with the nearest known one) or a value out of range.
        """
        try:
            return cls(**values)
        except SettingsError as error:
            if file is None:
                raise
            raise SettingsError(error.message, file=file, object=error.object) from None

    def changed(self, **values: Any) -> Self:
        """Return a checked copy with other values.

        Parameters
        ----------
        **values : object
            Settings by name.

        Returns
        -------
        Settings
            An object of the same class.
        """
        return type(self)(**{**{name: getattr(self, name) for name in type(self).model_fields}, **values})


def seed_setting() -> Any:
    """Return the field `seed`, which all commands share.

    Returns
    -------
    FieldInfo
        For `seed: int`.
    """
    return setting(0, "Seed of all random numbers.", ge=0, le=2**31 - 1)


def threads_setting() -> Any:
    """Return the field `threads`, which all commands share.

    Returns
    -------
    FieldInfo
        For `threads: int | None`.
    """
    return setting(None, "Threads; default: all cores.", ge=1, le=1024)


class RunSettings(Settings):
    """Holds the settings that every command takes."""

    seed: int = seed_setting()
    threads: int | None = threads_setting()
