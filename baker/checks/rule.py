"""The register of checks: one function a code, with severity, advice and the text of its docs.

A check function takes a `CheckContext` and yields `RawFinding`. Its docstring is its page of the docs: the
first line says what it finds, the rest why that matters and what it looks at.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable
from dataclasses import dataclass

from baker.checks.context import CheckContext
from baker.checks.finding import Finding, RawFinding
from baker.core.registry import Registry

CheckFunction = Callable[[CheckContext], Iterable[RawFinding]]
GROUPS = ("geometry", "uv", "light", "file", "cost")


@dataclass(frozen=True)
class Check:
    """A check with everything that is told about it.

    Attributes
    ----------
    group : str
        One of `GROUPS`.
    fix : str
        One line: what to do.
    in_bake : bool
        A bake runs it, too.
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
        """Return the first line of the docs."""
        return self.docs.splitlines()[0]


CHECKS: Registry[Check] = Registry("baker.checks.rules")


def check(
    code: str, *, group: str, severity: str, fix: str, in_bake: bool = False
) -> Callable[[CheckFunction], CheckFunction]:
    """Return a decorator that files a function as the check of `code`."""

    def add(function: CheckFunction) -> CheckFunction:
        docs = inspect.cleandoc(function.__doc__ or "")
        CHECKS.register(code)(Check(code, group, severity, fix, docs, function, in_bake))
        return function

    return add


def all_checks() -> list[Check]:
    """Return every check, by group, then by code."""
    found = [CHECKS.require(name, "check") for name in CHECKS.names()]
    return sorted(found, key=lambda entry: (GROUPS.index(entry.group), entry.code))


def run_check(entry: Check, context: CheckContext) -> list[Finding]:
    """Run one check."""
    return [
        Finding(entry.code, found.severity or entry.severity, found.message, entry.fix, found)
        for found in entry.function(context)
    ]
