"""Writes the result of a check as JSON and as text."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TextIO

from baker.checks.finding import SEVERITIES, Finding, finding_json
from baker.checks.run import CheckReport
from baker.checks.scenes import Unreadable
from baker.core.printable import printable

# Largest number of findings of one code and severity that are written without `verbose`.
SHOWN = 3


def report_json(reports: Sequence[CheckReport], unreadable: Sequence[Unreadable] = ()) -> dict[str, Any]:
    """Return the JSON object that `baker check --json` prints for all scenes together.

    Parameters
    ----------
    reports : sequence of CheckReport
        One for each scene that could be read.
    unreadable : sequence of Unreadable
        The scenes that could not be read. Each of them fails the check.

    Returns
    -------
    dict
        Keys `passed`, `fail_on`, `findings` and `scenes`.
    """
    scenes: list[dict[str, Any]] = [
        {
            "scene": str(report.path),
            "passed": report.passed,
            "counts": _counts(report),
            "ignored": len(report.ignored),
            "seconds": round(report.seconds, 3),
        }
        for report in reports
    ]
    scenes += [
        {"scene": str(x.path), "passed": False, "error": {"kind": x.error.kind, "message": x.error.message}}
        for x in unreadable
    ]
    findings = [
        {**finding_json(finding), "scene": str(report.path)}
        for report in reports
        for finding in report.findings
    ]
    return {
        "passed": not unreadable and all(report.passed for report in reports),
        "fail_on": reports[0].fail_on if reports else "error",
        "findings": findings,
        "scenes": scenes,
    }


def write_text(report: CheckReport, stream: TextIO, *, verbose: int = 0, cost: bool = False) -> None:
    """Write the findings as groups of equal severity and code, each with its advice, then a summary line.

    Parameters
    ----------
    report : CheckReport
        The result for one scene.
    stream : TextIO
        Text stream to write to.
    verbose : int
        If above 0, the text also has findings of severity info, all findings of each group, and numbers of
        faces.
    cost : bool
        Whether the text has the finding `cost`, even if `verbose` is 0.
    """
    groups: dict[tuple[str, str], list[Finding]] = {}
    for finding in report.findings:
        if verbose or finding.severity != "info" or (cost and finding.code == "cost"):
            groups.setdefault((finding.severity, finding.code), []).append(finding)
    for group in groups.values():
        _write_group(str(report.path), group, stream, verbose=verbose)
        if group[0].code == "cost":
            for entry in group[0].found.more["objects"]:
                name = printable(entry["object"])
                stream.write(f"    {entry['percent']:6.2f}%  {entry['texels']:9} texels  {name}\n")
    counts = _counts(report)
    parts = [f"{counts[name]} {name}{'s' if counts[name] != 1 else ''}" for name in reversed(SEVERITIES)]
    tail = f", {len(report.ignored)} ignored" if report.ignored else ""
    hidden = counts["info"] - sum(len(group) for (severity, _), group in groups.items() if severity == "info")
    tail += "; -v shows the infos" if hidden else ""
    verdict = "passed" if report.passed else "FAILED"
    stream.write(f"{report.path}: {verdict}: {', '.join(parts)}{tail} ({report.seconds:.1f} s)\n")


def _write_group(path: str, group: list[Finding], stream: TextIO, *, verbose: int) -> None:
    """Write the findings of one code and severity, and their advice once."""
    head = f"{path}: {group[0].severity}: {group[0].code}:"
    if len(group) == 1:
        stream.write(f"{head}{_subject(group[0])} {group[0].message}\n")
        _write_faces(group[0], stream, verbose=verbose)
    else:
        stream.write(f"{head} {len(group)} findings\n")
        for finding in group if verbose else group[:SHOWN]:
            stream.write(f"   {_subject(finding)} {finding.message}\n")
            _write_faces(finding, stream, verbose=verbose)
        if not verbose and len(group) > SHOWN:
            stream.write(f"    and {len(group) - SHOWN} more; -v shows all\n")
    stream.write(f"    to do: {group[0].fix}\n")


def _subject(finding: Finding) -> str:
    where = f" '{printable(finding.object)}'" if finding.object else ""
    return where if finding.node is None else f"{where} (node {finding.node})"


def _write_faces(finding: Finding, stream: TextIO, *, verbose: int) -> None:
    if finding.found.faces and verbose:
        faces = " ".join(map(str, finding.found.faces))
        stream.write(f"    faces {faces} of primitive {finding.found.primitive}\n")


def _counts(report: CheckReport) -> dict[str, int]:
    return {name: sum(f.severity == name for f in report.findings) for name in SEVERITIES}
