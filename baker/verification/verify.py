"""Path-traces chosen points of a finished bake and says how far the stored maps are from that.

The reference knows scene and lights only (`baker.pathtracer`); the maps are taken as the files hold them,
after half float, denoiser and repairs. Every figure stands beside what the reference's own noise adds to it.
What is concluded from the figures is in `judgements`.
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
from baker.core.scene import SceneWarning
from baker.core.stage import Stage
from baker.io.bake.read_bake import StoredBake, read_bake
from baker.kernels.not_kept import cache_warnings
from baker.metrics.groups import Compared
from baker.metrics.limits import Verdict, judge, parse_limits
from baker.metrics.texel_area import look_up
from baker.metrics.worst_texels import worst_texels
from baker.pathtracer.point_estimate import PointEstimate
from baker.pathtracer.scene import Reference, build_reference
from baker.verification.crops import Crop, trace_crops
from baker.verification.judgements.judgement import Evidence, Judged
from baker.verification.judgements.registry import FIGURE_NAMES, JUDGEMENTS, default_limits
from baker.verification.judgements.unjudged import NOISY
from baker.verification.points import TEXEL, Pages, Points, choose_points, read_pages
from baker.verification.settings import VerifySettings
from baker.verification.tracing import (
    OPENNESS_ERROR,
    Effort,
    first_rays,
    relative_standard_error,
    standard_error,
    trace_irradiance,
    trace_openness,
)
from baker.verification.unjudged import Unjudged, measure_unjudged

CHANNELS = ("irradiance", "ao")
# Pictures of the worst places get this share of the time limit on top.
_CROP_TIME = 0.1


@dataclass(frozen=True)
class ChannelCheck:
    """A channel's texels, stored and path-traced.

    Attributes
    ----------
    value, reference, standard_error : (n, C) float64
    halves : two (n, C) float64
    figures : dict
        Of all judgements, see `judgements.registry`.
    remarks : dict of figure to str
        What a figure means, for those that are limits.
    unresolved : int, texels whose standard error stayed above the target
    """

    value: NDArray[np.float64]
    reference: NDArray[np.float64]
    standard_error: NDArray[np.float64]
    halves: tuple[NDArray[np.float64], NDArray[np.float64]]
    figures: dict[str, Any]
    remarks: dict[str, str]
    unresolved: int

    @property
    def shift(self) -> tuple[int, int]:
        """Return the rows and columns by which the map would fit better."""
        down, right = self.figures["shift"]
        return down, right

    @property
    def exponent(self) -> float | None:
        """Return the power of the truth that the values follow."""
        power: float | None = self.figures["exponent"]
        return power


@dataclass(frozen=True)
class Verification:
    """What `verify` found.

    Attributes
    ----------
    bake : StoredBake
    pixel : (n,) int64, texels judged, (page * H + row) * W + column
    owner : (n,) int32, their objects
    position : (n, 3) float64, world
    channels : dict of name to ChannelCheck
    objects, levels, regions, worst : list of dict, as in the JSON
    verdicts : list of Verdict
    problems : list of str, what the limits that failed mean
    invalid : int, covered texels that the bake filled from neighbours (not judged)
    crops : list of Crop, the surroundings of the worst texels
    rays : int
    seconds, compile_seconds : float
        All but the compilation of kernels; that (a machine's first run).
    warnings : list of SceneWarning
    """

    bake: StoredBake
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
        """Tell whether no limit was passed."""
        return not any(verdict.failed for verdict in self.verdicts)


@dataclass(frozen=True)
class _Traced:
    """What the reference found: the points and their estimates, areas that were left out, pictures."""

    points: Points
    estimates: dict[str, PointEstimate]
    unjudged: Unjudged
    compile_seconds: float


def verify(
    out: Path | str, settings: VerifySettings | None = None, progress: Progress = silent
) -> Verification:
    """Judge the bake in a folder against path tracing.

    Parameters
    ----------
    out : Path or str
        Output folder of a bake.
    settings : VerifySettings, optional
    progress : Progress

    Raises
    ------
    InputError, SettingsError, ResourceError, Cancelled
    """
    settings = settings or VerifySettings()
    start = time.monotonic()
    report(progress, Stage.LOAD, 0.0)
    bake = read_bake(out)
    names = [name for name in CHANNELS if name in bake.maps]
    if not names:
        raise InputError("the bake holds no channel that can be verified (irradiance, ao)", file=str(out))
    limits = parse_limits(settings.fail_if or default_limits(names), names, FIGURE_NAMES)
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
            evidence = _evidence(name, bake, geometry, pages, traced, settings)
            channels[name], rows[name] = _judge(evidence, settings.target_se, traced.estimates[name])
        worst = worst_texels(bake.scene.instances, bake.atlas.resolution, pixel, owner, position, channels)
        spare = None if settings.seconds is None else _CROP_TIME * settings.seconds
        bounces = bake.manifest.get("settings", {}).get("bounces")
        crops = trace_crops(bake, geometry, reference, worst, bounces, settings.seed, spare, progress)
    figures = {name: check.figures for name, check in channels.items()}
    verdicts = judge(limits, figures, missing_fails=settings.fail_if is not None)
    return Verification(
        bake=bake,
        pixel=pixel,
        owner=owner,
        position=position,
        channels=channels,
        objects=_objects({name: rows[name]["objects"] for name in names}),
        levels=[row for name in names for row in rows[name]["levels"]],
        regions=sorted((row for name in names for row in rows[name]["regions"]), key=_badness),
        worst=worst,
        verdicts=verdicts,
        problems=_problems(verdicts, channels),
        invalid=int((bake.status == TexelStatus.INVALID).sum()),
        crops=crops,
        rays=sum(estimate.rays for estimate in traced.estimates.values()),
        seconds=time.monotonic() - start - traced.compile_seconds,
        compile_seconds=traced.compile_seconds,
        warnings=[*bake.warnings, *cache_warnings()],
    )


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
    unjudged = measure_unjudged(reference, bake, geometry, pages, air, settings.seed)
    deadline = None if settings.seconds is None else time.monotonic() + settings.seconds
    effort = Effort(settings.spp, settings.target_se, deadline, settings.seed, points.room)
    baked = bake.manifest.get("settings", {})
    estimates: dict[str, PointEstimate] = {}
    if "ao" in names:
        reach = baked.get("ao_distance_metres")
        distance = np.inf if reach is None else float(reach)
        estimates["ao"] = trace_openness(reference, points.places, distance, effort, progress)
    if "irradiance" in names:
        estimates["irradiance"] = trace_irradiance(
            reference, points.places, baked.get("bounces"), effort, progress
        )
    return _Traced(points, estimates, unjudged, compiled)


def _evidence(
    name: str, bake: StoredBake, geometry: Geometry, pages: Pages, traced: _Traced, settings: VerifySettings
) -> Evidence:
    """Put a channel's stored values beside its estimate."""
    estimate, points = traced.estimates[name], traced.points
    # A texel on a chart's border holds the value at its centre, beside its surface: engines look up between.
    value = look_up(bake.maps[name], points.pixel, points.places.middle)[:, : estimate.mean.shape[1]]
    error = standard_error(estimate, points.room)
    samples = estimate.count.sum(axis=0) * estimate.samples
    halves = (estimate.half(0), estimate.half(1))
    if name == "ao":
        noisy = error.max(axis=1) > NOISY
    else:
        noisy = relative_standard_error(estimate, points.room) > max(settings.target_se, NOISY)
    compared = Compared(value, estimate.mean, error, halves, samples, estimate.standard_error)
    return Evidence(name, bake, geometry, pages, points, compared, traced.unjudged, noisy)


def _judge(
    evidence: Evidence, target: float, estimate: PointEstimate
) -> tuple[ChannelCheck, dict[str, list[dict[str, Any]]]]:
    """Return a channel's figures of all judgements, and their tables by name."""
    found: dict[str, Judged] = {judgement.name: judgement.judge(evidence) for judgement in JUDGEMENTS}
    mine = evidence.texels
    places = evidence.compared.of(mine)
    if evidence.channel == "ao":
        unresolved = (places.standard_error > 2 * OPENNESS_ERROR).any(axis=1)
    else:
        unresolved = relative_standard_error(estimate, evidence.points.room)[mine] > target
    check = ChannelCheck(
        value=places.value,
        reference=places.reference,
        standard_error=places.standard_error,
        halves=places.halves,
        figures={name: value for judged in found.values() for name, value in judged.figures.items()},
        remarks={name: text for judged in found.values() for name, text in judged.remarks.items()},
        unresolved=int(unresolved.sum()),
    )
    return check, {name: judged.rows for name, judged in found.items()}


def _badness(row: dict[str, Any]) -> float:
    return -float(row["deviation"])


def _objects(rows: dict[str, list[dict[str, Any]]]) -> list[dict[str, Any]]:
    """Return one row for each object with the figures of all channels."""
    found: dict[int, dict[str, Any]] = {}
    for name, table in rows.items():
        for row in table:
            figures = dict(row)
            entry = {"object": figures.pop("object"), "node": figures.pop("node"), "channels": {}}
            found.setdefault(entry["node"], entry)["channels"][name] = figures
    return list(found.values())


def _problems(verdicts: list[Verdict], channels: dict[str, ChannelCheck]) -> list[str]:
    """Return what the limits that failed mean, where a figure alone does not say it; each once."""
    found = []
    for verdict in verdicts:
        remark = channels[verdict.limit.channel].remarks.get(verdict.limit.figure)
        if verdict.failed and remark and remark not in found:
            found.append(remark)
    return found
