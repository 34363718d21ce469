"""Limits on figures, as `fail_if` takes them: "irradiance.p95 > 0.05, ao.rmse > 0.02".

A limit names what must not be: it fails where its comparison is true. `bias` and the like are compared by
their size, so that a bake too dark fails like one too bright.
"""

from __future__ import annotations

import operator
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from baker.core.errors import SettingsError
from baker.core.names import unknown_name

_OPERATORS: dict[str, Callable[[float, float], bool]] = {
    ">=": operator.ge, "<=": operator.le, ">": operator.gt, "<": operator.lt,
}  # fmt: skip
_LIMIT = re.compile(r"\s*([A-Za-z_]\w*)\s*\.\s*([A-Za-z_]\w*)\s*(>=|<=|>|<)\s*([^\s,]+)\s*")
_SIZED = (
    "bias", "colour_bias", "region_bias", "region_colour", "object_bias", "object_colour", "chart_bias",
    "chart_colour", "whole_bias", "whole_colour", "edge_bias", "edge_colour",
    "exponent_error",
)  # fmt: skip


@dataclass(frozen=True)
class Limit:
    """One comparison.

    Attributes
    ----------
    channel, figure : str
    sign : str
        ">", ">=", "<" or "<=".
    number : float
    """

    channel: str
    figure: str
    sign: str
    number: float

    def __str__(self) -> str:
        """Return the limit as it is written."""
        return f"{self.channel}.{self.figure} {self.sign} {self.number:g}"


@dataclass(frozen=True)
class Verdict:
    """A limit held against a figure.

    Attributes
    ----------
    limit : Limit
    value : float or None
        None if there is no such figure (no texels): that fails.
    failed : bool
    """

    limit: Limit
    value: float | None
    failed: bool


def parse_limits(text: str, channels: Iterable[str], figures: Iterable[str]) -> list[Limit]:
    """Read an expression.

    Parameters
    ----------
    text : str
        Comparisons `channel.figure OP number`, separated by commas.
    channels, figures : names that may be used

    Raises
    ------
    SettingsError
        If it cannot be read, or names what does not exist.
    """
    limits = []
    channels, figures = list(channels), list(figures)
    for part in text.split(","):
        match = _LIMIT.fullmatch(part)
        if match is None:
            raise SettingsError(
                f"'{part.strip()}' is not of the form channel.figure > number", object="fail_if"
            )
        channel, figure, sign, number = match.groups()
        for what, name, known in (("channel", channel, channels), ("figure", figure, figures)):
            if name not in known:
                raise unknown_name(what, name, known, object="fail_if")
        try:
            value = float(number)
        except ValueError:
            raise SettingsError(f"'{number}' is not a number", object="fail_if") from None
        if value != value:
            raise SettingsError("a limit of nan is never reached", object="fail_if")
        limits.append(Limit(channel, figure, sign, value))
    return limits


def judge(
    limits: Iterable[Limit], channels: Mapping[str, Mapping[str, Any]], *, missing_fails: bool = True
) -> list[Verdict]:
    """Hold limits against figures.

    Parameters
    ----------
    channels : mapping of channel to mapping of figure to number or None
    missing_fails : bool
        A limit on a figure that is None fails.
    """
    verdicts = []
    for limit in limits:
        value = channels[limit.channel].get(limit.figure)
        if value is None:
            verdicts.append(Verdict(limit, None, missing_fails))
            continue
        size = abs(value) if limit.figure in _SIZED and limit.number >= 0 else value
        verdicts.append(Verdict(limit, value, _OPERATORS[limit.sign](size, limit.number)))
    return verdicts
