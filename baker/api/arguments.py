"""Checks arguments of the Python API other than settings, and converts system errors to errors of baker."""

from __future__ import annotations

import os
from collections.abc import Callable
from functools import wraps
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

from baker.core.error_mapping import explain
from baker.core.errors import SettingsError

P = ParamSpec("P")
R = TypeVar("R")
T = TypeVar("T")


def of_the_api(function: Callable[P, R]) -> Callable[P, R]:
    """Decorate a function of the API: convert OSError and MemoryError to a `BakerError`.

    Before the call, a keyword `progress` that is not callable raises `SettingsError`.
    """

    @wraps(function)
    def call(*arguments: P.args, **keywords: P.kwargs) -> R:
        progress = keywords.get("progress")
        if progress is not None and not callable(progress):
            raise wrong_type("progress", "a function of stage, fraction and detail", progress)
        try:
            return function(*arguments, **keywords)
        except (OSError, MemoryError) as error:
            known = explain(error)
            assert known is not None
            raise known from error

    return call


def path_of(value: Any, name: str, what: str = "a path") -> Path:
    """Return the argument `name` as a Path; `what` describes the expected value in the message.

    Raises
    ------
    SettingsError
        If the value is neither a str nor an `os.PathLike`, or is empty.
    """
    if not isinstance(value, str | os.PathLike):
        raise wrong_type(name, what, value)
    if not os.fspath(value):
        raise SettingsError("is empty; name a file or a folder, or '.'", object=name)
    return Path(value)


def instance_of(value: Any, kind: type[T], name: str, hint: str = "") -> T:
    """Return the argument `name` after checking that it is an instance of `kind`.

    Raises
    ------
    SettingsError
        If it is not an instance of `kind`. The message ends with `hint`.
    """
    if not isinstance(value, kind):
        raise wrong_type(name, f"a baker.{kind.__name__}", value, hint)
    return value


def wrong_type(name: str, what: str, value: Any, hint: str = "") -> SettingsError:
    """Return the error for an argument of a wrong type; the caller raises it."""
    return SettingsError(f"`{name}` should be {what} (was {type(value).__name__}){hint}", object=name)
