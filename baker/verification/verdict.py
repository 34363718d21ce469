"""Writes one sentence that says whether a verified bake passed its limits, and how large its error is."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from baker.core.readable import percent
from baker.metrics.limits import Verdict

# Largest number of failed limits that the sentence names.
_NAMED = 3


def verdict_sentence(
    verdicts: Sequence[Verdict], metrics: Mapping[str, Mapping[str, Any]], *, default: bool
) -> str:
    """Return one sentence: whether the bake passed, which limits were used, and how large the error is.

    Parameters
    ----------
    verdicts : sequence of Verdict
        The evaluated limits.
    metrics : mapping of str to mapping of str to number or None
        Metrics by channel and name.
    default : bool
        Whether the limits are the default limits. If false, they are the limits of the setting `fail_if`.

    Returns
    -------
    str
        "The bake is good: ..." or "The bake is not good: ...".
    """
    count = len(verdicts)
    limits = f"{count} {'default limit' if default else 'limit'}{'' if count == 1 else 's'}"
    limits += "" if default else " of `fail_if`"
    failed = [verdict for verdict in verdicts if verdict.failed]
    if failed:
        names = [f"{v.limit.channel}.{v.limit.metric} is {v.readable}" for v in failed[:_NAMED]]
        names += [f"{len(failed) - _NAMED} more"] if len(failed) > _NAMED else []
        return f"The bake is not good: {len(failed)} of {limits} failed ({', '.join(names)})."
    parts = [_error(name, metrics[name]) for name in metrics if metrics[name].get("bias") is not None]
    missing = sum(verdict.value is None for verdict in verdicts)
    hold = f"{'all ' if count > 1 else 'the '}{limits} {'hold' if count != 1 else 'holds'}"
    hold += f", {missing} of them without a value to test" if missing else ""
    return f"The bake is good: {'; '.join([*parts, hold])}."


def _error(channel: str, metrics: Mapping[str, Any]) -> str:
    """Return the mean and the typical error of a channel, without the noise of the reference."""
    bias, median = float(metrics["bias"]), metrics.get("median_excess")
    side = "too high" if bias > 0 else "too low"
    text = f"{channel} is {percent(abs(bias))} {side} on average"
    return text if median is None else f"{text} and off by {percent(median)} at a typical texel"
