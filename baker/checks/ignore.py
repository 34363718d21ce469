"""Parses patterns of accepted findings, which do not fail a check.

A pattern is `CODE` or `CODE@OBJECT`. In both parts, `*` matches any characters, `?` one character, and `[ab]`
one of the characters in brackets. Case matters.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from fnmatch import fnmatchcase

from baker.checks.rule import CHECKS
from baker.core.names import unknown_name
from baker.core.printable import printable


@dataclass(frozen=True)
class Ignore:
    """A pattern of accepted findings.

    Attributes
    ----------
    code, object : str
        Patterns for the code and for the name of the object.
    """

    code: str
    object: str = "*"

    def matches(self, code: str, name: str) -> bool:
        """Return whether the pattern matches a finding's code and object; `name` also matches as printed."""
        names = (name, printable(name))
        return fnmatchcase(code, self.code) and any(fnmatchcase(text, self.object) for text in names)


def parse_ignore(rules: Iterable[str]) -> list[Ignore]:
    """Parse texts of the form `CODE[@OBJECT]`.

    Raises
    ------
    SettingsError
        If a code matches no check.
    """
    known = CHECKS.names()
    out = []
    for rule in rules:
        code, at, name = rule.partition("@")
        if not any(fnmatchcase(entry, code) for entry in known):
            listed = "docs/CHECKS.md lists all codes"
            raise unknown_name("finding", code, known, object="ignore", listed=listed)
        out.append(Ignore(code, name if at else "*"))
    return out
