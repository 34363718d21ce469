"""From values of texels to a finished page: buried texels, noise, borders, surroundings."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baker.core.progress import Progress
from baker.finish.border import recentre
from baker.finish.denoise import denoise_page
from baker.finish.dilate import dilate
from baker.finish.invalid import fill_invalid

STAGE = "finish"


@dataclass(frozen=True)
class PagePlan:
    """What lies where on one page, the same for all channels.

    Attributes
    ----------
    chart : (H, W) int32, -1 = empty
    valid : (H, W) bool, covered and not buried
    centroid : (H, W, 2) float32, covered part's centroid from the texel's centre, texels
    """

    chart: NDArray[np.int32]
    valid: NDArray[np.bool_]
    centroid: NDArray[np.float32]

    @property
    def covered(self) -> NDArray[np.bool_]:
        """Return where charts are, (H, W) bool."""
        covered: NDArray[np.bool_] = self.chart >= 0
        return covered


def finish_page(
    plan: PagePlan,
    layers: list[tuple[NDArray[np.float32], NDArray[np.float32]]],
    *,
    upper: float,
    denoise: bool,
    dilation: int,
    threads: int,
    progress: Progress,
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Repair, denoise and add up the layers of one page, then grow its charts.

    Parameters
    ----------
    layers : list of value (H, W, C) float32 and standard error (H, W) float32
    upper : float
        Largest possible value of the sum.
    dilation : int
        Texels by which charts grow into the gaps.

    Returns
    -------
    value : (H, W, C) float32, finite, 0 to `upper`
    grown : (H, W) bool, texels filled by the growth
    """
    total = np.zeros_like(layers[0][0])
    for value, error in layers:
        if not value.any():
            continue
        repaired, _ = fill_invalid(value, plan.chart, plan.valid)
        if denoise:
            repaired = denoise_page(
                repaired, plan.covered, plan.chart, standard_error=error, threads=threads, progress=progress
            )
        total += recentre(repaired, plan.chart, plan.centroid, valid=plan.valid, threads=threads)
    np.clip(total, 0.0, upper, out=total)
    grown_value, grown = dilate(total, plan.covered, plan.chart, dilation, threads=threads)
    np.clip(grown_value, 0.0, upper, out=grown_value)
    return grown_value, grown
