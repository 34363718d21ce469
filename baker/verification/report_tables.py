"""Makes the tables of the HTML report: limits, metrics, regions, worst texels and objects."""

from __future__ import annotations

from baker.io.html import escaped
from baker.metrics.figures import FIGURES, figure_text
from baker.verification.criteria.registry import METRIC_NAMES
from baker.verification.verify import VerifyReport

# Largest number of regions listed.
_REGIONS = 40


def _table(titles: tuple[str, ...], rows: str, *, wide: bool = False) -> str:
    head = "".join(f"<th>{title}</th>" for title in titles)
    table = f"<table><tr>{head}</tr>{rows}</table>"
    return f"<div class=wide>{table}</div>" if wide else table


def _meaning(name: str) -> str:
    """Return a table cell with the explanation of a metric."""
    return f"<td class=words>{escaped(FIGURES[name].phrase) if name in FIGURES else ''}</td>"


def limits_table(found: VerifyReport) -> str:
    """Return the limits that were applied, with values and explanations."""
    rows = ""
    for verdict in found.verdicts:
        limit = verdict.limit
        words = '<td class="bad">failed</td>' if verdict.failed else '<td class="good">holds</td>'
        rows += (
            f"<tr><td>{escaped(limit.channel)}.{escaped(limit.metric)}</td><td>{verdict.readable}</td>"
            f"<td>{escaped(limit.readable)}</td>{words}{_meaning(limit.metric)}</tr>"
        )
    default = found.settings.fail_if is None
    which = "the default limits" if default else "the given limits, which replace the default limits"
    note = (
        f"<p>These are {which}. No other limit applies: in a bake that passed, a single texel may be far off."
        " For signed figures the absolute value is compared.</p>"
    )
    titles = ("figure", "value", "fails if", "result", "meaning")
    return f"<h2>Limits</h2>{note}{_table(titles, rows, wide=True)}"


def regions_table(found: VerifyReport) -> str:
    """Return the regions with the largest deviations."""
    rows = ""
    for row in found.regions[:_REGIONS]:
        colour = " ".join(f"{shift:+.1%}" for shift in row["colour"])
        where = ", ".join(f"{x:.2f}" for x in row["position"])
        rows += (
            f"<tr><td>{row['channel']} of {escaped(row['region'])}<br>around {where}, of"
            f" {escaped(', '.join(row['objects']))}</td><td>{row['texels']}</td>"
            f"<td>{row['area']:.3g}</td><td>{row['light']:.4g}</td>"
            f"<td>{row['bias']:+.1%} &plusmn; {row['bias_se']:.1%}</td><td>{colour}</td>"
            f"<td>{row['typical']:.1%} ({row['typical_noise']:.1%})</td></tr>"
        )
    titles = ("region", "texels", "m2", "light", "bias", "colour", "typical (noise)")
    note = (
        "<p>Deviations of a region are relative to the light of that region. A region is a room, which is the"
        " surface that is visible from one point, or all texels of a room with a similar light level. The"
        " worst region is first; the part of a deviation that noise can explain does not count. typical is"
        " the median error of a texel; the number in brackets is the part of it that is noise of path"
        " tracing.</p>"
    )
    return f"<h2>Regions</h2>{note}{_table(titles, rows, wide=True)}"


def figures_table(found: VerifyReport) -> str:
    """Return all metrics of all channels, each with its explanation."""
    # Write one row for each metric, because a column for each metric would be too wide.
    rows = ""
    for key in (*METRIC_NAMES, "unresolved", "flip"):
        extra = {"unresolved": lambda name: found.channels[name].unresolved, "flip": found.flip}
        values = [
            extra[key](name) if key in extra else check.metrics.get(key)
            for name, check in found.channels.items()
        ]
        cells = "".join(f"<td>{figure_text(key, value)}</td>" for value in values)
        rows += f"<tr><td>{key}</td>{cells}{_meaning(key)}</tr>"
    titles = ("figure", *(escaped(name) for name in found.channels), "meaning")
    note = "Relative errors are in percent of the path-traced light. docs/ACCURACY.md defines each figure."
    return f"<h2>Figures</h2><p>{note}</p>{_table(titles, rows, wide=True)}"


def worst_table(found: VerifyReport) -> str:
    """Return the texels with the largest errors."""
    rows = ""
    for entry in found.worst:
        position = ", ".join(f"{x:.3f}" for x in entry["position"])
        value, truth = (" ".join(f"{x:.4g}" for x in entry[key]) for key in ("value", "reference"))
        rows += (
            f"<tr><td>{escaped(entry['object'])}</td><td>{entry['node']}</td><td>{entry['channel']}</td>"
            f"<td>{entry['page']}, {entry['row']}, {entry['column']}</td><td>{position}</td><td>{value}</td>"
            f"<td>{truth}</td><td>{entry['error']:.1%}</td></tr>"
        )
    titles = (
        "object", "node", "channel", "page, row, column", "position", "stored", "path-traced", "error",
    )  # fmt: skip
    return f"<h2>Worst texels</h2>{_table(titles, rows, wide=True)}"


def objects_table(found: VerifyReport) -> str:
    """Return the error of each object."""
    shown = ("texels", "bias", "median", "p95", "noise_floor")
    rows = ""
    for entry in found.objects:
        name = f"<tr><td>{escaped(entry['object'])}</td><td>{entry['node']}</td>"
        for channel, values in entry["channels"].items():
            cells = "".join(f"<td>{figure_text(key, values[key])}</td>" for key in shown)
            rows += f"{name}<td>{channel}</td>{cells}</tr>"
    return f"<h2>Objects</h2>{_table(('object', 'node', 'channel', *shown), rows, wide=True)}"
