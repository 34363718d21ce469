"""A difference as plain values: what `--json` prints."""

from __future__ import annotations

from typing import Any

from baker.comparison.compare import Difference


def difference_json(found: Difference) -> dict[str, Any]:
    """Return a comparison as plain values, the object of `--json`.

    Parameters
    ----------
    found : Difference
        What `compare` returned.

    Returns
    -------
    dict
        Numbers, texts, lists and dicts only.
    """
    return {
        "passed": found.passed,
        "channels": {name: check.metrics for name, check in found.channels.items()},
        "objects": found.objects,
        "worst": found.worst,
        "differences": found.differences,
        "only_in_a": found.only_in_a,
        "only_in_b": found.only_in_b,
        "unmatched": found.unmatched,
        "limits": [{"limit": str(v.limit), "value": v.value, "failed": v.failed} for v in found.verdicts],
        "seconds": found.seconds,
        "warnings": [{"code": w.code, "message": w.message, "object": w.object} for w in found.warnings],
    }
