"""Writes the result of a check as JUnit test cases, one for each pair of scene and rule."""

from __future__ import annotations

from collections.abc import Sequence

from baker.checks.finding import SEVERITIES
from baker.checks.rule import all_checks
from baker.checks.run import CheckReport
from baker.core.printable import printable
from baker.io.junit import Case, junit_text


def check_junit(reports: Sequence[CheckReport]) -> str:
    """Return the JUnit document.

    A case fails if its rule has a finding of the severity `fail_on` or a higher one that is not ignored.

    Parameters
    ----------
    reports : sequence of CheckReport
        One for each scene.

    Returns
    -------
    str
        XML text.
    """
    cases = []
    for report in reports:
        limit = SEVERITIES.index(report.fail_on)
        for entry in all_checks():
            failing = [f for f in report.findings if f.code == entry.code and f.rank >= limit]
            found = [(printable(f.object), f.message) for f in failing]
            problem = "; ".join(f"{name}: {message}" if name else message for name, message in found)
            seconds = report.timings.get(entry.code, 0.0)
            cases.append(Case(entry.code, str(report.path), problem, seconds))
    return junit_text("baker check", cases)
