"""Lists the suffixes of the scene files that importers read, for help texts."""

from __future__ import annotations

from baker.core.registry import names_in_source


def scene_suffixes() -> list[str]:
    """Return the suffixes of scene files, sorted, each with its dot.

    The suffixes are parsed from the source code of the importers, so that a help text imports no importer.

    Returns
    -------
    list of str
        The names in the registry `baker.io.load.IMPORTERS`.
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
