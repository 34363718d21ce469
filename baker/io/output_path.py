"""Refuses output paths that cannot be written because of their name or their links."""

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
        If the links in the path form a loop, or the path is not text.
    """
    path = Path(os.path.realpath(out))
    if any(part.is_symlink() for part in (path, *path.parents)):
        raise SettingsError("the links in this path form a loop; name another one", file=str(out))
    if why := not_text(path):
        raise SettingsError(f"{why}; name another one", file=str(out))
    return path


def not_text(path: Path) -> str | None:
    """Return the reason if a path is not text, else None.

    File names are bytes, which the encoding of the system may not be able to decode. The libraries that read
    and write images cannot open such files.
    """
    try:
        str(path).encode("utf-8")
    except UnicodeEncodeError:
        return f"this name is not text in the encoding of the system ({sys.getfilesystemencoding()})"
    return None
