"""Converts names of settings in messages of the library to flags of the command line.

In messages of the library, settings and arguments are between backticks and have the form of Python code:
"raise `resolution`", "pass `denoise=False`", "use `dtype='float'`".
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import cache
from typing import TYPE_CHECKING, Any, TextIO

from baker.core.printable import printable_lines

if TYPE_CHECKING:
    from baker.core.settings_model import Settings

_NAMED = re.compile(r"`([a-z][a-z0-9_]*)(?:=([^`\s]+))?`")
# Arguments of subcommands that have a flag but are not settings.
_ARGUMENTS = frozenset({
    "cluster", "config", "fix", "force", "junit", "objects", "out", "port", "report", "sarif", "three",
})  # fmt: skip
# Arguments whose flag is not `--` followed by their name.
_SHORT = {"out": "-o"}
# Settings whose flag has another name. In Python and in job files, `scene` is the scene file.
_RENAMED = {"scene_name": "scene"}
# Argument that is converted only if it has a value, because an export has the same name.
_AMBIGUOUS = "three"


def dashed(name: str) -> str:
    """Return the flag of a setting or argument without its leading dashes.

    Parameters
    ----------
    name : str
        Name of the setting, with underscores.

    Returns
    -------
    str
        Words with dashes between them.
    """
    return _RENAMED.get(name, name).replace("_", "-")


def _models() -> Iterator[type[Settings]]:
    """Yield the settings of each command; a command's module is imported when its turn comes."""
    from baker.core.settings import BakeSettings

    yield BakeSettings
    from baker.checks.settings import CheckSettings

    yield CheckSettings
    from baker.rendering.settings import RenderSettings

    yield RenderSettings
    from baker.verification.settings import VerifySettings

    yield VerifySettings
    from baker.comparison.settings import DiffSettings

    yield DiffSettings
    from baker.repairs.settings import RepairSettings

    yield RepairSettings
    from baker.jobs.settings import BatchSettings

    yield BatchSettings


@cache
def has_flag(name: str) -> bool:
    """Return whether a setting or an argument has a flag.

    Parameters
    ----------
    name : str
        Its name, with underscores.

    Returns
    -------
    bool
        True if any command has the flag.
    """
    return name in _ARGUMENTS or any(name in model.model_fields for model in _models())


def in_flags(text: str, quote: str = "") -> str:
    """Return a message of the library with names of settings converted to flags.

    Parameters
    ----------
    text : str
        The message, with settings between backticks.
    quote : str
        Written before and after each flag.

    Returns
    -------
    str
        "raise --resolution" for "raise `resolution`".
    """

    def flag(found: re.Match[str]) -> str:
        return f"{quote}{_flag(found[1], found[2])}{quote}" if _is_named(found) else found[0]

    return _NAMED.sub(flag, text)


def in_keys(text: str) -> str:
    """Return a message of the library with names of settings converted to keys of a configuration file.

    Parameters
    ----------
    text : str
        The message, with settings between backticks.

    Returns
    -------
    str
        "'resolution' is above 16384" for "`resolution` is above 16384".
    """
    return _NAMED.sub(lambda found: f"'{found[1]}'" if _is_named(found) else found[0], text)


def values_in_flags(value: Any) -> Any:
    """Apply `in_flags` to each text in nested dictionaries and lists.

    Parameters
    ----------
    value : object
        The object that `--json` prints.

    Returns
    -------
    object
        A copy with converted texts.
    """
    if isinstance(value, str):
        return in_flags(value)
    if isinstance(value, dict):
        return {key: values_in_flags(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [values_in_flags(item) for item in value]
    return value


class FlagStream:
    """A text stream that converts names of settings to flags.

    Parameters
    ----------
    stream : TextIO
        The stream to which the converted text is written.
    """

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream

    def write(self, text: str) -> int:
        """Write a text in which settings between backticks are converted to flags."""
        return self._stream.write(in_flags(printable_lines(text)))

    def isatty(self) -> bool:
        """Return whether the stream is a terminal."""
        return self._stream.isatty()

    def flush(self) -> None:
        """Flush the stream."""
        self._stream.flush()


def _is_named(found: re.Match[str]) -> bool:
    return has_flag(found[1]) and (found[1] != _AMBIGUOUS or found[2] is not None)


def _flag(name: str, value: str | None) -> str:
    if value == "False":
        return f"--no-{dashed(name)}"
    flag = _SHORT.get(name, f"--{dashed(name)}")
    return flag if value in (None, "True") else f"{flag} {str(value).strip(chr(39))}"
