"""The text of `baker check` groups findings by code, and says how many findings it does not list."""

from __future__ import annotations

import io
from pathlib import Path
from types import SimpleNamespace

from baker.checks.finding import Finding, Location, RawFinding
from baker.checks.report import write_text


def text_of(findings, **options) -> list[str]:
    report = SimpleNamespace(path=Path("a.glb"), findings=findings, passed=True, ignored=[], seconds=0.1)
    stream = io.StringIO()
    write_text(report, stream, **options)
    return stream.getvalue().splitlines()


def finding(number, severity="warning", code="open-edges"):
    found = RawFinding(f"{number} holes", Location(f"part {number}", number), faces=(1, 2), primitive=0)
    return Finding(code, severity, found.message, "fill the holes", found)


def test_a_single_finding_has_one_line_and_its_advice():
    assert text_of([finding(1)])[:2] == [
        "a.glb: warning: open-edges: 'part 1' (node 1) 1 holes",
        "    to do: fill the holes",
    ]


def test_findings_of_a_code_are_grouped_with_three_objects_and_the_advice_once():
    lines = text_of([finding(1), finding(2, code="zero-area"), *(finding(k) for k in range(3, 7))])
    assert lines[0] == "a.glb: warning: open-edges: 5 findings"
    assert lines[1:4] == [f"    'part {k}' (node {k}) {k} holes" for k in (1, 3, 4)]
    assert lines[4] == "    and 2 more; -v shows all"
    assert [line for line in lines if "to do" in line] == ["    to do: fill the holes"] * 2


def test_verbose_shows_all():
    lines = text_of([finding(k) for k in range(6)], verbose=1)
    assert sum("holes" in line and "part" in line for line in lines) == 6
    assert "    faces 1 2 of primitive 0" in lines
    assert not any("-v" in line for line in lines)


def test_hidden_infos_are_announced_with_their_flag():
    findings = [finding(1, "info"), finding(2)]
    assert text_of(findings)[-1] == "a.glb: passed: 0 errors, 1 warning, 1 info; -v shows the infos (0.1 s)"
    assert "-v" not in text_of(findings, verbose=1)[-1]
    assert "-v" not in text_of([finding(2)])[-1]
