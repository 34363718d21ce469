"""Compares groups of points and finds their largest significant deviations; used by several criteria."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baker.metrics.groups import MIN_POINTS, GroupMetrics, bright_light, compare_group
from baker.verification.criteria.criterion import ChannelData

# Smallest denominator of relative differences, by channel. In corners with little AO, a difference of 1 % of
# the AO is invisible.
MIN_LIGHT = {"irradiance": 0.0, "ao": 0.2}
# Number of points below which a group's own error counts as 0. (The own error is the relative spread of the
# values about the reference, without the reference's noise; see `baker.metrics.groups`.)
MIN_NOISE_POINTS = 40


@dataclass(frozen=True)
class Group:
    """A group of points with its metrics.

    Attributes
    ----------
    name : str
        Description of the group for messages.
    member : (m,) int64
        Indices of its points.
    found : GroupMetrics
        Deviations of the group.
    """

    name: str
    member: NDArray[np.int64]
    found: GroupMetrics

    @property
    def badness(self) -> float:
        """Return the largest significant deviation in bias, colour or own error."""
        return max(abs(self.found.sure_bias), abs(self.found.sure_colour), self.noise)

    @property
    def noise(self) -> float:
        """Return the significant part of the own error, 0 below `MIN_NOISE_POINTS` points."""
        return self.found.sure_noise if self.found.texels >= MIN_NOISE_POINTS else 0.0


def make_groups(data: ChannelData, members: list[tuple[str, NDArray[np.int64]]]) -> list[Group]:
    """Return the groups of at least `MIN_POINTS` points with their deviations, largest deviation first.

    members : list of (description, (m,) int64 indices of points)
    """
    mine = data.texels
    bright = bright_light(data.compared.reference[mine])
    groups = [
        Group(name, member, compare_group(data.compared.of(member), bright, MIN_LIGHT[data.channel]))
        for name, member in members
        if len(member) >= MIN_POINTS
    ]
    return sorted(groups, key=lambda group: -group.badness)


def worst_metrics(prefix: str, groups: list[Group], channel: str) -> tuple[dict[str, float], dict[str, str]]:
    """Return {metric: value} and {metric: remark} of the largest significant deviations of all groups.

    The metrics are `prefix` + "_bias", "_colour" and "_noise"; noise is the own error.
    """
    metrics = {f"{prefix}_{kind}": 0.0 for kind in ("bias", "colour", "noise")}
    remarks = {}
    for group in groups:
        found, where = group.found, f"{channel} of {group.name}"
        if abs(found.sure_bias) > abs(metrics[f"{prefix}_bias"]):
            metrics[f"{prefix}_bias"] = found.sure_bias
            remarks[f"{prefix}_bias"] = (
                f"{where} differs from path tracing by {found.bias:+.1%} +- {found.bias_se:.1%} on average"
                f" ({found.texels} texels)"
            )
        if abs(found.sure_colour) > abs(metrics[f"{prefix}_colour"]):
            metrics[f"{prefix}_colour"] = found.sure_colour
            shares = ", ".join(
                f"{name} {shift:+.1%}"
                for name, shift in zip(("red", "green", "blue"), found.colour, strict=True)
            )
            remarks[f"{prefix}_colour"] = f"the colour of {where} differs from path tracing: {shares}"
        if group.noise > metrics[f"{prefix}_noise"]:
            metrics[f"{prefix}_noise"] = group.noise
            remarks[f"{prefix}_noise"] = (
                f"{where} typically differs from path tracing by {found.typical:.1%}, of which"
                f" {found.typical_noise:.1%} is noise of path tracing"
            )
    return metrics, remarks
