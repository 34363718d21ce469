"""`baker inspect PATH`: prints the contents of a scene, a bake or a lightmap image."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, TextIO

import typer

from baker.cli.command import Run, command
from baker.core.printable import printable
from baker.core.settings import BakeSettings
from baker.io.settings import InspectSettings

# Largest number of items of a list in text output without -v. The number of the other items follows.
SHOWN = 20
# Length to which texts in a table, such as hashes, are truncated, characters. -v shows the whole texts.
LONGEST = 24


# No ray is traced here, but the flags of ray tracing are accepted, so that scripts can pass them to all
# commands.
# Settings of a bake that have no flag here: all but those of objects.
_NO_FLAG = {
    name: field.default
    for name, field in BakeSettings.model_fields.items()
    if name not in {"include", "exclude", "object", "name_rules", *InspectSettings.model_fields}
}


@command("inspect", InspectSettings, BakeSettings, fixed=_NO_FLAG)
def inspect(
    ctx: typer.Context,
    path: Annotated[
        Path,
        typer.Argument(
            metavar="PATH", help="Scene file, output folder, bake.json, lightmap image or status_0.png."
        ),
    ],
) -> None:
    """Print the contents of `path`."""
    from baker.io.inspect import inspect_path

    run: Run = ctx.obj
    own = run.of(InspectSettings)
    objects = {"objects": run.of(BakeSettings)} if own.objects else {}
    found = inspect_path(path, own, **objects)
    if run.as_json:
        run.session.write_json(found)
    elif own.objects and not run.quiet:
        table = [_object_row(row) for row in found["objects"]]
        write_tree({**found, "objects": table}, run.text, limit=None)
    elif not run.quiet:
        write_tree(found, run.session.out, limit=None if run.verbose else SHOWN)


def _object_row(row: dict[str, Any]) -> dict[str, Any]:
    """Return the cells of an object in the table of `--objects`."""
    given = {
        key: str(value).lower() if isinstance(value, bool) else value
        for key, value in row["settings"].items()
    }
    return {
        "node": row["node"],
        "name": row["name"],
        "settings": ", ".join(f"{key}={value}" for key, value in given.items()),
        "why": "; ".join(dict.fromkeys(row["reasons"].values())),
    }


def write_tree(value: Any, stream: TextIO, *, depth: int = 0, limit: int | None = SHOWN) -> None:
    """Write nested dicts and lists as indented lines.

    Parameters
    ----------
    value : dict or list
        The values to write.
    stream : TextIO
        Stream to write to.
    depth : int
        Number of levels of indentation.
    limit : int or None
        Largest number of items of a list that are written; None for all.
    """
    pad = "  " * depth
    if isinstance(value, dict):
        for key, item in value.items():
            if _plain(item):
                stream.write(f"{pad}{printable(str(key))}: {_words(item)}\n")
            else:
                stream.write(
                    f"{pad}{printable(str(key))} ({len(item)}):\n"
                    if isinstance(item, list)
                    else f"{pad}{printable(str(key))}:\n"
                )
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
    """Write dictionaries as a table with a column for each key. `short` truncates long values."""
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
        return words  # never truncate messages
    return words[: LONGEST - 3] + "..." if short and len(words) > LONGEST else words


def _plain(value: Any) -> bool:
    # Write lists of up to four numbers or words, such as a colour, on one line.
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
    return printable(str(value))
