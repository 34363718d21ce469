"""Path-traces small windows of the map around its worst texels, and computes their FLIP error."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from baker.core.geometry import Geometry
from baker.core.lightmap import TexelStatus
from baker.core.progress import Progress, report
from baker.core.stage import Stage
from baker.io.bake.read_bake import StoredBake
from baker.metrics.flip import flip_error
from baker.metrics.texel_area import surface_points
from baker.pathtracer.estimators import PassOptions
from baker.pathtracer.irradiance import ambient_occlusion_pass, irradiance_pass
from baker.pathtracer.point_estimate import new_estimate
from baker.pathtracer.scene import Reference

# Width and height of a crop, texels.
SIZE = 24
# Largest number of crops.
_MAX_CROPS = 3
# Largest number of passes of the path tracer, and number of points in each texel.
_PASSES, _POINTS = 16, 16


@dataclass(frozen=True)
class Crop:
    """A window of a page.

    Attributes
    ----------
    channel : str
        Name of the channel.
    page, row, column : int
        Page, and first row and column of the window.
    stored, reference : (h, w, C) float32
        Values of the bake and of the path tracer; 0 at texels without a measured value.
    error : (h, w) float32
        FLIP error of each texel.
    flip : float
        Mean of `error`.
    """

    channel: str
    page: int
    row: int
    column: int
    stored: NDArray[np.float32]
    reference: NDArray[np.float32]
    error: NDArray[np.float32]
    flip: float


def trace_crops(
    bake: StoredBake,
    geometry: Geometry,
    reference: Reference,
    worst: list[dict[str, Any]],
    bounces: int | None,
    seed: int,
    seconds: float | None,
    progress: Progress,
) -> list[Crop]:
    """Path-trace windows around the texels with the largest errors.

    Parameters
    ----------
    bake : StoredBake
        The verified bake.
    geometry : Geometry
        Triangles of the bake.
    reference : Reference
        The scene of the path tracer.
    worst : list of dict
        Texels in order of decreasing error. Windows that overlap an earlier window of the same channel and
        page are left out.
    bounces : int or None
        Largest number of reflections; None for no limit.
    seed : int
        Seed of the random numbers.
    seconds : float or None
        Time for all crops, after which no further pass starts. Each crop gets at least one pass.
    progress : Progress
        Receives reports, and may cancel.

    Returns
    -------
    list of Crop
        At most `_MAX_CROPS` crops.
    """
    crops: list[Crop] = []
    end = np.inf if seconds is None else time.monotonic() + seconds
    for entry in worst:
        if len(crops) == _MAX_CROPS:
            break
        corner = _corner(entry["row"], bake.atlas.resolution), _corner(entry["column"], bake.atlas.resolution)
        if any(_overlap(crop, entry, corner) for crop in crops):
            continue
        report(progress, Stage.CROPS, len(crops) / _MAX_CROPS)
        crops.append(_trace(bake, geometry, reference, entry, corner, bounces, seed, end))
    return crops


def _corner(at: int, size: int) -> int:
    return max(min(at - SIZE // 2, size - SIZE), 0)


def _overlap(crop: Crop, entry: dict[str, Any], corner: tuple[int, int]) -> bool:
    same = crop.channel == entry["channel"] and crop.page == entry["page"]
    return same and abs(crop.row - corner[0]) < SIZE and abs(crop.column - corner[1]) < SIZE


def _trace(
    bake: StoredBake,
    geometry: Geometry,
    reference: Reference,
    entry: dict[str, Any],
    corner: tuple[int, int],
    bounces: int | None,
    seed: int,
    end: float,
) -> Crop:
    page, size = entry["page"], bake.atlas.resolution
    window = (slice(corner[0], corner[0] + SIZE), slice(corner[1], corner[1] + SIZE))
    on = np.isin(bake.status[page][window], (TexelStatus.COVERED, TexelStatus.UNCONVERGED))
    row, column = np.nonzero(on)
    pixel = (page * size + corner[0] + row) * size + corner[1] + column
    points = surface_points(geometry, pixel.astype(np.int64), size, _POINTS, seed)
    where = (points.position, points.normal, points.face_normal)
    stored = bake.maps[entry["channel"]][page][window] * on[..., None]
    truth = np.zeros_like(stored)
    occlusion = entry["channel"] == "ao"
    estimate = new_estimate(len(pixel), 1 if occlusion else 3)
    metres = bake.manifest.get("settings", {}).get("ao_distance_metres")
    distance = np.inf if metres is None else float(metres)
    options = PassOptions(max_bounces=bounces, seed=seed)
    for _ in range(_PASSES):
        if occlusion:
            ambient_occlusion_pass(reference, estimate, *where, distance=distance, seed=seed)
        else:
            irradiance_pass(reference, estimate, *where, options=options)
        if time.monotonic() > end:
            break
    truth[row, column] = estimate.mean
    error, mean = flip_error(truth, stored)
    return Crop(entry["channel"], page, corner[0], corner[1], stored, truth, error, mean)
