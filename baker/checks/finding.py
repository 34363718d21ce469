"""Defines a finding of a check: its location, counts, severity and advice."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from baker.core.printable import message_line

# Severities in ascending order. The index is the rank.
SEVERITIES = ("info", "warning", "error")
# Largest number of faces or face pairs that one finding lists.
MOST_FACES = 10


@dataclass(frozen=True)
class Location:
    """The object that a finding is about.

    Attributes
    ----------
    object : str
        Name of the node, light or material. For a mesh, the name of the first node that has it. Empty if the
        finding is about the whole scene.
    node : int or None
        Index of the node in the glTF file.
    """

    object: str = ""
    node: int | None = None


@dataclass(frozen=True)
class RawFinding:
    """A finding as a rule yields it. `run_check` adds the code, severity and advice of the rule.

    Attributes
    ----------
    message : str
        One sentence that states what was found, with its numbers.
    location : Location
    count : int
        Number of defective faces, vertices, edges or other elements.
    percent : float or None
        Share of the object that is defective, percent.
    primitive : int or None
        Index, in the mesh, of the primitive that contains the first defective face.
    faces : tuple of int
        Up to `MOST_FACES` defective faces, as numbers within their primitive.
    pairs : tuple of (int, int)
        Up to `MOST_FACES` pairs of defective faces, as numbers within their primitives.
    position : (3,) tuple or None
        Position of the defect, metres, world.
    severity : str or None
        Severity of this finding if it differs from that of the rule.
    more : dict
        Additional keys of the finding in the output of `--json`.
    """

    message: str
    location: Location = field(default_factory=Location)
    count: int = 1
    percent: float | None = None
    primitive: int | None = None
    faces: tuple[int, ...] = ()
    pairs: tuple[tuple[int, int], ...] = ()
    position: tuple[float, float, float] | None = None
    severity: str | None = None
    more: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Convert the message to one line with `message_line`."""
        object.__setattr__(self, "message", message_line(self.message))


@dataclass(frozen=True)
class Finding:
    """A finding with the code, severity and advice of its rule.

    Attributes
    ----------
    code : str
        Code of the rule.
    severity : str
        One of `SEVERITIES`.
    message : str
        One sentence that states what was found.
    fix : str
        Advice of the rule, one line.
    found : RawFinding
        The finding as the rule yielded it.
    """

    code: str
    severity: str
    message: str
    fix: str
    found: RawFinding

    @property
    def object(self) -> str:
        """Return the name of the defective object, empty for the whole scene."""
        return self.found.location.object

    @property
    def node(self) -> int | None:
        """Return the node index of the defective object, or None."""
        return self.found.location.node

    @property
    def rank(self) -> int:
        """Return the severity as a number: 0 info, 1 warning, 2 error."""
        return SEVERITIES.index(self.severity)


def finding_json(finding: Finding) -> dict[str, Any]:
    """Return a finding as JSON values. Keys without a value are left out."""
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
