"""The report of a bake: a short text, and for `--json` parts of the manifest."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TextIO

if TYPE_CHECKING:
    from baker.core.lightmap import BakeResult

# Keys of the manifest that `bake --json` prints.
KEYS = ("pages", "statistics", "timings", "rays", "warnings")


def bake_json(result: BakeResult) -> dict[str, Any]:
    """Return the JSON object of `bake --json`."""
    manifest: dict[str, Any] = result.manifest
    return {"out": None if result.out is None else str(result.out), **{key: manifest[key] for key in KEYS}}


def write_summary(result: BakeResult, stream: TextIO, *, verbose: int = 0) -> None:
    """Write the names and sizes of the files, the duration of each stage, and the warnings.

    Parameters
    ----------
    result : BakeResult
        The finished bake.
    stream : TextIO
        Stream to write to.
    verbose : int
        If 1 or more, statistics and numbers of rays are written as well.
    """
    manifest: dict[str, Any] = result.manifest
    if result.out is not None:
        stream.write(f"wrote {result.out}\n")
        for path in sorted(result.out.iterdir()):
            if path.is_file():
                stream.write(f"  {path.name:<24} {_size(path.stat().st_size)}\n")
    timings: dict[str, float] = manifest["timings"]
    stages = [f"{stage} {seconds:.2f}" for stage, seconds in timings.items() if stage != "total"]
    total = timings.get("total", sum(timings.values()))
    stream.write(f"{total:.2f} s: {', '.join(stages)}\n")
    if verbose:
        for channel, figures in manifest["statistics"].items():
            words = ", ".join(
                f"{key} {value:.6g}" for key, value in figures.items() if isinstance(value, int | float)
            )
            stream.write(f"{channel}: {words}\n")
        stream.write(
            "rays: " + ", ".join(f"{stage} {count:,}" for stage, count in manifest["rays"].items()) + "\n"
        )
    for warning in manifest["warnings"]:
        where = f"{warning['object']}: " if warning.get("object") else ""
        stream.write(f"warning: {where}{warning['message']} [{warning['code']}]\n")


def _size(count: int) -> str:
    for unit in ("B", "kB", "MB"):
        if count < 1000:
            return f"{count:.0f} {unit}" if unit == "B" else f"{count:.1f} {unit}"
        count /= 1000  # type: ignore[assignment]
    return f"{count:.1f} GB"
