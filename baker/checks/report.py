"""The result of a check as JSON and as text."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TextIO

from baker.checks.finding import SEVERITIES, finding_json
from baker.checks.run import CheckReport
from baker.checks.scenes import Unreadable


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
    """Write each finding on one line with its advice on the next, then a summary line.

    Parameters
    ----------
    report : CheckReport
        The result for one scene.
    stream : TextIO
        Text stream to write to.
    verbose : int
        If above 0, findings of severity info, face numbers and the share of each object are written as well.
    cost : bool
        Whether the finding `cost` is written, with the share of each object.
    """
    shown = [
        finding
        for finding in report.findings
        if verbose or finding.severity != "info" or (cost and finding.code == "cost")
    ]
    for finding in shown:
        where = f" '{finding.object}'" if finding.object else ""
        if finding.node is not None:
            where += f" (node {finding.node})"
        stream.write(f"{report.path}: {finding.severity}: {finding.code}:{where} {finding.message}\n")
        faces = finding.found.faces
        if faces and verbose:
            primitive = finding.found.primitive
            stream.write(f"    faces {' '.join(map(str, faces))} of primitive {primitive}\n")
        stream.write(f"    {finding.fix}\n")
        if finding.code == "cost" and (cost or verbose):
            for entry in finding.found.more["objects"]:
                stream.write(f"    {entry['percent']:6.2f}%  {entry['texels']:9} texels  {entry['object']}\n")
    counts = _counts(report)
    parts = [f"{counts[name]} {name}{'s' if counts[name] != 1 else ''}" for name in reversed(SEVERITIES)]
    tail = f", {len(report.ignored)} ignored" if report.ignored else ""
    verdict = "passed" if report.passed else "FAILED"
    stream.write(f"{report.path}: {verdict}: {', '.join(parts)}{tail} ({report.seconds:.1f} s)\n")


def _counts(report: CheckReport) -> dict[str, int]:
    return {name: sum(f.severity == name for f in report.findings) for name in SEVERITIES}
