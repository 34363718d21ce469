"""Finds the compared texels with the largest significant errors."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from baker.core.scene import Instance
from baker.metrics.error_metrics import dark_floor, relative_error

# Largest number of texels that are returned.
_COUNT = 10


def worst_texels(
    instances: Sequence[Instance],
    size: int,
    pixel: NDArray[np.int64],
    owner: NDArray[np.int32],
    position: NDArray[np.float64],
    channels: Mapping[str, Any],
    error_of: Callable[
        [NDArray[np.float64], NDArray[np.float64], float], NDArray[np.float64]
    ] = relative_error,
) -> list[dict[str, Any]]:
    """Return the largest significant errors of texels, at most ten over all channels.

    The significant error is the relative error minus three relative standard errors of the reference.

    Parameters
    ----------
    instances : sequence of Instance
        Instances of the scene.
    size : int, texels
        Width and height of a page.
    pixel : (n,) int64
        (page * size + row) * size + column of the compared texels.
    owner : (n,) int32
        Instance of each texel.
    position : (n, 3) float64, metres, world
        Position of each texel.
    channels : mapping of str to object
        For each channel, by name, an object with the attributes `value`, `reference` and `standard_error`,
        (n, C) float64.
    error_of : callable
        error_of(value, reference, floor) returns the error of each texel, (n,) float64.

    Returns
    -------
    list of dict
        One entry for each texel and channel, as `baker verify --json` prints it. The largest significant
        error is first.
    """
    found = []
    for name, check in channels.items():
        floor = dark_floor(check.reference)
        error = error_of(check.value, check.reference, floor)
        noise = np.where(np.isfinite(check.standard_error), check.standard_error, 0.0).mean(axis=1)
        sure = error - 3.0 * noise / np.maximum(check.reference.mean(axis=1), max(floor, 1e-12))
        for i in np.argsort(-sure, kind="stable")[:_COUNT]:
            page, rest = divmod(int(pixel[i]), size * size)
            instance = instances[int(owner[i])]
            found.append(
                {
                    "object": instance.name,
                    "node": instance.node,
                    "channel": name,
                    "page": page,
                    "row": rest // size,
                    "column": rest % size,
                    "position": position[i].tolist(),
                    "value": check.value[i].tolist(),
                    "reference": check.reference[i].tolist(),
                    "standard_error": noise[i],
                    "error": error[i],
                    "sure": float(sure[i]),
                }
            )
    found.sort(key=lambda entry: -entry["sure"])
    for entry in found:
        entry["standard_error"], entry["error"] = float(entry["standard_error"]), float(entry["error"])
        del entry["sure"]
    return found[:_COUNT]
