"""Reads settings from a TOML file; the command line has the last word."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from baker.core.errors import SettingsError

if TYPE_CHECKING:
    from baker.core.settings import BakeSettings

TABLE = "bake"


def read_config(path: Path) -> dict[str, Any]:
    """Return the keys of a configuration file.

    Parameters
    ----------
    path : Path
        TOML file; its keys stand at the top or in a table `[bake]`.

    Raises
    ------
    SettingsError
        If the file cannot be read, is not TOML, or mixes both places.
    """
    import tomllib

    try:
        document = tomllib.loads(path.read_text("utf-8"))
    except OSError as error:
        raise SettingsError(f"the configuration cannot be read: {error.strerror}", file=str(path)) from None
    except UnicodeDecodeError:
        raise SettingsError("the configuration is not UTF-8 text; save it as UTF-8", file=str(path)) from None
    except tomllib.TOMLDecodeError as error:
        raise SettingsError(f"the configuration is not valid TOML: {error}", file=str(path)) from None
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
