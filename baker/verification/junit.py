"""Writes a verification as a JUnit report with one test case for each limit."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from baker.io.junit import Case, junit_text, write_text
from baker.verification.verify import VerifyReport


def write_junit(path: Path, found: VerifyReport, in_words: Callable[[str], str] = str) -> None:
    """Write the JUnit file.

    Parameters
    ----------
    path : Path
        File to write.
    found : VerifyReport
        Result of `verify`.
    in_words : callable
        Replaces the names of settings in backticks in a message, for example by flags of the command line.

    Raises
    ------
    ResourceError
        If the file cannot be written.
    """
    scene = found.bake.folder.name
    cases = []
    for verdict in found.verdicts:
        problem = ""
        if verdict.failed:
            remark = found.channels[verdict.limit.channel].remarks.get(verdict.limit.metric)
            problem = in_words(verdict.sentence() + (f"; {remark}" if remark else ""))
        cases.append(Case(f"not {verdict.limit}", scene, problem))
    if cases:
        cases[0] = Case(cases[0].name, cases[0].group, cases[0].problem, found.seconds)
    write_text(path, junit_text("baker verify", cases))
