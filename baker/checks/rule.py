"""Registers the rules of `baker check`, with the severity, advice and documentation of each rule.

A rule is a function that finds one kind of defect: it takes a `CheckContext` and yields `RawFinding` objects.
The code of a rule is its name in reports, such as `zero-area`. A rule is decorated with `check` and
defined in a file of `baker/checks/rules/`. The docstring of a rule is its section of docs/CHECKS.md: the
first line names the defect, and the other lines describe the effect of the defect and the test for it.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable
from dataclasses import dataclass

from baker.checks.context import CheckContext
from baker.checks.finding import SEVERITIES, Finding, RawFinding
from baker.core.registry import Registry

CheckFunction = Callable[[CheckContext], Iterable[RawFinding]]
GROUPS = ("geometry", "uv", "light", "file", "cost")


@dataclass(frozen=True)
class Check:
    """A registered rule.

    Attributes
    ----------
    code : str
        Name of the rule and of its findings, the same in all versions.
    group : str
        Chapter of docs/CHECKS.md, one of `GROUPS`.
    severity : str
        Default severity, one of `baker.checks.finding.SEVERITIES`. A finding may override it.
    fix : str
        Advice, one line.
    docs : str
        The docstring of the rule.
    function : callable
        The rule itself.
    in_bake : bool
        Whether docs/CHECKS.md marks the rule with "in a bake". Marked are the rules that
        `baker.checks.in_bake` runs in every bake. The rule `light-range` is not marked, because it runs only
        in bakes of light.
    """

    code: str
    group: str
    severity: str
    fix: str
    docs: str
    function: CheckFunction
    in_bake: bool = False

    @property
    def title(self) -> str:
        """Return the first line of the rule's docstring, which names the defect."""
        return self.docs.splitlines()[0]


CHECKS: Registry[Check] = Registry("baker.checks.rules")


def check(
    code: str, *, group: str, severity: str, fix: str, in_bake: bool = False
) -> Callable[[CheckFunction], CheckFunction]:
    """Return a decorator that registers a function as the rule with the given code.

    Parameters
    ----------
    code : str
        Lower-case words joined by dashes. Codes of rules about lightmap uv have the prefix `uv.`.
    group : str
        One of `GROUPS`.
    severity : str
        "info", "warning" or "error".
    fix : str
        One line of advice, without a full stop.
    in_bake : bool
        See `Check`.

    Returns
    -------
    callable
        The decorator, which returns the function unchanged.

    Raises
    ------
    ValueError
        For an unknown group or severity, a rule without docstring, or a code that is registered already.
    """

    def add(function: CheckFunction) -> CheckFunction:
        docs = inspect.cleandoc(function.__doc__ or "")
        if group not in GROUPS:
            raise ValueError(f"check '{code}': group '{group}' is none of {', '.join(GROUPS)}")
        if severity not in SEVERITIES:
            raise ValueError(f"check '{code}': severity '{severity}' is none of {', '.join(SEVERITIES)}")
        if not docs:
            raise ValueError(f"check '{code}' has no docstring, which is its documentation")
        CHECKS.register(code)(Check(code, group, severity, fix, docs, function, in_bake))
        return function

    return add


def all_checks() -> list[Check]:
    """Return every rule, sorted by group and code."""
    found = [CHECKS.require(name, "check") for name in CHECKS.names()]
    return sorted(found, key=lambda entry: (GROUPS.index(entry.group), entry.code))


def run_check(entry: Check, context: CheckContext) -> list[Finding]:
    """Run one rule on a context and return its findings with severity and advice."""
    return [
        Finding(entry.code, found.severity or entry.severity, found.message, entry.fix, found)
        for found in entry.function(context)
    ]
