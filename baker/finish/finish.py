"""From values of texels to a finished page: buried texels, noise, borders, surroundings."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from baker.core.progress import Progress
from baker.finish.border import recentre
from baker.finish.denoise import denoise_page
from baker.finish.dilate import dilate
from baker.finish.invalid import fill_invalid

STAGE = "finish"
# A layer whose noise is below this share of the light (RMS over texels) is left as it was sampled: filtering
# it costs a second pass and gained nothing (Cornell, 64 samples: 0.33 % median error with, 0.35 % without).
NOT_WORTH_FILTERING = 0.02


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


class PageLayer(NamedTuple):
    """A part of a page that is denoised by itself.

    value (H, W, C) float32; error (H, W) float32, standard error; bound: whether that is an upper bound.
    """

    value: NDArray[np.float32]
    error: NDArray[np.float32]
    bound: bool = False


def finish_page(
    plan: PagePlan,
    layers: list[PageLayer],
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
    layers : list of PageLayer
    upper : float
        Largest possible value of the sum.
    dilation : int
        Texels by which charts grow into the gaps.

    Returns
    -------
    value : (H, W, C) float32, finite, 0 to `upper`
    grown : (H, W) bool, texels filled by the growth
    """
    total = np.zeros_like(layers[0].value)
    light = _light(plan, layers)
    for value, error, bound in layers:
        if not value[plan.valid].any():
            continue
        repaired, _ = fill_invalid(value, plan.chart, plan.valid)
        noise = float(np.sqrt(np.square(error[plan.valid] / light, dtype=np.float64).mean()))
        if denoise and noise > NOT_WORTH_FILTERING:
            repaired = denoise_page(
                repaired,
                plan.covered,
                plan.chart,
                standard_error=error,
                bound=bound,
                threads=threads,
                progress=progress,
            )
        centred = recentre(repaired, plan.chart, plan.centroid, valid=plan.valid, threads=threads)
        total += np.minimum(centred, _brightest(repaired, plan.valid), out=centred)
    np.clip(total, 0.0, upper, out=total)
    grown_value, grown = dilate(total, plan.covered, plan.chart, dilation, threads=threads)
    np.clip(grown_value, 0.0, np.minimum(_brightest(total, plan.covered), upper), out=grown_value)
    return grown_value, grown


def _brightest(value: NDArray[np.float32], where: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Return the largest value of each channel (C,): what is moved or continued must not be brighter."""
    brightest: NDArray[np.float32] = value[where].max(axis=0, initial=0.0)
    return brightest


def _light(plan: PagePlan, layers: list[PageLayer]) -> NDArray[np.float32]:
    """Return the sum of layers (n_valid,) at valid texels, dark ones raised to a tenth of the mean."""
    total = np.zeros(int(plan.valid.sum()), np.float32)
    for layer in layers:
        total += layer.value[plan.valid].mean(axis=1)
    return np.maximum(total, max(0.1 * float(total.mean(dtype=np.float64)), 1e-30) if total.size else 0.0)
