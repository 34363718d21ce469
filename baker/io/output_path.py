"""Checks names of outputs that no file or folder can be written to."""

from __future__ import annotations

import os
import sys
from pathlib import Path

from baker.core.errors import SettingsError


def resolved_output(out: Path) -> Path:
    """Return the absolute path of an output without links.

    Parameters
    ----------
    out : Path
        An output folder or file, which need not exist.

    Returns
    -------
    Path
        The path.

    Raises
    ------
    SettingsError
        If its links form a loop, or its name is not text.
    """
    path = Path(os.path.realpath(out))
    if any(part.is_symlink() for part in (path, *path.parents)):
        raise SettingsError("the links in this path form a loop; name another one", file=str(out))
    if why := not_text(path):
        raise SettingsError(f"{why}; name another one", file=str(out))
    return path


def not_text(path: Path) -> str | None:
    """Return why the libraries that read and write images cannot open a path; None if they can.

    Names of files are bytes. Those that the encoding of the system cannot decode are no text.
    """
    try:
        str(path).encode("utf-8")
    except UnicodeEncodeError:
        return f"this name is not text in the encoding of the system ({sys.getfilesystemencoding()})"
    return None
