"""Compares the stored maps of a finished bake with path-traced values at chosen points.

The reference (`baker.pathtracer`) is computed only from the scene and its lights. The maps are read from the
files of the bake, so errors of half floats, the denoiser and filled texels are included. The modules of
`criteria` compute metrics and define default limits. Most metrics exclude the noise of the reference.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from baker.core.errors import InputError
from baker.core.geometry import Geometry, world_geometry
from baker.core.lightmap import TexelStatus
from baker.core.progress import Progress, report, silent
from baker.core.result import Metrics, Result
from baker.core.scene import SceneWarning
from baker.core.stage import Stage
from baker.io.bake.read_bake import StoredBake, read_bake
from baker.kernels.not_kept import cache_warnings
from baker.metrics.error_metrics import z_scores
from baker.metrics.groups import ComparedPoints
from baker.metrics.limits import Verdict, evaluate_limits, parse_limits
from baker.metrics.texel_area import look_up
from baker.metrics.worst_texels import worst_texels
from baker.pathtracer.point_estimate import PointEstimate
from baker.pathtracer.scene import Reference, build_reference
from baker.verification.criteria.criterion import ChannelData, CriterionResult
from baker.verification.criteria.registry import CRITERIA, METRIC_NAMES, default_limits
from baker.verification.criteria.unverified_area import NOISY
from baker.verification.crops import Crop, trace_crops
from baker.verification.points import TEXEL, Pages, Points, choose_points, read_pages
from baker.verification.settings import VerifySettings
from baker.verification.tracing import (
    AO_ERROR,
    Effort,
    first_rays,
    relative_standard_error,
    standard_error,
    trace_ambient_occlusion,
    trace_irradiance,
)
from baker.verification.unverified_area import UnverifiedArea, measure_unverified_area
from baker.verification.verdict import verdict_sentence

CHANNELS = ("irradiance", "ao")
# Time for path-tracing crops, as a share of the time limit. It is added to the time limit.
_CROP_TIME = 0.1


@dataclass(frozen=True, eq=False)
class ChannelCheck(Metrics):
    """Stored and path-traced values of a channel at n random texels, with metrics.

    Attributes
    ----------
    value, reference, standard_error : (n, C) float64
        Stored value, path-traced value, and standard error of the path-traced value.
    halves : two (n, C) float64
        Estimates of the reference from two independent halves of the samples.
    metrics : dict of str to number or None
        Metrics of all criteria, see `baker.verification.criteria.registry`.
    remarks : dict of str to str
        Sentences by metric, each about the fault that the metric indicates.
    unresolved : int
        Number of texels whose reference did not reach the target standard error (for AO, twice `AO_ERROR`).
    """

    value: NDArray[np.float64]
    reference: NDArray[np.float64]
    standard_error: NDArray[np.float64]
    halves: tuple[NDArray[np.float64], NDArray[np.float64]]
    metrics: dict[str, Any]
    remarks: dict[str, str]
    unresolved: int

    @property
    def shift(self) -> tuple[int, int]:
        """Return the shift (rows, columns) at which the map fits the reference best; (0, 0) if unshifted."""
        down, right = self.metrics["shift"]
        return down, right

    @property
    def exponent(self) -> float | None:
        """Return the exponent p of the fit value = c * reference^p, see `baker.metrics.misalignment`."""
        power: float | None = self.metrics["exponent"]
        return power


@dataclass(frozen=True, eq=False, repr=False)
class VerifyReport(Result):
    """The result of `verify`.

    Attributes
    ----------
    bake : StoredBake
        The verified bake.
    settings : VerifySettings
        The settings of the verification.
    pixel : (n,) int64
        Compared random texels, (page * H + row) * W + column.
    owner : (n,) int32
        Object of each texel.
    position : (n, 3) float64, metres, world
        Position of each texel.
    channels : dict of str to ChannelCheck
        Comparisons by channel.
    objects, levels, regions, worst : list of dict
        Tables of objects, light levels, regions and texels with the largest errors.
    verdicts : list of Verdict
        One for each limit.
    problems : list of str
        Remarks on the limits that failed.
    invalid : int
        Number of invalid texels, which the bake filled from neighbours. They are not compared.
    rays : int
        Number of rays of the path tracer.
    seconds : float
        Duration of the verification, without compilation of kernels.
    compile_seconds : float
        Duration of `first_rays`, in which the first run on a machine compiles kernels.
    crops : list of Crop
        Path-traced windows around the texels with the largest errors.
    warnings : list of SceneWarning
    """

    bake: StoredBake
    settings: VerifySettings
    pixel: NDArray[np.int64]
    owner: NDArray[np.int32]
    position: NDArray[np.float64]
    channels: dict[str, ChannelCheck]
    objects: list[dict[str, Any]]
    levels: list[dict[str, Any]]
    regions: list[dict[str, Any]]
    worst: list[dict[str, Any]]
    verdicts: list[Verdict]
    problems: list[str]
    invalid: int
    rays: int
    seconds: float
    compile_seconds: float
    crops: list[Crop]
    warnings: list[SceneWarning] = field(default_factory=list)

    @property
    def passed(self) -> bool:
        """Return whether no limit failed."""
        return not any(verdict.failed for verdict in self.verdicts)

    @property
    def verdict(self) -> str:
        """Return one sentence: whether the bake passed, by which limits, and how large its error is."""
        metrics = {name: check.metrics for name, check in self.channels.items()}
        return verdict_sentence(self.verdicts, metrics, default=self.settings.fail_if is None)

    def flip(self, channel: str) -> float | None:
        """Return the mean FLIP error of a channel's crops, None if there are no crops."""
        values = [crop.flip for crop in self.crops if crop.channel == channel]
        return float(np.mean(values)) if values else None

    def summary(self) -> dict[str, Any]:
        """Return the names and values that `repr` and notebooks show."""
        rows: dict[str, Any] = {"passed": self.passed}
        for name, channel in self.channels.items():
            for figure in ("bias", "median", "p95"):
                rows[f"{name} {figure}"] = channel.metrics[figure]
        return rows | {"texels": len(self.pixel), "failed": ", ".join(self.problems) or "nothing"}

    def picture(self) -> NDArray[np.float32] | None:
        """Return the first page of the bake's first channel."""
        return next((pages[0] for pages in self.bake.maps.values()), None)

    def to_dict(self) -> dict[str, Any]:
        """Return the report as JSON-serialisable values; `baker verify --json` prints them."""
        return {
            "passed": self.passed,
            "verdict": self.verdict,
            "limits_from": "default" if self.settings.fail_if is None else "fail_if",
            "channels": {
                name: {
                    **check.metrics,
                    "unresolved": check.unresolved,
                    "flip": self.flip(name),
                    "z_histogram": _histogram(check),
                }
                for name, check in self.channels.items()
            },
            "objects": self.objects,
            "levels": self.levels,
            "regions": self.regions,
            "worst": self.worst,
            "limits": [{"limit": str(v.limit), "value": v.value, "failed": v.failed} for v in self.verdicts],
            "problems": self.problems,
            "invalid": self.invalid,
            "rays": self.rays,
            "seconds": self.seconds,
            "compile_seconds": self.compile_seconds,
            "warnings": [{"code": w.code, "message": w.message, "object": w.object} for w in self.warnings],
        }


def _histogram(check: ChannelCheck) -> dict[str, list[float]]:
    """Return the histogram of z-scores from -6 to 6; scores outside are counted in the outer bins."""
    z = np.clip(z_scores(check.value, check.reference, check.standard_error), -5.99, 5.99)
    count, edge = np.histogram(z, bins=24, range=(-6.0, 6.0))
    return {"edges": edge.tolist(), "counts": count.tolist()}


@dataclass(frozen=True)
class _Traced:
    """The points, their path-traced values by channel, the unverified area, and the compilation time."""

    points: Points
    estimates: dict[str, PointEstimate]
    unverified: UnverifiedArea
    compile_seconds: float


def verify(
    out: Path | str, settings: VerifySettings | None = None, progress: Progress = silent
) -> VerifyReport:
    """Compare the bake in a folder with path-traced values.

    Parameters
    ----------
    out : Path or str
        Output folder of a bake.
    settings : VerifySettings, optional
        Number of points, effort of path tracing, and limits.
    progress : Progress
        Receives reports, and may cancel.

    Returns
    -------
    VerifyReport
        Metrics of all channels, and whether the limits hold.

    Raises
    ------
    InputError
        If the folder contains no bake, or the bake has no channel that can be verified.
    SettingsError
        If a limit of `settings` is malformed or names an unknown channel or metric.
    ResourceError
        If memory runs out or a library is missing.
    Cancelled
        If `progress` cancels.
    """
    settings = settings or VerifySettings()
    start = time.monotonic()
    report(progress, Stage.LOAD, 0.0)
    bake = read_bake(out)
    names = [name for name in CHANNELS if name in bake.maps]
    if not names:
        raise InputError("the bake holds no channel that can be verified (irradiance, ao)", file=str(out))
    expression = default_limits(names) if settings.fail_if is None else settings.fail_if
    limits = parse_limits(expression, names, METRIC_NAMES)
    found = _compare(bake, names, settings, progress)
    metrics = {name: check.metrics for name, check in found.channels.items()}
    verdicts = evaluate_limits(limits, metrics, missing_fails=settings.fail_if is not None)
    return VerifyReport(
        bake=bake,
        settings=settings,
        pixel=found.pixel,
        owner=found.owner,
        position=found.position,
        channels=found.channels,
        objects=_objects({name: found.rows[name]["objects"] for name in names}),
        levels=[row for name in names for row in found.rows[name]["levels"]],
        regions=sorted((row for name in names for row in found.rows[name]["regions"]), key=_badness),
        worst=found.worst,
        verdicts=verdicts,
        problems=_problems(verdicts, found.channels),
        invalid=int((bake.status == TexelStatus.INVALID).sum()),
        crops=found.crops,
        rays=sum(estimate.rays for estimate in found.traced.estimates.values()),
        seconds=time.monotonic() - start - found.traced.compile_seconds,
        compile_seconds=found.traced.compile_seconds,
        warnings=[*bake.warnings, *cache_warnings()],
    )


@dataclass(frozen=True)
class _Comparison:
    """The comparison of all channels; `rows` contains the tables by channel and name of the criterion."""

    traced: _Traced
    pixel: NDArray[np.int64]
    owner: NDArray[np.int32]
    position: NDArray[np.float64]
    channels: dict[str, ChannelCheck]
    rows: dict[str, dict[str, list[dict[str, Any]]]]
    worst: list[dict[str, Any]]
    crops: list[Crop]


def _compare(bake: StoredBake, names: list[str], settings: VerifySettings, progress: Progress) -> _Comparison:
    """Path-trace the points, and evaluate all criteria for each channel."""
    geometry = world_geometry(bake.scene, bake.atlas)
    pages = read_pages(bake, geometry, names)
    with build_reference(
        bake.scene, sky=bake.sky, lambertian=True, threads=settings.threads, find_solids=True
    ) as reference:
        traced = _trace(reference, bake, geometry, pages, names, settings, progress)
        points = traced.points
        texel = points.kind == TEXEL
        pixel, owner = points.pixel[texel], points.owner[texel]
        position = points.position[texel] + geometry.origin
        channels, rows = {}, {}
        for name in names:
            data = _channel_data(name, bake, geometry, pages, traced, settings)
            channels[name], rows[name] = _evaluate(data, settings.target_se, traced.estimates[name])
        worst = worst_texels(bake.scene.instances, bake.atlas.resolution, pixel, owner, position, channels)
        crop_seconds = None if settings.seconds is None else _CROP_TIME * settings.seconds
        bounces = bake.manifest.get("settings", {}).get("bounces")
        crops = trace_crops(bake, geometry, reference, worst, bounces, settings.seed, crop_seconds, progress)
    return _Comparison(traced, pixel, owner, position, channels, rows, worst, crops)


def _trace(
    reference: Reference,
    bake: StoredBake,
    geometry: Geometry,
    pages: Pages,
    names: list[str],
    settings: VerifySettings,
    progress: Progress,
) -> _Traced:
    """Choose points and path-trace them."""
    report(progress, Stage.START, 0.0, "kernels")
    compiled = first_rays(reference, geometry, names)
    report(progress, Stage.START, 0.5, "points")
    points, air = choose_points(reference, bake, geometry, pages, names, settings)
    unverified = measure_unverified_area(reference, bake, geometry, pages, air, settings.seed)
    deadline = None if settings.seconds is None else time.monotonic() + settings.seconds
    effort = Effort(settings.spp, settings.target_se, deadline, settings.seed, points.room)
    baked = bake.manifest.get("settings", {})
    estimates: dict[str, PointEstimate] = {}
    if "ao" in names:
        metres = baked.get("ao_distance_metres")
        distance = np.inf if metres is None else float(metres)
        estimates["ao"] = trace_ambient_occlusion(reference, points.surface, distance, effort, progress)
    if "irradiance" in names:
        estimates["irradiance"] = trace_irradiance(
            reference, points.surface, baked.get("bounces"), effort, progress
        )
    return _Traced(points, estimates, unverified, compiled)


def _channel_data(
    name: str, bake: StoredBake, geometry: Geometry, pages: Pages, traced: _Traced, settings: VerifySettings
) -> ChannelData:
    """Return the stored and path-traced values of a channel at all points."""
    estimate, points = traced.estimates[name], traced.points
    # Look up at the position of the surface points: the stored value applies to the texel's centre, which may
    # lie outside the surface.
    value = look_up(bake.maps[name], points.pixel, points.surface.offset)[:, : estimate.mean.shape[1]]
    error = standard_error(estimate, points.room)
    samples = estimate.count.sum(axis=0) * estimate.samples
    halves = (estimate.half(0), estimate.half(1))
    if name == "ao":
        noisy = error.max(axis=1) > NOISY
    else:
        noisy = relative_standard_error(estimate, points.room) > max(settings.target_se, NOISY)
    compared = ComparedPoints(value, estimate.mean, error, halves, samples, estimate.standard_error)
    return ChannelData(name, bake, geometry, pages, points, compared, traced.unverified, noisy)


def _evaluate(
    data: ChannelData, target: float, estimate: PointEstimate
) -> tuple[ChannelCheck, dict[str, list[dict[str, Any]]]]:
    """Evaluate all criteria; return the metrics of the channel, and the tables by name of the criterion."""
    found: dict[str, CriterionResult] = {criterion.name: criterion.evaluate(data) for criterion in CRITERIA}
    mine = data.texels
    compared = data.compared.of(mine)
    if data.channel == "ao":
        unresolved = (compared.standard_error > 2 * AO_ERROR).any(axis=1)
    else:
        unresolved = relative_standard_error(estimate, data.points.room)[mine] > target
    check = ChannelCheck(
        value=compared.value,
        reference=compared.reference,
        standard_error=compared.standard_error,
        halves=compared.halves,
        metrics={name: value for result in found.values() for name, value in result.metrics.items()},
        remarks={name: text for result in found.values() for name, text in result.remarks.items()},
        unresolved=int(unresolved.sum()),
    )
    return check, {name: result.rows for name, result in found.items()}


def _badness(row: dict[str, Any]) -> float:
    return -float(row["deviation"])


def _objects(rows: dict[str, list[dict[str, Any]]]) -> list[dict[str, Any]]:
    """Return one row for each object, with the metrics of all channels.

    rows : {channel: rows of the criterion "objects"}
    """
    found: dict[int, dict[str, Any]] = {}
    for name, table in rows.items():
        for row in table:
            metrics = dict(row)
            entry = {"object": metrics.pop("object"), "node": metrics.pop("node"), "channels": {}}
            found.setdefault(entry["node"], entry)["channels"][name] = metrics
    return list(found.values())


def _problems(verdicts: list[Verdict], channels: dict[str, ChannelCheck]) -> list[str]:
    """Return the remarks on the metrics of the limits that failed, without duplicates."""
    found = []
    for verdict in verdicts:
        remark = channels[verdict.limit.channel].remarks.get(verdict.limit.metric)
        if verdict.failed and remark and remark not in found:
            found.append(remark)
    return found
