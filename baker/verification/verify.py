"""Path-traces chosen texels of a finished bake and says how far the stored maps are from that.

The reference knows scene and lights only (`baker.reference`); the maps are taken as the files hold them,
after half float, denoiser and repairs. Every figure stands beside what the reference's own noise adds to it.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from baker.core.errors import InputError, SettingsError
from baker.core.geometry import Geometry, world_geometry
from baker.core.lightmap import TexelStatus
from baker.core.progress import Progress, report, silent
from baker.core.scene import SceneWarning
from baker.io.bake_folder import StoredBake, read_bake
from baker.judge.choice import choose_texels
from baker.judge.figures import FIGURES, dark_floor, figures
from baker.judge.limits import Verdict, judge, parse_limits
from baker.judge.registration import best_shift, exponent
from baker.judge.texel_area import TexelPlaces, instance_map, look_up, texel_places
from baker.judge.worst import worst_texels
from baker.reference.irradiance import PointEstimate
from baker.reference.view import build_reference
from baker.verification.crops import Crop, trace_crops
from baker.verification.free import free_places
from baker.verification.tracing import (
    OPENNESS_ERROR,
    Effort,
    first_rays,
    relative_standard_error,
    standard_error,
    trace_irradiance,
    trace_openness,
)
from baker.warm import cache_warnings

CHANNELS = ("irradiance", "ao")
PLACES = 64
DEFAULT_LIMITS = (
    "irradiance.median > 0.03, irradiance.bias > 0.03, irradiance.nrmse > 0.5, "
    "ao.median > 0.03, ao.bias > 0.03, ao.rmse > 0.05"
)
# An object whose mean is off by more fails on its own, if it is not in the dark and so many standard errors
# of the mean say so. Of few texels a single one at the mouth of a gap would decide: with fewer than
# the second number of them twice as much is allowed, with fewer than the first anything.
_OBJECT_BIAS, _OBJECT_TEXELS, _OBJECT_SURE = 0.25, (4, 8), 3.0
_EXPONENT = 0.1
# Pictures of the worst places get this share of the time limit on top.
_CROP_TIME = 0.1


@dataclass(frozen=True)
class VerifySettings:
    """How much is path-traced.

    Attributes
    ----------
    texels : int
    spp : int or None
        Paths for each texel; None goes on until `target_se` or the time limit.
    target_se : float
        Relative standard error at which a texel is good enough.
    time_limit : float or None
        Seconds of path tracing.
    fail_if : str or None
        Limits; None takes `DEFAULT_LIMITS`, the objects' own limit, and the checks for shift and curve.
    seed, threads
    """

    texels: int = 2000
    spp: int | None = None
    target_se: float = 0.005
    time_limit: float | None = 40.0
    fail_if: str | None = None
    seed: int = 0
    threads: int | None = None

    def __post_init__(self) -> None:
        """Refuse what makes no sense."""
        if self.texels < 1:
            raise SettingsError("--texels must be at least 1", object="texels")
        if self.spp is not None and self.spp < 1:
            raise SettingsError("--spp must be at least 1", object="spp")
        if not self.target_se > 0:
            raise SettingsError("--target-se must be above 0", object="target_se")
        if self.time_limit is not None and not self.time_limit > 0:
            raise SettingsError("--time-limit must be above 0", object="time_limit")


@dataclass(frozen=True)
class ChannelCheck:
    """A channel's texels, stored and path-traced.

    Attributes
    ----------
    value, reference, standard_error : (n, C) float64
    halves : two (n, C) float64
    figures : dict, see `judge.figures`
    shift : (int, int), rows and columns by which the map would fit better
    exponent : float or None, power of the truth that the values follow
    unresolved : int, texels whose standard error stayed above the target
    """

    value: NDArray[np.float64]
    reference: NDArray[np.float64]
    standard_error: NDArray[np.float64]
    halves: tuple[NDArray[np.float64], NDArray[np.float64]]
    figures: dict[str, Any]
    shift: tuple[int, int]
    exponent: float | None
    unresolved: int


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
    objects, worst : list of dict, as in the JSON
    verdicts : list of Verdict
    problems : list of str, what failed beside limits
    invalid : int, covered texels that the bake filled from neighbours (not judged)
    crops : list of Crop, the surroundings of the worst texels
    rays : int; seconds : float
    warnings : list of SceneWarning
    """

    bake: StoredBake
    pixel: NDArray[np.int64]
    owner: NDArray[np.int32]
    position: NDArray[np.float64]
    channels: dict[str, ChannelCheck]
    objects: list[dict[str, Any]]
    worst: list[dict[str, Any]]
    verdicts: list[Verdict]
    problems: list[str]
    invalid: int
    rays: int
    seconds: float
    crops: list[Crop]
    warnings: list[SceneWarning] = field(default_factory=list)

    @property
    def passed(self) -> bool:
        """Tell whether no limit was passed."""
        return not self.problems and not any(verdict.failed for verdict in self.verdicts)


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
    report(progress, "load", 0.0)
    bake = read_bake(out)
    names = [name for name in CHANNELS if name in bake.maps]
    if not names:
        raise InputError("the bake holds no channel that can be verified (irradiance, ao)", file=str(out))
    limits = parse_limits(settings.fail_if or _defaults(names), names, FIGURES)
    geometry = world_geometry(bake.scene, bake.atlas)
    pixel, owner, places, stands_for = _choose(bake, geometry, names[0], settings)
    weight = stands_for * places.surface
    baked = bake.manifest.get("settings", {})
    bounces = baked.get("bounces")
    with build_reference(
        bake.scene, sky=bake.sky, lambertian=True, threads=settings.threads, buried=True
    ) as reference:
        places = free_places(reference, places, settings.seed)
        report(progress, "start", 0.0, "kernels")
        first_rays(reference, places, names)
        deadline = None if settings.time_limit is None else time.monotonic() + settings.time_limit
        effort = Effort(settings.spp, settings.target_se, deadline, settings.seed)
        estimates: dict[str, PointEstimate] = {}
        if "ao" in names:
            reach = baked.get("ao_distance_metres")
            distance = np.inf if reach is None else float(reach)
            estimates["ao"] = trace_openness(reference, places, distance, effort, progress)
        if "irradiance" in names:
            estimates["irradiance"] = trace_irradiance(reference, places, bounces, effort, progress)
        covered = np.isin(bake.status, (TexelStatus.COVERED, TexelStatus.UNCONVERGED))
        channels = {
            name: _channel(
                bake.maps[name], covered, pixel, places, weight, estimates[name], settings.target_se
            )
            for name in names
        }
        middle = places.position.mean(axis=1) + geometry.origin
        worst = worst_texels(bake.scene.instances, bake.atlas.resolution, pixel, owner, middle, channels)
        spare = None if settings.time_limit is None else _CROP_TIME * settings.time_limit
        crops = trace_crops(bake, geometry, reference, worst, bounces, settings.seed, spare, progress)
    objects = _objects(bake, owner, channels, weight)
    verdicts = judge(limits, {name: check.figures for name, check in channels.items()})
    return Verification(
        bake=bake,
        pixel=pixel,
        owner=owner,
        position=middle,
        channels=channels,
        objects=objects,
        worst=worst,
        verdicts=verdicts,
        problems=[] if settings.fail_if else _problems(channels, objects, owner),
        invalid=int((bake.status == TexelStatus.INVALID).sum()),
        crops=crops,
        rays=sum(estimate.rays for estimate in estimates.values()),
        seconds=time.monotonic() - start,
        warnings=[*bake.warnings, *cache_warnings()],
    )


def _defaults(names: list[str]) -> str:
    return ", ".join(part for part in DEFAULT_LIMITS.split(", ") if part.split(".")[0] in names)


def _choose(
    bake: StoredBake, geometry: Geometry, name: str, settings: VerifySettings
) -> tuple[NDArray[np.int64], NDArray[np.int32], TexelPlaces, NDArray[np.float64]]:
    """Pick texels and spread places over them; tell how many texels of its object each of them stands for."""
    resolution = bake.atlas.resolution
    owner = instance_map(geometry, bake.atlas.n_pages, resolution).reshape(-1)
    judged = np.isin(bake.status, (TexelStatus.COVERED, TexelStatus.UNCONVERGED)).reshape(-1)
    brightness = bake.maps[name].mean(axis=3, dtype=np.float64).reshape(-1)
    if len(brightness) != len(owner):
        raise InputError("the bake lacks pages of a channel; bake the scene again", file=str(bake.folder))
    pixel = choose_texels(owner, judged, brightness, settings.texels, settings.seed)
    if not len(pixel):
        raise InputError(
            "no texel of the bake lies on a surface; bake the scene again", file=str(bake.folder)
        )
    n = len(bake.scene.instances)
    chosen = owner[pixel]
    of_object = np.bincount(owner[judged & (owner >= 0)], minlength=n)
    stands_for = (of_object / np.maximum(np.bincount(chosen, minlength=n), 1))[chosen]
    return pixel, chosen, texel_places(geometry, pixel, resolution, PLACES, settings.seed), stands_for


def _channel(
    stored: NDArray[np.float32],
    covered: NDArray[np.bool_],
    pixel: NDArray[np.int64],
    places: TexelPlaces,
    weight: NDArray[np.float64],
    estimate: PointEstimate,
    target: float,
) -> ChannelCheck:
    """Compare a stored channel (P, H, W, C) with its estimate."""
    # A texel on a chart's border holds the value at its centre, beside its surface: engines look up between.
    value = look_up(stored, pixel, places.middle)
    truth, error = estimate.mean, standard_error(estimate)
    value = value[:, : truth.shape[1]]
    halves = (estimate.half(0), estimate.half(1))
    page = stored.mean(axis=3, dtype=np.float64)
    if truth.shape[1] == 1:
        unresolved = int((error > 2 * OPENNESS_ERROR).any(axis=1).sum())
    else:
        unresolved = int((relative_standard_error(estimate) > target).sum())
    return ChannelCheck(
        value=value,
        reference=truth,
        standard_error=error,
        halves=halves,
        figures=figures(value, truth, standard_error=error, halves=halves, weight=weight),
        shift=best_shift(page, covered, pixel, truth.mean(axis=1), error.mean(axis=1)),
        exponent=exponent(value.mean(axis=1), truth.mean(axis=1)),
        unresolved=unresolved,
    )


def _objects(
    bake: StoredBake,
    owner: NDArray[np.int32],
    channels: dict[str, ChannelCheck],
    weight: NDArray[np.float64],
) -> list[dict[str, Any]]:
    """Return the figures of each object that was judged."""
    found = []
    floor = {name: dark_floor(check.reference) for name, check in channels.items()}
    for number in np.unique(owner):
        mine = owner == number
        instance = bake.scene.instances[int(number)]
        entry: dict[str, Any] = {"object": instance.name, "node": instance.node, "channels": {}}
        for name, check in channels.items():
            entry["channels"][name] = figures(
                check.value[mine],
                check.reference[mine],
                standard_error=check.standard_error[mine],
                halves=(check.halves[0][mine], check.halves[1][mine]),
                floor=floor[name],
                weight=weight[mine],
            )
        found.append(entry)
    return found


def _problems(
    channels: dict[str, ChannelCheck], objects: list[dict[str, Any]], owner: NDArray[np.int32]
) -> list[str]:
    """Return what is wrong beyond single figures: shifted pages, curves, single objects."""
    found = []
    for name, check in channels.items():
        if check.shift != (0, 0):
            down, right = check.shift
            found.append(f"{name} fits better {down} rows and {right} columns further: the page is shifted")
        if name == "irradiance" and check.exponent is not None and abs(check.exponent - 1.0) > _EXPONENT:
            found.append(f"{name} follows the {check.exponent:.2f}th power of the truth: a curve was applied")
    floor = {name: dark_floor(check.reference) for name, check in channels.items()}
    for entry, number in zip(objects, np.unique(owner), strict=True):
        mine = owner == number
        for name, values in entry["channels"].items():
            allowed = _OBJECT_BIAS if values["texels"] >= _OBJECT_TEXELS[1] else 2 * _OBJECT_BIAS
            if values["texels"] < _OBJECT_TEXELS[0] or abs(values["bias"]) <= allowed:
                continue
            check = channels[name]
            mean = float(check.reference[mine].mean())
            error = float(np.sqrt((check.standard_error[mine].mean(axis=1) ** 2).sum()) / values["texels"])
            if mean > floor[name] and abs(values["bias"]) * mean > _OBJECT_SURE * error:
                found.append(
                    f"{name} of '{entry['object']}' (node {entry['node']}) is off by"
                    f" {100 * values['bias']:+.0f} % on the whole"
                )
    return found
