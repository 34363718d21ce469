"""A verification as plain values, as `--json` prints it."""

from __future__ import annotations

from typing import Any

import numpy as np

from baker.metrics.error_metrics import z_scores
from baker.verification.verify import ChannelCheck, Verification


def verification_json(found: Verification) -> dict[str, Any]:
    """Return a verification as plain values, as `--json` prints it.

    Parameters
    ----------
    found : Verification
        Result of `verify`.

    Returns
    -------
    dict
        Keys as documented in docs/ACCURACY.md.
    """
    return {
        "passed": found.passed,
        "channels": {
            name: {
                **check.metrics,
                "unresolved": check.unresolved,
                "flip": mean_flip(found, name),
                "z_histogram": _histogram(check),
            }
            for name, check in found.channels.items()
        },
        "objects": found.objects,
        "levels": found.levels,
        "regions": found.regions,
        "worst": found.worst,
        "limits": [{"limit": str(v.limit), "value": v.value, "failed": v.failed} for v in found.verdicts],
        "problems": found.problems,
        "invalid": found.invalid,
        "rays": found.rays,
        "seconds": found.seconds,
        "compile_seconds": found.compile_seconds,
        "warnings": [{"code": w.code, "message": w.message, "object": w.object} for w in found.warnings],
    }


def mean_flip(found: Verification, channel: str) -> float | None:
    """Return the mean FLIP of a channel's crops, None without any."""
    values = [crop.flip for crop in found.crops if crop.channel == channel]
    return float(np.mean(values)) if values else None


def _histogram(check: ChannelCheck) -> dict[str, list[float]]:
    """Return counts of z-scores between -6 and 6; the outer bins include all beyond."""
    z = np.clip(z_scores(check.value, check.reference, check.standard_error), -5.99, 5.99)
    count, edge = np.histogram(z, bins=24, range=(-6.0, 6.0))
    return {"edges": edge.tolist(), "counts": count.tolist()}
