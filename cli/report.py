"""Writes the result of a bake: a short text, and for `--json` also parts of the manifest."""

from __future__ import annotations

import shlex
import shutil
import textwrap
from collections.abc import Collection
from typing import TYPE_CHECKING, Any, TextIO

from baker.cli.flags import in_flags
from baker.core.printable import printable

if TYPE_CHECKING:
    from baker.core.lightmap import BakeResult

# Keys of the manifest that `bake --json` prints.
KEYS = ("pages", "statistics", "timings", "rays", "warnings")


def bake_json(result: BakeResult) -> dict[str, Any]:
    """Return the JSON object of `bake --json`."""
    manifest: dict[str, Any] = result.manifest
    return {"out": None if result.out is None else str(result.out), **{key: manifest[key] for key in KEYS}}


def write_summary(
    result: BakeResult, stream: TextIO, *, verbose: int = 0, noted: Collection[str] = ()
) -> None:
    """Write files and exports, the duration of each stage, the warnings, and the commands to run next.

    If the stream is a terminal, long lines are wrapped between words.

    Parameters
    ----------
    result : BakeResult
        The finished bake.
    stream : TextIO
        Stream to write to.
    verbose : int
        If 1 or more, statistics and numbers of rays are written as well.
    noted : collection of str
        Messages of warnings that were already written during the bake. They are left out.
    """
    manifest: dict[str, Any] = result.manifest
    if result.out is not None:
        stream.write(f"wrote {result.out}\n")
        for path in sorted(result.out.iterdir()):
            if path.is_file():
                stream.write(f"  {path.name:<24} {_size(path.stat().st_size)}\n")
        for name in manifest["settings"].get("export", ()):
            stream.write(f"  {name + '/':<24} files for {name}; see {name}/README.md\n")
    timings: dict[str, float] = manifest["timings"]
    stages = [f"{stage} {seconds:.2f}" for stage, seconds in timings.items() if stage != "total"]
    total = timings.get("total", sum(timings.values()))
    _write_line(f"{total:.2f} s: {', '.join(stages)}", stream)
    if verbose:
        for channel, figures in manifest["statistics"].items():
            words = ", ".join(
                f"{key} {value:.6g}" for key, value in figures.items() if isinstance(value, int | float)
            )
            _write_line(f"{channel}: {words}", stream)
        rays = ", ".join(f"{stage} {count:,}" for stage, count in manifest["rays"].items())
        _write_line(f"rays: {rays}", stream)
    for warning in manifest["warnings"]:
        if warning["message"] in noted:
            continue
        where = f"{printable(warning['object'])}: " if warning.get("object") else ""
        _write_line(f"warning: {where}{warning['message']} [{warning['code']}]", stream)
    if result.out is not None:
        out = shlex.quote(str(result.out))
        # Keep these lines as they are, so that they can be copied.
        stream.write(f"look at it:         baker view {out}\n")
        stream.write(f"measure its error:  baker verify {out}\n")


def _write_line(text: str, stream: TextIO) -> None:
    """Write a text. If the stream is a terminal, wrap it between words."""
    if stream.isatty():
        width = max(shutil.get_terminal_size().columns, 20)
        text = textwrap.fill(
            in_flags(text), width, subsequent_indent="  ", break_long_words=False, break_on_hyphens=False
        )
    stream.write(text + "\n")


def _size(count: int) -> str:
    for unit in ("B", "kB", "MB"):
        if count < 1000:
            return f"{count:.0f} {unit}" if unit == "B" else f"{count:.1f} {unit}"
        count /= 1000  # type: ignore[assignment]
    return f"{count:.1f} GB"
