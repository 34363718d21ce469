"""Reads settings from a TOML file; the command line has the last word."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any

from baker.cli.flags import in_keys
from baker.core.errors import SettingsError
from baker.core.names import unknown_name
from baker.core.settings_model import Settings

# Its keys may also be at the top level of the file.
TOP_TABLE = "bake"
# Tables of a configuration file, one for each model of settings that has one.
TABLES = ("bake", "check", "verify", "render", "diff", "repair")
# Lists of a file to which the command line adds.
_ADDED = {"ignore"}


def read_config(path: Path, name: str = TOP_TABLE) -> dict[str, Any]:
    """Return the keys of one table of a configuration file, none if it is not there.

    Parameters
    ----------
    path : Path
        TOML file with a table for each kind of settings. Those of a bake may be at the top level instead.
    name : str
        Of the table.

    Returns
    -------
    dict
        Values by key, as they are written.

    Raises
    ------
    SettingsError
        If the file cannot be read, is not TOML, has an unknown table or something else in place of the table,
        or mixes settings at the top with a table `[bake]`.
    """
    document = _read_toml(path)
    for key, value in document.items():
        if isinstance(value, dict) and key not in TABLES and key.replace("-", "_") not in _top_keys():
            raise unknown_name("table", key, TABLES, file=str(path), object=key)
    table = document.get(name, {})
    if not isinstance(table, dict):
        raise SettingsError(
            f"'{name}' must be a table of settings, written [{name}]", file=str(path), object=name
        )
    if name != TOP_TABLE:
        return table
    top = {
        key: value
        for key, value in document.items()
        if key != name and not (key in TABLES and isinstance(value, dict))
    }
    if name not in document:
        return top
    if top:
        stray = next(iter(top))
        why = f"'{stray}' stands outside [{name}]; move every setting into it, or drop the table"
        raise SettingsError(why, file=str(path), object=stray)
    return table


def _top_keys() -> Collection[str]:
    from baker.core.settings import BakeSettings

    return BakeSettings.model_fields


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


def resolve(
    models: Sequence[type[Settings]], command_line: Mapping[str, Any], config: Path | None
) -> dict[type[Settings], Settings]:
    """Return the settings of a run: defaults, then the file, then the command line.

    Parameters
    ----------
    models : sequence of type of Settings
        Where one has a field of an earlier one, that one's value is its default.
    command_line : mapping of str to object
        Settings that were given as flags.
    config : Path or None
        A TOML file.

    Returns
    -------
    dict
        One object for each model.

    Raises
    ------
    SettingsError
        For an unknown key or a value out of range, naming the file it came from.
    """
    found: dict[type[Settings], Settings] = {}
    shared: dict[str, Any] = {}
    for model in models:
        fields = model.model_fields
        table = _table(model, config) if config is not None and model.table else {}
        given = {name: value for name, value in command_line.items() if name in fields}
        for name in _ADDED & given.keys() & table.keys():
            given[name] = [*table[name], *given[name]]
        default = {name: value for name, value in shared.items() if name in fields}
        found[model] = model.make({**default, **table, **given})
        shared |= {name: getattr(found[model], name) for name in fields}
    return found


def _table(model: type[Settings], config: Path) -> dict[str, Any]:
    """Return the checked values of a model's table by field: errors name the file."""
    table = read_config(config, model.table)
    try:
        checked = model.make(table)
    except SettingsError as error:
        raise SettingsError(in_keys(error.message), file=str(config), object=error.object) from None
    names = [key.replace("-", "_") for key in table]
    return {name: getattr(checked, name) for name in names}
