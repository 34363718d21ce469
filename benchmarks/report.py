"""Formats measurements of the benchmarks as tables, as plain text or Markdown."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from baker.core.stage import Stage

STAGES = (
    Stage.LOAD, Stage.UNWRAP, Stage.TEXELS, Stage.RAY_TREE, Stage.INSIDE_GEOMETRY, Stage.DIRECT_LIGHT,
    Stage.FORM_FACTORS, Stage.SOLVE, Stage.FINAL_GATHER, Stage.FINISH, Stage.WRITE,
)  # fmt: skip
# The stages of light transport, from `texels` to `final gather`.
TRANSPORT = STAGES[2:9]
Row = Sequence[str | float | int]


def table(head: Sequence[str], rows: Sequence[Row], *, markdown: bool) -> str:
    """Return a table as text; columns of numbers are aligned right."""
    cells = [[_text(cell) for cell in row] for row in rows]
    right = [all(isinstance(row[k], int | float) for row in rows) for k in range(len(head))] if rows else []
    if markdown:
        lines = ["| " + " | ".join(head) + " |"]
        lines.append("|" + "|".join("---:" if r else "---" for r in right) + "|")
        lines += ["| " + " | ".join(row) + " |" for row in cells]
        return "\n".join(lines)
    widths = [max(len(row[k]) for row in [list(head), *cells]) for k in range(len(head))]
    lines = []
    for row in [list(head), *cells]:
        pairs = zip(row, widths, right, strict=True)
        lines.append("  ".join(c.rjust(w) if r else c.ljust(w) for c, w, r in pairs).rstrip())
    return "\n".join(lines)


def report(result: dict[str, Any], *, markdown: bool) -> str:
    """Return the tables of all measurements in the JSON of `run.py`."""
    parts = [("Machine", _machine)]
    if result.get("bakes"):
        parts += [("Whole process and stages, seconds", _stages), ("Rays of the bakes", _rays)]
    if result.get("rates"):
        parts.append(("Kernels beside the bare packet loop, Mrays/s", _rates))
    if result.get("series"):
        parts.append(("More triangles", _series))
    if result.get("large"):
        parts.append(("Memory", _large))
    mark = "### " if markdown else ""
    return "\n\n".join(f"{mark}{title}\n\n{make(result, markdown)}" for title, make in parts) + "\n"


def put_into(path: Path, script: str, tables: str) -> None:
    """Replace the text between the two marker lines of `script` in a document by `tables`."""
    begin, end = f"<!-- tables by benchmarks/{script} -->", "<!-- end of tables -->"
    before, found, rest = path.read_text(encoding="utf-8").partition(begin)
    _, closed, after = rest.partition(end)
    if not found or not closed:
        raise SystemExit(f"{path} has no lines '{begin}' and '{end}' to put the tables between")
    path.write_text(f"{before}{begin}\n\n{tables}\n{end}{after}", encoding="utf-8")


def _text(cell: str | float | int) -> str:
    if isinstance(cell, float):
        return f"{cell:.0f}" if cell >= 1000 else f"{cell:.3g}" if cell < 1 else f"{cell:.2f}"
    return str(cell)


def _machine(result: dict[str, Any], markdown: bool) -> str:
    facts = result["machine"]
    return table(("what", "which"), [(k, str(v)) for k, v in facts.items()], markdown=markdown)


def _stages(result: dict[str, Any], markdown: bool) -> str:
    """Return a table of the bakes: first run, shortest and median later run, CPU time, stages, memory."""
    head = (
        "scene", "page", "first run", "second run", "median", "cpu",
        *STAGES[:-1], "texels..gather", "peak MiB",
    )  # fmt: skip
    rows = []
    for bake in result["bakes"]:
        best = min(bake["runs"], key=lambda run: run["seconds"])
        timings = best["timings"]
        rows.append(
            (
                bake["scene"], bake["resolution"],
                f"{bake['first']['seconds']:.1f}" if bake.get("first") else "",
                best["seconds"], _median([run["seconds"] for run in bake["runs"]]), best["cpu"],
                *(float(timings.get(stage, 0.0)) for stage in STAGES[:-1]),
                float(sum(timings.get(stage, 0.0) for stage in TRANSPORT)),
                round(max(run["peak"] for run in bake["runs"])),
            )
        )  # fmt: skip
    return table(head, rows, markdown=markdown)


def _rays(result: dict[str, Any], markdown: bool) -> str:
    stages = [stage for stage in STAGES if any(stage in bake["runs"][0]["rays"] for bake in result["bakes"])]
    head = ("scene", "page", *(f"{stage}: Mrays, Mrays/s" for stage in stages))
    rows = []
    for bake in result["bakes"]:
        best = min(bake["runs"], key=lambda run: run["seconds"])
        cells = []
        for stage in stages:
            count = best["rays"].get(stage, 0) / 1e6
            seconds = best["timings"].get(stage, 0.0)
            cells.append(f"{count:.2f}, {count / seconds:.1f}" if count and seconds else "")
        rows.append((bake["scene"], bake["resolution"], *cells))
    return table(head, rows, markdown=markdown)


def _rates(result: dict[str, Any], markdown: bool) -> str:
    head = (
        "scene",
        "page",
        "stage",
        "ours",
        "bare loop over",
        "rays made in the loop",
        "share",
        "rays ready",
        "share ",
    )
    rows: list[Row] = []
    for rate in result["rates"]:
        for name, stage in rate["stages"].items():
            bare = rate["bare"].get(stage["beside"], {})
            made, ready = bare.get("made"), bare.get("ready")
            rows.append(
                (
                    rate["scene"], rate["resolution"], name, stage["rate"], stage["beside"],
                    f"{made:.1f}" if made else "", f"{100 * stage['rate'] / made:.0f} %" if made else "",
                    f"{ready:.1f}" if ready else "", f"{100 * stage['rate'] / ready:.0f} %" if ready else "",
                )
            )  # fmt: skip
    return table(head, rows, markdown=markdown)


def _series(result: dict[str, Any], markdown: bool) -> str:
    head = (
        "triangles", "page", "second run", Stage.RAY_TREE, "gather ns/ray", "bare ns/ray", "light ns/ray",
        "finish", "peak MiB",
    )  # fmt: skip
    rows = []
    for entry in result["series"]:
        best = min(entry["runs"], key=lambda run: run["seconds"])
        timings, rays = best["timings"], best["rays"]
        rows.append(
            (
                entry["triangles"], entry["resolution"], best["seconds"], float(timings[Stage.RAY_TREE]),
                1e9 * timings[Stage.FINAL_GATHER] / rays[Stage.FINAL_GATHER], 1e3 / entry["bare"],
                1e9 * timings[Stage.DIRECT_LIGHT] / rays[Stage.DIRECT_LIGHT], float(timings[Stage.FINISH]),
                round(max(run["peak"] for run in entry["runs"])),
            )
        )  # fmt: skip
    return table(head, rows, markdown=markdown)


def _large(result: dict[str, Any], markdown: bool) -> str:
    head = (
        "what",
        "page",
        "samples",
        "seconds",
        "unwrap",
        "texels..gather",
        "finish",
        "peak MiB",
        "of 6 GiB",
    )
    rows = []
    for entry in result["large"]:
        run = entry["run"]
        rows.append(
            (
                entry["what"], entry["resolution"], entry["samples"], run["seconds"],
                float(run["timings"][Stage.UNWRAP]),
                float(sum(run["timings"].get(s, 0.0) for s in TRANSPORT)),
                float(run["timings"][Stage.FINISH]), round(run["peak"]), f"{100 * run['peak'] / 6144:.0f} %",
            )
        )  # fmt: skip
    return table(head, rows, markdown=markdown)


def _median(values: list[float]) -> float:
    ordered = sorted(values)
    middle = len(ordered) // 2
    return ordered[middle] if len(ordered) % 2 else 0.5 * (ordered[middle - 1] + ordered[middle])
