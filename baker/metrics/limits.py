"""Limits on metrics, as `fail_if` takes them: "irradiance.p95 > 0.05, ao.rmse > 0.02".

A limit is a condition for failure: the limit fails if its comparison is true. If the number is 0 or more, the
absolute value of a signed metric such as `bias` is compared, so that a bake that is too dark fails as well as
one that is too bright.
"""

from __future__ import annotations

import operator
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from baker.core.errors import SettingsError
from baker.core.names import unknown_name
from baker.metrics.figures import FIGURES, figure_text, limit_text

_OPERATORS: dict[str, Callable[[float, float], bool]] = {
    ">=": operator.ge, "<=": operator.le, ">": operator.gt, "<": operator.lt,
}  # fmt: skip
_LIMIT = re.compile(r"\s*([A-Za-z_]\w*)\s*\.\s*([A-Za-z_]\w*)\s*(>=|<=|>|<)\s*([^\s,]+)\s*")
# Metrics whose absolute value is compared with a limit of 0 or more.
_SIGNED = (
    "bias", "colour_bias", "region_bias", "region_colour", "object_bias", "object_colour", "chart_bias",
    "chart_colour", "whole_bias", "whole_colour", "edge_bias", "edge_colour",
    "exponent_error",
)  # fmt: skip


@dataclass(frozen=True)
class Limit:
    """One comparison of a metric with a number.

    Attributes
    ----------
    channel, metric : str
        Names of the channel and of the metric.
    operator : str
        ">", ">=", "<" or "<=".
    number : float
        The number with which the metric is compared.
    """

    channel: str
    metric: str
    operator: str
    number: float

    def __str__(self) -> str:
        """Return the limit as `--fail-if` takes it."""
        return f"{self.channel}.{self.metric} {self.operator} {self.number:g}"

    @property
    def readable(self) -> str:
        """Return the operator and the number as text in the format of the metric, such as "> 1.5%"."""
        return limit_text(self.metric, self.operator, self.number)


@dataclass(frozen=True)
class Verdict:
    """The result of evaluating a limit.

    Attributes
    ----------
    limit : Limit
    value : float or None
        Value of the metric; None if it could not be computed, for example without texels.
    failed : bool
    """

    limit: Limit
    value: float | None
    failed: bool

    @property
    def readable(self) -> str:
        """Return the value as text in the metric's format, such as "2.3%"; "missing" without a value."""
        return "missing" if self.value is None else figure_text(self.limit.metric, self.value)

    def sentence(self) -> str:
        """Return the limit, the value, and what the metric means."""
        known = FIGURES.get(self.limit.metric)
        phrase = f" ({known.phrase})" if known else ""
        value = "could not be computed" if self.value is None else f"is {self.readable}"
        return f"{self.limit}: {self.limit.metric} {value}{phrase}"


def parse_limits(text: str, channels: Iterable[str], metrics: Iterable[str]) -> list[Limit]:
    """Parse an expression of limits.

    Parameters
    ----------
    text : str
        Comparisons `channel.metric OP number`, separated by commas.
    channels : iterable of str
        Valid names of channels.
    metrics : iterable of str
        Valid names of metrics.

    Returns
    -------
    list of Limit
        In the order of the expression.

    Raises
    ------
    SettingsError
        If the expression is malformed or contains an unknown name.
    """
    if not text.strip():
        raise SettingsError(
            "it is empty; give limits such as 'irradiance.p95 > 0.05', or leave it out",
            object="fail_if",
        )
    limits = []
    channels, metrics = list(channels), list(metrics)
    for part in text.split(","):
        match = _LIMIT.fullmatch(part)
        if match is None:
            raise SettingsError(
                f"'{part.strip()}' is not of the form channel.figure > number", object="fail_if"
            )
        channel, metric, sign, number = match.groups()
        for what, name, known in (("channel", channel, channels), ("figure", metric, metrics)):
            if name not in known:
                raise unknown_name(what, name, known, object="fail_if")
        try:
            value = float(number)
        except ValueError:
            raise SettingsError(f"'{number}' is not a number", object="fail_if") from None
        if value != value:
            raise SettingsError("a limit of nan is never reached", object="fail_if")
        limits.append(Limit(channel, metric, sign, value))
    return limits


def evaluate_limits(
    limits: Iterable[Limit], channels: Mapping[str, Mapping[str, Any]], *, missing_fails: bool = True
) -> list[Verdict]:
    """Compare metrics with limits.

    Parameters
    ----------
    limits : iterable of Limit
        The limits.
    channels : mapping of str to mapping of str to number or None
        Metrics by channel and name.
    missing_fails : bool
        Whether a limit on a metric that is None fails.

    Returns
    -------
    list of Verdict
        One for each limit, in order.
    """
    verdicts = []
    for limit in limits:
        value = channels[limit.channel].get(limit.metric)
        if value is None:
            verdicts.append(Verdict(limit, None, missing_fails))
            continue
        size = abs(value) if limit.metric in _SIGNED and limit.number >= 0 else value
        verdicts.append(Verdict(limit, value, _OPERATORS[limit.operator](size, limit.number)))
    return verdicts
