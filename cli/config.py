"""Reads settings from a TOML file; the command line has the last word."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from baker.core.errors import SettingsError

if TYPE_CHECKING:
    from baker.core.settings import BakeSettings

TABLE = "bake"
# Tables of other commands in the same file.
CHECK_TABLE = "check"


def read_config(path: Path) -> dict[str, Any]:
    """Return the keys of a configuration file.

    Parameters
    ----------
    path : Path
        TOML file; its keys stand at the top or in a table `[bake]`. A table `[check]` is passed by.

    Raises
    ------
    SettingsError
        If the file cannot be read, is not TOML, or mixes both places.
    """
    document = _read_toml(path)
    document.pop(CHECK_TABLE, None)
    if TABLE not in document:
        return document
    table = document.pop(TABLE)
    if not isinstance(table, dict):
        raise SettingsError(
            f"'{TABLE}' must be a table of settings, written [{TABLE}]", file=str(path), object=TABLE
        )
    if document:
        stray = next(iter(document))
        why = f"'{stray}' stands outside [{TABLE}]; move every setting into it, or drop the table"
        raise SettingsError(why, file=str(path), object=stray)
    return table


def read_check_config(path: Path) -> dict[str, Any]:
    """Return the keys of the table `[check]` of a configuration file, none if it is not there.

    Raises
    ------
    SettingsError
        If the file cannot be read or is not TOML, or `check` is no table.
    """
    table = _read_toml(path).get(CHECK_TABLE, {})
    if not isinstance(table, dict):
        why = f"'{CHECK_TABLE}' must be a table of settings, written [{CHECK_TABLE}]"
        raise SettingsError(why, file=str(path), object=CHECK_TABLE)
    return table


def _read_toml(path: Path) -> dict[str, Any]:
    import tomllib

    try:
        return tomllib.loads(path.read_text("utf-8"))
    except OSError as error:
        raise SettingsError(f"the configuration cannot be read: {error.strerror}", file=str(path)) from None
    except UnicodeDecodeError:
        raise SettingsError("the configuration is not UTF-8 text; save it as UTF-8", file=str(path)) from None
    except tomllib.TOMLDecodeError as error:
        raise SettingsError(f"the configuration is not valid TOML: {error}", file=str(path)) from None


def resolve(command_line: dict[str, Any], config: Path | None) -> BakeSettings:
    """Return the settings of a run: defaults, then the file, then the command line.

    Raises
    ------
    SettingsError
        For an unknown key or a value out of range, naming the file it came from.
    """
    from baker.core.settings import make_settings

    values: dict[str, Any] = {}
    if config is not None:
        table = read_config(config)
        for key, value in table.items():
            name = key.replace("-", "_")
            if name in values:
                raise SettingsError(f"'{key}' is given twice", file=str(config), object=key)
            values[name] = value
        try:
            # By itself first, so that a mistake in the file is blamed on the file.
            make_settings(table)
        except SettingsError as error:
            raise SettingsError(error.message, file=str(config), object=error.object) from None
    return make_settings({**values, **command_line})
