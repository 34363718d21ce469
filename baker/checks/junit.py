"""Writes the result of a check as JUnit test cases, one for each pair of scene and rule."""

from __future__ import annotations

from collections.abc import Sequence

from baker.checks.finding import SEVERITIES
from baker.checks.rule import all_checks
from baker.checks.run import CheckReport
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
            problem = "; ".join(f"{f.object}: {f.message}" if f.object else f.message for f in failing)
            seconds = report.timings.get(entry.code, 0.0)
            cases.append(Case(entry.code, str(report.path), problem, seconds))
    return junit_text("baker check", cases)
