"""`baker inspect PATH`: prints the contents of a scene, a bake or an image."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, TextIO

import typer

from baker.cli.command import Run, command
from baker.core.settings import InspectSettings

# Longest list shown item by item; the rest is counted (all of it with -v and with --json).
SHOWN = 20
# Longest text in a table, which leaves a hash its beginning; -v shows all of it.
LONGEST = 24


# No ray is traced here; the settings are taken so that scripts can pass the same flags to every command.
@command("inspect", InspectSettings)
def inspect(
    ctx: typer.Context,
    path: Annotated[
        Path,
        typer.Argument(metavar="PATH", help="Scene file, output folder, bake.json, image or status_0.png."),
    ],
) -> None:
    """Print the contents of `path`."""
    from baker.io.inspect import inspect_path

    run: Run = ctx.obj
    found = inspect_path(path, allow_outside=run.of(InspectSettings).allow_outside)
    if run.as_json:
        run.session.write_json(found)
    elif not run.quiet:
        write_tree(found, run.session.out, limit=None if run.verbose else SHOWN)


def write_tree(value: Any, stream: TextIO, *, depth: int = 0, limit: int | None = SHOWN) -> None:
    """Write nested dicts and lists as indented lines.

    Parameters
    ----------
    value : dict or list
    stream : TextIO
    depth : int
        Levels of indentation.
    limit : int or None
        Most entries shown of one list; None for all.
    """
    pad = "  " * depth
    if isinstance(value, dict):
        for key, item in value.items():
            if _plain(item):
                stream.write(f"{pad}{key}: {_words(item)}\n")
            else:
                stream.write(f"{pad}{key} ({len(item)}):\n" if isinstance(item, list) else f"{pad}{key}:\n")
                write_tree(item, stream, depth=depth + 1, limit=limit)
        return
    rows = value[:limit]
    if all(isinstance(item, dict) and all(_plain(part) for part in item.values()) for item in rows):
        _write_table(rows, stream, pad=pad, short=limit is not None)
        rows = []
    for item in rows:
        if _plain(item):
            stream.write(f"{pad}- {_words(item)}\n")
        else:
            stream.write(f"{pad}-\n")
            write_tree(item, stream, depth=depth + 1, limit=limit)
    if limit is not None and len(value) > limit:
        stream.write(f"{pad}... and {len(value) - limit} more (-v shows all)\n")


def _write_table(rows: list[dict[str, Any]], stream: TextIO, *, pad: str, short: bool) -> None:
    """Write rows under their keys; `short` truncates long values such as hashes."""
    keys = list(dict.fromkeys(key for row in rows for key in row))
    cells = [[_cell(key, _words(row.get(key, "")), short=short) for key in keys] for row in rows]
    widths = [max(len(line[index]) for line in [keys, *cells]) for index in range(len(keys))]
    numbers = [all(isinstance(row.get(key, 0), int | float) for row in rows) for key in keys]
    for line in [keys, *cells]:
        words = (
            word.rjust(width) if number else word.ljust(width)
            for word, width, number in zip(line, widths, numbers, strict=True)
        )
        stream.write(f"{pad}{'  '.join(words).rstrip()}\n")


def _cell(key: str, words: str, *, short: bool) -> str:
    if key == "message":
        return words  # a sentence is there to be read
    return words[: LONGEST - 3] + "..." if short and len(words) > LONGEST else words


def _plain(value: Any) -> bool:
    # Short rows of numbers or words (a colour, a list of names) stay on one line.
    if isinstance(value, list | tuple):
        return len(value) <= 4 and all(not isinstance(part, dict | list | tuple) for part in value)
    return not (isinstance(value, dict) and value)


def _words(value: Any) -> str:
    if value is None or value in ([], (), {}):
        return "none"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, list | tuple):
        return " ".join(_words(part) for part in value)
    return str(value)
