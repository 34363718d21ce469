"""Combines settings: a TOML file overrides defaults, and the command line overrides the file."""

from __future__ import annotations

import os
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any

from baker.cli.flags import in_keys
from baker.core.errors import SettingsError
from baker.core.names import unknown_name
from baker.core.settings_model import Settings
from baker.io.toml_file import read_toml

# The table whose keys may also be at the top level of the file.
TOP_TABLE = "bake"
# Names of all tables that a configuration file may have.
TABLES = ("bake", "check", "verify", "render", "diff", "repair")
# Lists whose values on the command line are added to the values in the file instead of replacing them.
_ADDED = {"ignore", "object"}


def read_config(path: Path, name: str = TOP_TABLE) -> dict[str, Any]:
    """Return the contents of one table of a configuration file, empty if the table is missing.

    Parameters
    ----------
    path : Path
        TOML file with tables of settings. The settings of a bake may be at the top level instead of in the
        table `[bake]`.
    name : str
        Name of the table.

    Returns
    -------
    dict
        The values by key, which are not validated yet.

    Raises
    ------
    SettingsError
        If the file cannot be read, is not TOML or has an unknown table. If the value of the key `name` in the
        file is not a table. If there are settings both at the top level and in `[bake]`.
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
    if str(path) == os.devnull:
        return {}  # by convention, a file without settings
    try:
        return read_toml(path, "the configuration")
    except OSError as error:
        raise SettingsError(f"the configuration cannot be read: {error.strerror}", file=str(path)) from None


def resolve(
    models: Sequence[type[Settings]], command_line: Mapping[str, Any], config: Path | None
) -> dict[type[Settings], Settings]:
    """Combine the settings of a run. A file overrides defaults, and the command line overrides the file.

    Parameters
    ----------
    models : sequence of type of Settings
        The models. If two models have a field with the same name, the value of the first model is the default
        of the second.
    command_line : mapping of str to object
        Settings that were given as flags, by name.
    config : Path or None
        A configuration file, TOML.

    Returns
    -------
    dict
        One settings object for each model.

    Raises
    ------
    SettingsError
        If a setting is unknown or a value is invalid. The error names the file if the value is from a file.
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
    """Return the validated values of a model's table, by field. Errors name the file."""
    table = read_config(config, model.table)
    if "scene_name" in model.model_fields and "scene" in table:
        # The key has the name of the flag, not of the setting.
        table = {"scene_name" if key == "scene" else key: value for key, value in table.items()}
    try:
        checked = model.make(table)
    except SettingsError as error:
        raise SettingsError(in_keys(error.message), file=str(config), object=error.object) from None
    names = [key.replace("-", "_") for key in table]
    return {name: getattr(checked, name) for name in names}
