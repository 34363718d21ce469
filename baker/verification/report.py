"""Writes a verification as one HTML page with embedded images and without external resources.

Maps are shown as value / (value + middle), sRGB-encoded, where middle is the median of the reference over lit
texels.
"""

from __future__ import annotations

import base64
import html
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from baker.core.printable import printable
from baker.io.junit import write_text
from baker.io.png import encode_png, srgb_levels
from baker.metrics.error_metrics import dark_floor, relative_error
from baker.verification.criteria.registry import METRIC_NAMES
from baker.verification.verify import ChannelCheck, VerifyReport

# Side of the image of a page, texels: larger pages are subsampled. Largest number of regions listed.
_SHOWN, _REGIONS = 512, 40
# Relative error at the yellow end of the colour scale.
_HOT = 0.10
_STYLE = """body{font:15px/1.5 system-ui,sans-serif;margin:2rem auto;max-width:70rem;padding:0 1rem}
.wide{overflow-x:auto}table{border-collapse:collapse;margin:1rem 0}
td,th{padding:.2rem .7rem;text-align:right;border-bottom:1px solid #ddd}
td:first-child,th:first-child{text-align:left}
img{image-rendering:pixelated;background:#000;margin-right:.6rem}
figure{display:inline-block;margin:.5rem 1rem .5rem 0}figcaption{font-size:13px;color:#555}
.bad{color:#b00020;font-weight:600}.good{color:#187a2f;font-weight:600}"""


def _escaped(text: str) -> str:
    return html.escape(printable(text))


def write_report(path: Path, found: VerifyReport) -> None:
    """Write the HTML page.

    Parameters
    ----------
    path : Path
        File to write.
    found : VerifyReport
        Result of `verify`.

    Raises
    ------
    ResourceError
        If the file cannot be written.
    """
    write_text(path, report_html(found))


def report_html(found: VerifyReport) -> str:
    """Return the HTML page as text."""
    summary = found.to_dict()
    verdict = '<span class="good">passed</span>' if found.passed else '<span class="bad">failed</span>'
    scene = _escaped(str(found.bake.manifest.get("input", {}).get("path") or found.bake.folder.name))
    parts = [
        f"<h1>{scene}: {verdict}</h1>",
        f"<p>{len(found.pixel)} texels, {found.rays / 1e6:.1f} million rays, {found.seconds:.0f} s,"
        f" {found.compile_seconds:.0f} s of compiling before."
        f" {found.invalid} invalid texels are not compared.</p>",
        _failures(found),
        _limits_table(found),
        _regions_table(found),
        _metrics_table(found),
    ]
    for name, check in found.channels.items():
        parts.append(f"<h2>{_escaped(name)}</h2>")
        parts.append(_pages(found, name, check))
        parts.append(_histogram(summary["channels"][name]["z_histogram"]))
    parts += [_crops(found), _worst_table(found), _objects_table(found)]
    body = "\n".join(parts)
    title = f"<title>baker verify: {scene}</title>"
    return (
        f'<!doctype html><html lang="en"><meta charset="utf-8">{title}<style>{_STYLE}</style>{body}</html>\n'
    )


def _failures(found: VerifyReport) -> str:
    lines = [
        f"{verdict.limit}: it is {'missing' if verdict.value is None else f'{verdict.value:.4g}'}"
        for verdict in found.verdicts
        if verdict.failed
    ]
    lines += found.problems + [warning.message for warning in found.warnings]
    items = "".join(f'<li class="bad">{_escaped(line)}</li>' for line in lines)
    return f"<ul>{items}</ul>" if lines else ""


def _limits_table(found: VerifyReport) -> str:
    rows = ""
    for verdict in found.verdicts:
        words = '<td class="bad">failed</td>' if verdict.failed else '<td class="good">holds</td>'
        rows += f"<tr><td>{_escaped(str(verdict.limit))}</td><td>{_number(verdict.value)}</td>{words}</tr>"
    head = "<tr><th>fails if</th><th>figure</th><th></th></tr>"
    note = "<p>These limits decide, and no others: a single texel may be far off in a bake that passed.</p>"
    return f"<h2>Limits</h2>{note}<table>{head}{rows}</table>"


def _regions_table(found: VerifyReport) -> str:
    rows = ""
    for row in found.regions[:_REGIONS]:
        colour = " ".join(f"{shift:+.1%}" for shift in row["colour"])
        where = ", ".join(f"{x:.2f}" for x in row["position"])
        rows += (
            f"<tr><td>{row['channel']} of {_escaped(row['region'])}<br>around {where}, of"
            f" {_escaped(', '.join(row['objects']))}</td><td>{row['texels']}</td>"
            f"<td>{row['area']:.3g}</td><td>{row['light']:.4g}</td>"
            f"<td>{row['bias']:+.1%} &plusmn; {row['bias_se']:.1%}</td><td>{colour}</td>"
            f"<td>{row['typical']:.1%} ({row['typical_noise']:.1%})</td></tr>"
        )
    head = "".join(
        f"<th>{title}</th>"
        for title in ("region", "texels", "m2", "light", "bias", "colour", "typical (noise)")
    )
    note = (
        "<p>Deviations of a region are relative to its own light. A region is a room, as seen from one point,"
        " or its texels of a light level. Worst first; what may be chance counts as nothing.</p>"
    )
    return f"<h2>Regions</h2>{note}<div class=wide><table><tr>{head}</tr>{rows}</table></div>"


def _metrics_table(found: VerifyReport) -> str:
    # Write one row for each metric, because a column for each metric would be too wide.
    head = "".join(f"<th>{_escaped(name)}</th>" for name in found.channels)
    rows = ""
    for key in METRIC_NAMES:
        cells = "".join(f"<td>{_number(check.metrics[key])}</td>" for check in found.channels.values())
        rows += f"<tr><td>{key}</td>{cells}</tr>"
    cells = "".join(f"<td>{_number(found.flip(name))}</td>" for name in found.channels)
    rows += f"<tr><td>flip</td>{cells}</tr>"
    note = (
        "<p>bias, median, p95, p99, max and noise_floor are relative; noise_floor is what the reference's "
        "own noise adds to the median. energy_ratio is all that the map holds over all that path "
        "tracing finds, by area, with its standard error. flip is the mean over the pictures of the worst "
        "texels below.</p>"
    )
    return f"<table><tr><th>figure</th>{head}</tr>{rows}</table>{note}"


def _number(value: Any) -> str:
    if value is None:
        return "-"
    return str(value) if isinstance(value, int) else f"{value:.4g}"


def _pages(found: VerifyReport, name: str, check: ChannelCheck) -> str:
    """Return, for each page, an image of the map and an image of the errors of the compared texels."""
    size = found.bake.atlas.resolution
    step = max(size // _SHOWN, 1)
    usual = _usual(check.reference)
    error = relative_error(check.value, check.reference, dark_floor(check.reference))
    text = ""
    for page in range(found.bake.maps[name].shape[0]):
        stored = found.bake.maps[name][page][::step, ::step]
        text += _figure(_shown(stored, usual), f"{name}, page {page}", 1)
        heat = np.full((*stored.shape[:2], 3), 24, np.uint8)
        mine = found.pixel // (size * size) == page
        row, column = np.divmod(found.pixel[mine] % (size * size), size)
        # Draw a square of 3 x 3 pixels for each texel, in order of increasing error.
        for i in np.argsort(error[mine], kind="stable"):
            y, x = row[i] // step, column[i] // step
            heat[max(y - 1, 0) : y + 2, max(x - 1, 0) : x + 2] = _heat(float(error[mine][i]))
        text += _figure(heat, f"error of the compared texels: blue 0, yellow {_HOT:.0%} and more", 1)
    return text


def _heat(error: float) -> tuple[int, int, int]:
    t = min(error / _HOT, 1.0)
    return int(40 + 215 * t), int(60 + 160 * t * t), int(200 * (1 - t))


def _usual(value: NDArray[np.float64]) -> float:
    """Return the median over n of the positive colour means of `value` (n, C); 1 if there are none."""
    mean = value.mean(axis=1)
    return float(np.median(mean[mean > 0])) if (mean > 0).any() else 1.0


def _shown(image: NDArray[np.float32], middle: float) -> NDArray[np.uint8]:
    value = np.maximum(image, 0.0)
    mapped = value / (value + max(middle, 1e-9))
    return srgb_levels(np.broadcast_to(mapped, (*image.shape[:2], 3)).astype(np.float32))


def _figure(pixels: NDArray[np.uint8], caption: str, zoom: int) -> str:
    data = base64.b64encode(encode_png(np.ascontiguousarray(pixels))).decode("ascii")
    width = pixels.shape[1] * zoom
    picture = f'<img width="{width}" alt="{_escaped(caption)}" src="data:image/png;base64,{data}">'
    return f"<figure>{picture}<figcaption>{_escaped(caption)}</figcaption></figure>"


def _histogram(histogram: dict[str, list[float]]) -> str:
    """Return an image of the histogram of z-scores, with the normal distribution of a bake without errors."""
    counts, edges = np.array(histogram["counts"]), np.array(histogram["edges"])
    if not counts.sum():
        return ""
    middle = 0.5 * (edges[1:] + edges[:-1])
    normal = np.exp(-0.5 * middle**2) / np.sqrt(2 * np.pi) * (edges[1] - edges[0]) * counts.sum()
    top = max(float(counts.max()), float(normal.max()))
    bars = "".join(
        f'<rect x="{20 * i}" y="{160 - high:.1f}" width="18" height="{high:.1f}" fill="#4a7fb5"/>'
        for i, high in enumerate(150 * counts / top)
    )
    line = " ".join(f"{20 * i + 9},{160 - 150 * n / top:.1f}" for i, n in enumerate(normal))
    caption = "error in standard errors of the reference, -6 to 6; line: what noise alone would give"
    return (
        f'<figure><svg width="480" height="162">{bars}'
        f'<polyline points="{line}" fill="none" stroke="#b00020"/></svg>'
        f"<figcaption>{caption}</figcaption></figure>"
    )


def _crops(found: VerifyReport) -> str:
    if not found.crops:
        return ""
    text = "<h2>Around the worst texels</h2>"
    for crop in found.crops:
        middle = _usual(crop.reference.reshape(-1, crop.reference.shape[2]).astype(np.float64))
        where = f"{crop.channel}, page {crop.page}, rows from {crop.row}, columns from {crop.column}"
        text += "<div>" + _figure(_shown(crop.stored, middle), f"stored: {where}", 8)
        text += _figure(_shown(crop.reference, middle), "path-traced", 8)
        shade = np.repeat((np.clip(crop.error, 0, 1) * 255).astype(np.uint8)[..., None], 3, axis=2)
        text += _figure(shade, f"FLIP, mean {crop.flip:.3f}", 8) + "</div>"
    return text


def _worst_table(found: VerifyReport) -> str:
    rows = ""
    for entry in found.worst:
        position = ", ".join(f"{x:.3f}" for x in entry["position"])
        value, truth = (" ".join(f"{x:.4g}" for x in entry[key]) for key in ("value", "reference"))
        rows += (
            f"<tr><td>{_escaped(entry['object'])}</td><td>{entry['node']}</td><td>{entry['channel']}</td>"
            f"<td>{entry['page']}, {entry['row']}, {entry['column']}</td><td>{position}</td><td>{value}</td>"
            f"<td>{truth}</td><td>{entry['error']:.1%}</td></tr>"
        )
    head = "<tr><th>object</th><th>node</th><th>channel</th><th>page, row, column</th><th>position</th>"
    head += "<th>stored</th><th>path-traced</th><th>error</th></tr>"
    return f"<h2>Worst texels</h2><div class=wide><table>{head}{rows}</table></div>"


def _objects_table(found: VerifyReport) -> str:
    shown = ("texels", "bias", "median", "p95", "noise_floor")
    rows = ""
    for entry in found.objects:
        name = f"<tr><td>{_escaped(entry['object'])}</td><td>{entry['node']}</td>"
        for channel, values in entry["channels"].items():
            cells = "".join(f"<td>{_number(values[key])}</td>" for key in shown)
            rows += f"{name}<td>{channel}</td>{cells}</tr>"
    head = "".join(f"<th>{title}</th>" for title in ("object", "node", "channel", *shown))
    return f"<h2>Objects</h2><div class=wide><table><tr>{head}</tr>{rows}</table></div>"
