"""Writes JUnit XML for build servers: named test cases that passed, failed or could not run.

Based on: the junit-10.xsd of the Jenkins xUnit plugin.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

from baker.core.printable import printable, printable_lines
from baker.io.temporary import write_atomically


@dataclass(frozen=True)
class Case:
    """A test case.

    Attributes
    ----------
    name : str
    group : str
        Value of the attribute `classname`: the path of a scene, an output folder or its name, or "batch".
    problem : str
        Why the case failed; empty if it passed.
    seconds : float
    error : bool
        True if a job of a batch failed with exit code 4 (a resource, a crash). `problem` is then written as
        an error and not as a failure.
    """

    name: str
    group: str
    problem: str = ""
    seconds: float = 0.0
    error: bool = False


def junit_text(suite: str, cases: Sequence[Case]) -> str:
    """Return the text of a JUnit XML document with one test suite.

    Parameters
    ----------
    suite : str
        Name of the suite.
    cases : sequence of Case
        Test cases of the suite.

    Returns
    -------
    str
        XML.
    """
    failed = sum(1 for case in cases if case.problem and not case.error)
    errors = sum(1 for case in cases if case.problem and case.error)
    seconds = sum(case.seconds for case in cases)
    counts = {
        "tests": str(len(cases)),
        "failures": str(failed),
        "errors": str(errors),
        "time": f"{seconds:.3f}",
    }
    root = ElementTree.Element("testsuites", counts)
    node = ElementTree.SubElement(root, "testsuite", {"name": suite, **counts})
    for case in cases:
        names = {"name": printable(case.name), "classname": printable(case.group)}
        entry = ElementTree.SubElement(node, "testcase", {**names, "time": f"{case.seconds:.3f}"})
        if case.problem:
            kind = "error" if case.error else "failure"
            problem = ElementTree.SubElement(entry, kind, {"message": printable(case.problem)})
            problem.text = printable_lines(case.problem)
    ElementTree.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ElementTree.tostring(root, encoding="unicode") + "\n"


def write_text(path: Path, text: str) -> None:
    """Write a report atomically.

    Parameters
    ----------
    path : Path
        The file; its parents are created.
    text : str
        The content of the file.

    Raises
    ------
    ResourceError
        If the file cannot be written.
    """
    write_atomically(path, text.encode(), "report")
