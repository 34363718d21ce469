"""What judgements of groups have in common: rows of figures, and the worst that is no chance."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baker.metrics.groups import LEAST, GroupFigures, bright_light, compare_group
from baker.verification.judgements.judgement import Evidence

# Differences are held against at least this much light: no one sees a percent of the AO of a corner.
LEAST_LIGHT = {"irradiance": 0.0, "ao": 0.2}
# A group whose typical error comes from so few places is not told from chance.
LEAST_NOISE = 40


@dataclass(frozen=True)
class Group:
    """Some of the points and what was found of them.

    Attributes
    ----------
    name : str
        As it is called in a sentence.
    member : (m,) int64
        Numbers of points.
    found : GroupFigures
    """

    name: str
    member: NDArray[np.int64]
    found: GroupFigures

    @property
    def badness(self) -> float:
        """Return the largest deviation that is no chance, as groups are ordered."""
        return max(abs(self.found.sure_bias), abs(self.found.sure_colour), self.noise)

    @property
    def noise(self) -> float:
        """Return the typical error beyond the reference's noise, 0 for a group that is too small."""
        return self.found.sure_noise if self.found.texels >= LEAST_NOISE else 0.0


def make_groups(evidence: Evidence, members: list[tuple[str, NDArray[np.int64]]]) -> list[Group]:
    """Compare each set of points that is large enough, worst first."""
    mine = evidence.texels
    bright = bright_light(evidence.compared.reference[mine])
    groups = [
        Group(
            name, member, compare_group(evidence.compared.of(member), bright, LEAST_LIGHT[evidence.channel])
        )
        for name, member in members
        if len(member) >= LEAST
    ]
    return sorted(groups, key=lambda group: -group.badness)


def worst_figures(prefix: str, groups: list[Group], channel: str) -> tuple[dict[str, float], dict[str, str]]:
    """Return PREFIX_bias, PREFIX_colour and PREFIX_noise of the worst group in each, and remarks on them."""
    figures = {f"{prefix}_{kind}": 0.0 for kind in ("bias", "colour", "noise")}
    remarks = {}
    for group in groups:
        found, where = group.found, f"{channel} of {group.name}"
        if abs(found.sure_bias) > abs(figures[f"{prefix}_bias"]):
            figures[f"{prefix}_bias"] = found.sure_bias
            remarks[f"{prefix}_bias"] = (
                f"{where} is off by {found.bias:+.1%} +- {found.bias_se:.1%} on the whole"
                f" ({found.texels} texels)"
            )
        if abs(found.sure_colour) > abs(figures[f"{prefix}_colour"]):
            figures[f"{prefix}_colour"] = found.sure_colour
            shares = ", ".join(
                f"{name} {shift:+.1%}"
                for name, shift in zip(("red", "green", "blue"), found.colour, strict=True)
            )
            remarks[f"{prefix}_colour"] = f"the colour of {where} is off: {shares}"
        if group.noise > figures[f"{prefix}_noise"]:
            figures[f"{prefix}_noise"] = group.noise
            remarks[f"{prefix}_noise"] = (
                f"{where} is typically off by {found.typical:.1%}, of which {found.typical_noise:.1%} is"
                " noise of the reference"
            )
    return figures, remarks
