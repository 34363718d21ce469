"""JUnit reports: counts, XML escapes, and files that are written completely or not at all."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

import pytest

from baker.core.errors import ResourceError
from baker.io.junit import Case, junit_text, write_text


def test_junit_counts_and_escapes():
    cases = [Case("a", "g"), Case("b<", "g", 'too "big" & bad', 1.5), Case("c", "g", "no file", error=True)]
    suite = ElementTree.fromstring(junit_text("baker verify", cases).split("\n", 1)[1])[0]
    assert suite.attrib["tests"] == "3"
    assert suite.attrib["failures"] == "1"
    assert suite.attrib["errors"] == "1"
    assert [len(case) for case in suite] == [0, 1, 1]
    assert suite[1].attrib["name"] == "b<"
    assert suite[1][0].tag == "failure"
    assert suite[1][0].attrib["message"] == 'too "big" & bad'
    assert suite[2][0].tag == "error"


def test_a_report_is_whole_or_not_there(tmp_path: Path):
    write_text(tmp_path / "new" / "r.xml", "text")
    assert [p.name for p in (tmp_path / "new").iterdir()] == ["r.xml"]
    (tmp_path / "file").write_text("")
    with pytest.raises(ResourceError, match="report"):
        write_text(tmp_path / "file" / "r.xml", "text")
