"""Writes a verification as one HTML page with embedded images and without external resources."""

from __future__ import annotations

from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path, PurePosixPath
from typing import Any

from baker.core.version import VERSION
from baker.io.html import escaped
from baker.io.junit import write_text
from baker.verification.report_pictures import crop_pictures, page_pictures
from baker.verification.report_plots import histogram_plot, level_plot
from baker.verification.report_tables import (
    figures_table,
    limits_table,
    objects_table,
    regions_table,
    worst_table,
)
from baker.verification.verify import VerifyReport

_STYLE = """body{font:15px/1.5 system-ui,sans-serif;margin:2rem auto;max-width:70rem;padding:0 1rem}
.wide{overflow-x:auto}table{border-collapse:collapse;margin:1rem 0}
td,th{padding:.2rem .7rem;text-align:right;border-bottom:1px solid #ddd}
td:first-child,th:first-child,.words,th:last-child{text-align:left}
.words{color:#555}.facts td{text-align:left}
img{image-rendering:pixelated;background:#000;margin-right:.6rem}
figure{display:inline-block;margin:.5rem 1rem .5rem 0}
figcaption{font-size:13px;color:#555;max-width:480px}
.bad{color:#b00020;font-weight:600}.good{color:#187a2f;font-weight:600}"""
# Settings of the bake that the report lists.
_BAKE_SETTINGS = (
    "resolution", "density", "quality", "samples", "light_samples", "bounces", "sky", "denoise",
    "ao_distance",
)  # fmt: skip


def write_report(path: Path, found: VerifyReport, in_words: Callable[[str], str] = str) -> None:
    """Write the HTML page.

    Parameters
    ----------
    path : Path
        File to write.
    found : VerifyReport
        Result of `verify`.
    in_words : callable
        Converts messages that name settings in backticks, for example to flags of the command line.

    Raises
    ------
    ResourceError
        If the file cannot be written.
    """
    write_text(path, report_html(found, in_words))


def report_html(found: VerifyReport, in_words: Callable[[str], str] = str) -> str:
    """Return the HTML page as text; `in_words` converts messages that name settings in backticks."""
    summary = found.to_dict()
    title = f"Verification of {escaped(PurePosixPath(_scene(found)).name)}"
    parts = [
        f"<h1>{title}</h1>",
        f'<p class="{"good" if found.passed else "bad"}">{escaped(in_words(found.verdict))}</p>',
        _failures(found, in_words),
        _facts(found, in_words),
        limits_table(found),
        regions_table(found),
        figures_table(found),
    ]
    for name in found.channels:
        parts.append(f"<h2>{escaped(name)}</h2>")
        parts.append(level_plot([row for row in found.levels if row["channel"] == name]))
        parts.append(histogram_plot(summary["channels"][name]["z_histogram"]))
        parts.append(page_pictures(found, name, found.channels[name]))
    parts += [crop_pictures(found), worst_table(found), objects_table(found)]
    body = "\n".join(parts)
    head = f"<title>{title}</title><style>{_STYLE}</style>"
    return f'<!doctype html><html lang="en"><meta charset="utf-8">{head}{body}</html>\n'


def _failures(found: VerifyReport, in_words: Callable[[str], str]) -> str:
    lines = [verdict.sentence() for verdict in found.verdicts if verdict.failed]
    lines += found.problems + [warning.message for warning in found.warnings]
    items = "".join(f'<li class="bad">{escaped(in_words(line))}</li>' for line in lines)
    return f"<ul>{items}</ul>" if lines else ""


def _facts(found: VerifyReport, in_words: Callable[[str], str]) -> str:
    """Return a table of the date, the versions, the settings and the effort."""
    manifest = found.bake.manifest
    baked: dict[str, Any] = manifest.get("settings", {})
    settings = [_setting(key, baked[key]) for key in _BAKE_SETTINGS if baked.get(key) is not None]
    mine = {key: value for key, value in found.settings.model_dump().items() if value is not None}
    verified = [_setting(key, value) for key, value in mine.items()]
    version = manifest.get("versions", {}).get("baker", "unknown")
    rows = {
        "verified": f"{datetime.now(UTC):%Y-%m-%d %H:%M} UTC, baker {VERSION}",
        "baked": f"{manifest.get('created', 'unknown')}, baker {version}",
        "scene": _scene(found),
        "folder": str(found.bake.folder),
        "settings of the bake": in_words(", ".join(settings)),
        "settings of verify": in_words(", ".join(verified)),
        "effort": f"{len(found.pixel)} texels, {found.rays / 1e6:.1f} million rays, {found.seconds:.0f} s",
        "not compared": f"{found.invalid} invalid texels",
    }
    cells = "".join(f"<tr><td>{name}</td><td>{escaped(text)}</td></tr>" for name, text in rows.items())
    return f"<table class=facts>{cells}</table>"


def _scene(found: VerifyReport) -> str:
    return str(found.bake.manifest.get("input", {}).get("path") or found.bake.folder.name)


def _setting(key: str, value: Any) -> str:
    """Return a setting as messages name it: between backticks, with a value as Python writes it."""
    joined = ",".join(map(str, value)) if isinstance(value, list | tuple) else value
    return f"`{key}={joined!r}`"
