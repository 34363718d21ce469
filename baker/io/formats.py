"""The scene formats that importers read, in words for help texts."""

from __future__ import annotations

from baker.core.registry import names_in_source


def scene_suffixes() -> list[str]:
    """Return the suffixes of scene files, sorted, each with its dot.

    They are read from the source of the importers: help texts list them without importing any.

    Returns
    -------
    list of str
        The names of `baker.io.load.IMPORTERS`.
    """
    return names_in_source("baker.io.importers", "IMPORTERS")


def scene_file_help() -> str:
    """Return the help text of an argument that is a scene file.

    Returns
    -------
    str
        A sentence that lists all formats.
    """
    *others, last = (suffix.removeprefix(".") for suffix in scene_suffixes())
    return f"{', '.join(others)} or {last} file."
