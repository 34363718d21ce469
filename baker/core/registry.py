"""Finds plugins by name: files of a package register plugins, and callers look them up by their names.

Based on: Mitsuba 3, where each plugin is one file.
"""

from __future__ import annotations

import ast
import importlib
import pkgutil
from collections.abc import Callable, Collection
from pathlib import Path
from typing import Generic, TypeVar

from baker.core.names import unknown_name

T = TypeVar("T")


class Registry(Generic[T]):
    """Maps names to the plugins of one package.

    Parameters
    ----------
    package : str
        Dotted name of the package whose modules register the plugins. The modules are imported at the first
        lookup.
    """

    def __init__(self, package: str) -> None:
        self.package = package
        self._plugins: dict[str, T] = {}
        self._searched = False

    def register(self, name: str) -> Callable[[T], T]:
        """Return a decorator that registers its argument under `name`."""

        def add(plugin: T) -> T:
            if name in self._plugins:
                raise ValueError(f"'{name}' is registered twice in {self.package}")
            self._plugins[name] = plugin
            return plugin

        return add

    def _search(self) -> None:
        if not self._searched:
            self._searched = True
            package = importlib.import_module(self.package)
            for module in sorted(m.name for m in pkgutil.iter_modules(package.__path__)):
                importlib.import_module(f"{self.package}.{module}")

    def names(self) -> list[str]:
        """Return the registered names, sorted."""
        self._search()
        return sorted(self._plugins)

    def get(self, name: str) -> T | None:
        """Return the plugin of that name, or None."""
        self._search()
        return self._plugins.get(name)

    def require(self, name: str, what: str, *, setting: str | None = None, hidden: Collection[str] = ()) -> T:
        """Return the plugin of that name.

        Parameters
        ----------
        name : str
        what : str
            Kind of plugin in the singular, for the message: "channel".
        setting : str or None
            Setting that contains the name, for the message.
        hidden : collection of str
            Registered names that the message does not list, because the setting does not accept them.

        Raises
        ------
        SettingsError
            If no plugin has that name. The message suggests the nearest name, and lists all except `hidden`.
        """
        plugin = self.get(name)
        if plugin is None:
            known = [other for other in self.names() if other not in hidden]
            raise unknown_name(what, name, known, object=setting)
        return plugin


def names_in_source(package: str, registry: str) -> list[str]:
    """Return the names that the files of a package register, by parsing the files without importing them.

    Parameters
    ----------
    package : str
        Dotted name of the package.
    registry : str
        Name of the registry in these files, such as "EXPORTS". Calls of its method `register` with a literal
        argument are searched.

    Returns
    -------
    list of str
        The literal arguments, sorted.
    """
    found = set()
    for folder in importlib.import_module(package).__path__:
        for file in Path(folder).glob("*.py"):
            for node in ast.walk(ast.parse(file.read_bytes())):
                if (
                    isinstance(node, ast.Call)
                    and ast.unparse(node.func) == f"{registry}.register"
                    and isinstance(node.args[0], ast.Constant)
                ):
                    found.add(str(node.args[0].value))
    return sorted(found)
