"""What a check found: where, how often, how bad, and what to do."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

# From harmless to harmful; the position is the rank.
SEVERITIES = ("info", "warning", "error")
# Most face numbers or face pairs that one finding names.
MOST_FACES = 10


@dataclass(frozen=True)
class Place:
    """The thing that a finding is about.

    Attributes
    ----------
    object : str
        Name of the node (of a mesh that stands in several places: the first), light or material.
    node : int or None
        glTF node index.
    """

    object: str = ""
    node: int | None = None


@dataclass(frozen=True)
class RawFinding:
    """What a check function yields; the check's own severity and advice are added by `run_check`.

    Attributes
    ----------
    message : str
        One sentence with the numbers.
    place : Place
    count : int
        How many faces, vertices, edges ... are concerned.
    percent : float or None
        Share of the object concerned.
    primitive : int or None
        Primitive of the first face concerned.
    faces : tuple of int
        Up to ten face numbers, counted within their primitive.
    pairs : tuple of (int, int)
        Up to ten pairs of faces.
    position : (3,) tuple or None
        A place in the world, metres, where to look.
    severity : str or None
        Where it differs from the check's.
    more : dict
        Further numbers for machines.
    """

    message: str
    place: Place = field(default_factory=Place)
    count: int = 1
    percent: float | None = None
    primitive: int | None = None
    faces: tuple[int, ...] = ()
    pairs: tuple[tuple[int, int], ...] = ()
    position: tuple[float, float, float] | None = None
    severity: str | None = None
    more: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Finding:
    """A finding as it is reported."""

    code: str
    severity: str
    message: str
    fix: str
    found: RawFinding

    @property
    def object(self) -> str:
        """Return the name of the object concerned, empty for the whole scene."""
        return self.found.place.object

    @property
    def node(self) -> int | None:
        """Return the node index of the object concerned."""
        return self.found.place.node

    @property
    def rank(self) -> int:
        """Return the severity as a number: 0 info, 1 warning, 2 error."""
        return SEVERITIES.index(self.severity)


def finding_json(finding: Finding) -> dict[str, Any]:
    """Return a finding as plain JSON values; what does not apply is left out, the contract's keys stay."""
    found = finding.found
    value: dict[str, Any] = {
        "code": finding.code,
        "severity": finding.severity,
        "object": finding.object,
        "node": finding.node,
        "count": found.count,
        "message": finding.message,
        "fix": finding.fix,
    }
    if found.percent is not None:
        value["percent"] = round(found.percent, 4)
    if found.primitive is not None:
        value["primitive"] = found.primitive
    if found.faces:
        value["faces"] = list(found.faces)
    if found.pairs:
        value["pairs"] = [list(pair) for pair in found.pairs]
    if found.position is not None:
        value["position"] = [round(x, 6) for x in found.position]
    return {**value, **found.more}
