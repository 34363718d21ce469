"""Parses patterns of accepted findings, which do not fail a check, from settings and from extras of nodes.

A pattern is `CODE` or `CODE@OBJECT`. In both parts, `*` matches any characters, `?` one character, and `[ab]`
one of the characters in brackets. Case matters.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from typing import TYPE_CHECKING

from baker.checks.rule import CHECKS
from baker.checks.settings import check_extras
from baker.core.names import unknown_name
from baker.core.printable import printable

if TYPE_CHECKING:
    from baker.core.scene import Scene


@dataclass(frozen=True)
class Ignore:
    """A pattern of accepted findings.

    Attributes
    ----------
    code, object : str
        Patterns for the code and for the name of the object.
    node : int or None
        Index of a node in the glTF file. If it is not None, findings about other nodes do not match.
    """

    code: str
    object: str = "*"
    node: int | None = None

    def matches(self, code: str, name: str, node: int | None = None) -> bool:
        """Return whether the pattern matches a finding's code, object and node (None if it has no node).

        The pattern for the object may match the name in the file or the name as it is printed.
        """
        if self.node is not None and node not in (None, self.node):
            return False
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


def ignored_by_nodes(scene: Scene) -> list[Ignore]:
    """Return the patterns in the extras of nodes with a mesh.

    `extras.baker.check.ignore` of a node is a code, a list of codes, or true for all codes. The extras are
    read only if the scene was loaded with `lenient=True`.

    Raises
    ------
    SettingsError
        If a code matches no check.
    """
    if scene.source is None or scene.source_scene is None:
        return []
    nodes = scene.source.json.get("nodes", [])
    found = []
    for instance in scene.source_scene.instances:
        table = check_extras(nodes[instance.node]) if instance.node < len(nodes) else {}
        codes = table.get("ignore", [])
        codes = ["*"] if codes is True else [codes] if isinstance(codes, str) else codes
        for rule in parse_ignore(code for code in codes if isinstance(code, str)):
            found.append(replace(rule, object=_literal(instance.name), node=instance.node))
    return found


def _literal(name: str) -> str:
    return "".join(f"[{c}]" if c in "*?[" else c for c in name)
