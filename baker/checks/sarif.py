"""Writes the result of a check as SARIF, a format of findings that code hosts display.

Based on: OASIS, Static Analysis Results Interchange Format (SARIF) Version 2.1.0, 2020.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from baker.checks.finding import Finding, finding_json
from baker.checks.rule import Check, all_checks
from baker.checks.run import CheckReport
from baker.core.printable import printable
from baker.core.version import VERSION

SCHEMA = "https://docs.oasis-open.org/sarif/sarif/v2.1.0/errata01/os/schemas/sarif-schema-2.1.0.json"
_LEVEL = {"info": "note", "warning": "warning", "error": "error"}


def sarif_log(reports: Sequence[CheckReport], folder: Path) -> dict[str, Any]:
    """Return a SARIF log with one run that contains the findings about all scenes.

    Parameters
    ----------
    reports : sequence of CheckReport
        One for each scene.
    folder : Path
        Folder that the URIs of scenes below it are relative to, usually the root of a repository. Other
        scenes have absolute URIs.

    Returns
    -------
    dict
        The SARIF log as JSON values.
    """
    checks = all_checks()
    index = {entry.code: k for k, entry in enumerate(checks)}
    driver = {
        "name": "baker",
        "semanticVersion": VERSION,
        "rules": [_rule(entry) for entry in checks],
    }
    results = [
        _result(finding, index, _uri(report.path, folder), suppressed=suppressed)
        for report in reports
        for findings, suppressed in ((report.findings, False), (report.ignored, True))
        for finding in findings
    ]
    run = {
        "tool": {"driver": driver},
        "columnKind": "unicodeCodePoints",
        "artifacts": [{"location": {"uri": _uri(report.path, folder)}} for report in reports],
        "results": results,
    }
    return {"$schema": SCHEMA, "version": "2.1.0", "runs": [run]}


def _rule(entry: Check) -> dict[str, Any]:
    return {
        "id": entry.code,
        "shortDescription": {"text": entry.title},
        "fullDescription": {"text": " ".join(entry.docs.split())},
        "help": {"text": f"{entry.fix[:1].upper()}{entry.fix[1:]}."},
        "defaultConfiguration": {"level": _LEVEL[entry.severity]},
        "properties": {"tags": [entry.group]},
    }


def _result(finding: Finding, index: dict[str, int], uri: str, *, suppressed: bool) -> dict[str, Any]:
    location: dict[str, Any] = {"physicalLocation": {"artifactLocation": {"uri": uri}}}
    name = printable(finding.object)
    if name:
        node = "" if finding.node is None else f"nodes[{finding.node}]"
        logical = {"name": name, "kind": "object"}
        location["logicalLocations"] = [{**logical, "fullyQualifiedName": node} if node else logical]
    where = f"{name}: " if name else ""
    result: dict[str, Any] = {
        "ruleId": finding.code,
        "ruleIndex": index[finding.code],
        "level": _LEVEL[finding.severity],
        "message": {"text": f"{where}{finding.message}. To do: {finding.fix}."},
        "locations": [location],
        # The fingerprint depends on neither other findings nor counts, so it stays equal if these change.
        "partialFingerprints": {"object/v1": f"{finding.code}@{name}"},
        "properties": finding_json(finding),
    }
    if suppressed:
        result["suppressions"] = [{"kind": "external", "justification": "ignored by the check's settings"}]
    return result


def _uri(path: Path, folder: Path) -> str:
    from urllib.parse import quote

    full = path.resolve()
    if full.is_relative_to(folder.resolve()):
        return quote(full.relative_to(folder.resolve()).as_posix())
    return full.as_uri()
