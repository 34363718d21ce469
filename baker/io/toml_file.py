"""Reads TOML files: configuration files and job files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from baker.core.errors import SettingsError
from baker.io.regular_file import LARGEST_TEXT, read_regular


def read_toml(path: Path, what: str) -> dict[str, Any]:
    """Read a TOML file.

    Parameters
    ----------
    path : Path
        A regular file in UTF-8.
    what : str
        Name of the kind of file in messages, such as "the configuration".

    Returns
    -------
    dict
        The top-level table.

    Raises
    ------
    OSError
        If the file cannot be read.
    SettingsError
        If the content is not UTF-8 or not valid TOML, or contains values that Python cannot represent.
    """
    import tomllib

    try:
        return tomllib.loads(read_regular(path, most=LARGEST_TEXT).decode("utf-8-sig"))
    except UnicodeDecodeError:
        raise SettingsError(f"{what} is not UTF-8 text; save it as UTF-8", file=str(path)) from None
    except tomllib.TOMLDecodeError as error:
        raise SettingsError(f"{what} is not valid TOML: {error}", file=str(path)) from None
    except RecursionError:
        raise SettingsError(f"{what} has too deeply nested values", file=str(path)) from None
    except ValueError:
        # Python limits the number of digits of an integer, and `datetime` limits the year.
        message = f"{what} has a number or a date that is out of range"
        raise SettingsError(message, file=str(path)) from None
