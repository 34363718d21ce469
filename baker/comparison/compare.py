"""Compares the maps of two finished bakes, a and b, at the same surface points.

Texels of bake a are chosen, and a surface point in each of them. For each point, the matching point on the
surface of bake b is searched. The map of each bake is looked up bilinearly at the lightmap uv of its point.
Bake b is the reference: a bias of +10 % means that bake a is 10 % brighter than bake b.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from baker.comparison.manifests import manifest_differences
from baker.comparison.match import ComparedSurfaces, TrianglePoints, make_sides, match
from baker.comparison.pairs import pair_objects
from baker.comparison.pictures import FlipMeans, page_flip, read
from baker.comparison.settings import DiffSettings
from baker.core.errors import InputError, SettingsError
from baker.core.geometry import world_geometry
from baker.core.lightmap import TexelStatus
from baker.core.progress import Progress, report, silent
from baker.core.result import Metrics, Result
from baker.core.scene import SceneWarning
from baker.core.stage import Stage
from baker.io.bake.read_bake import StoredBake, read_bake
from baker.metrics.error_metrics import METRICS, colour_error, dark_floor, error_metrics, relative_error
from baker.metrics.limits import Verdict, evaluate_limits, parse_limits
from baker.metrics.sample_texels import choose_texels
from baker.metrics.texel_area import instance_map, one_surface_point
from baker.metrics.worst_texels import worst_texels

# Metrics on which `fail_if` may set limits. Metrics that need the noise of the reference are left out,
# because the noise of bake b is not known. The energy ratio is left out, because it is not computed here.
LIMITED = (*(name for name in METRICS if not name.startswith(("noise", "z_", "energy"))), "flip")


@dataclass(frozen=True, eq=False)
class ChannelDifference(Metrics):
    """Values of one channel of both bakes at n points, and their error metrics.

    Attributes
    ----------
    value, reference : (n, C) float64
        Values of bake a and of bake b.
    standard_error : (n, C) float64
        Standard error of the reference. It is always 0, because the noise of bake b is not known.
    metrics : dict
        The metrics of `baker.metrics.error_metrics`, and "flip", the mean FLIP error.
    """

    value: NDArray[np.float64]
    reference: NDArray[np.float64]
    standard_error: NDArray[np.float64]
    metrics: dict[str, Any]


@dataclass(frozen=True, eq=False, repr=False)
class DiffReport(Result):
    """The differences of two bakes.

    Attributes
    ----------
    a, b : StoredBake
        The two bakes. b is the reference.
    channels : dict of str to ChannelDifference
        The channels that both bakes have, by name.
    objects : list of dict
        Metrics of each object of bake a, in the form of `to_dict`.
    worst : list of dict
        The texels with the largest errors, in the form of `to_dict`.
    differences : list of dict
        Settings and other manifest entries that differ, in the form of `to_dict`.
    only_in_a, only_in_b : list of dict
        Name and node of the objects whose surface is missing in the other bake, see `baker.comparison.match`.
    unmatched : int
        Number of chosen points of bake a without a matching point in bake b, except points on the objects
        `only_in_a`.
    verdicts : list of Verdict
        Results of the limits.
    warnings : list of SceneWarning
    seconds : float
        Duration of the comparison, seconds.
    """

    a: StoredBake
    b: StoredBake
    channels: dict[str, ChannelDifference]
    objects: list[dict[str, Any]]
    worst: list[dict[str, Any]]
    differences: list[dict[str, Any]]
    only_in_a: list[dict[str, Any]]
    only_in_b: list[dict[str, Any]]
    unmatched: int
    verdicts: list[Verdict]
    warnings: list[SceneWarning]
    seconds: float

    @property
    def passed(self) -> bool:
        """Return whether no limit was exceeded."""
        return not any(verdict.failed for verdict in self.verdicts)

    def summary(self) -> dict[str, Any]:
        """Return the names and values that `repr` and notebooks show."""
        rows: dict[str, Any] = {"passed": self.passed}
        for name, channel in self.channels.items():
            rows[f"{name} bias"], rows[f"{name} p95"] = channel.metrics["bias"], channel.metrics["p95"]
        return rows | {"settings that differ": len(self.differences)}

    def to_dict(self) -> dict[str, Any]:
        """Return the comparison as the JSON object that `baker diff --json` prints."""
        return {
            "passed": self.passed,
            "channels": {name: check.metrics for name, check in self.channels.items()},
            "objects": self.objects,
            "worst": self.worst,
            "differences": self.differences,
            "only_in_a": self.only_in_a,
            "only_in_b": self.only_in_b,
            "unmatched": self.unmatched,
            "limits": [{"limit": str(v.limit), "value": v.value, "failed": v.failed} for v in self.verdicts],
            "seconds": self.seconds,
            "warnings": [{"code": w.code, "message": w.message, "object": w.object} for w in self.warnings],
        }


def compare(
    a: Path | str, b: Path | str, settings: DiffSettings | None = None, progress: Progress = silent
) -> DiffReport:
    """Compare the bake in folder a with the bake in folder b.

    Parameters
    ----------
    a, b : Path or str
        Output folders of bakes. b is the reference.
    settings : DiffSettings, optional
        Number of texels to compare, limits, and further settings.
    progress : Progress
        Called with the stage, the fraction done and a text; a truthy return value cancels.

    Returns
    -------
    DiffReport
        Metrics of each channel that both bakes have, and the texels with the largest errors.

    Raises
    ------
    InputError
        If a folder has no bake, or the bakes have no channel or no surface in common.
    SettingsError
        If `fail_if` is malformed, or limits FLIP although `flip` is not set.
    ResourceError
        If memory runs out.
    Cancelled
        If `progress` returned a truthy value.
    """
    settings = settings or DiffSettings()
    start = time.monotonic()
    report(progress, Stage.LOAD, 0.0)
    first, second = read_bake(a).with_texels(), read_bake(b).with_texels()
    names = [n for n in first.maps if n in second.maps and first.maps[n].shape[3] == second.maps[n].shape[3]]
    if not names:
        raise InputError("the bakes have no channel in common", file=str(b))
    limits = [] if settings.fail_if is None else parse_limits(settings.fail_if, names, LIMITED)
    if not settings.flip and any(limit.metric == "flip" for limit in limits):
        raise SettingsError("`fail_if` limits flip, which `flip=False` leaves out", object="fail_if")
    for bake in (first, second):
        _check_pages(bake, names)
    pairs = pair_objects(first.scene, second.scene)
    # Make positions of both bakes relative to the same origin.
    origin = first.scene.origin
    surfaces = [world_geometry(bake.scene, bake.atlas, origin) for bake in (first, second)]
    sides = make_sides(surfaces[0], surfaces[1], first.scene, second.scene, pairs)
    report(progress, Stage.COMPARE, 0.0)
    owners = _owners(first, sides)
    pixel, points, other, lost = _choose(first, sides, owners, names[0], settings)
    if not len(pixel):
        raise InputError("the bakes have no surface in common; are they of the same scene?", file=str(b))
    means = FlipMeans(dict.fromkeys(names), {})
    if settings.flip:
        means = page_flip(first, second, sides, owners >= 0, names, settings.seed, progress)
    channels = {}
    for name in names:
        value, reference = read(first, sides.a, points, name), read(second, sides.b, other, name)
        found = {**error_metrics(value, reference), "flip": means.channel[name]}
        channels[name] = ChannelDifference(value, reference, np.zeros_like(value), found)
    owner = sides.a.instance[points.triangle]
    size = first.atlas.resolution
    where = points.at(sides.a, "position") + origin
    worst = worst_texels(first.scene.instances, size, pixel, owner, where, channels, _largest_error)
    worst = [entry for entry in worst if entry["error"] > 0]
    _add_texels_of_b(worst, first, second, sides, pixel, other)
    return DiffReport(
        a=first,
        b=second,
        channels=channels,
        objects=_objects(first, channels, means, owner, lost),
        worst=worst,
        differences=manifest_differences(first, second, pairs),
        only_in_a=_named(first, sides.missing_a),
        only_in_b=_named(second, sides.missing_b),
        unmatched=int(lost.sum()),
        verdicts=evaluate_limits(limits, {name: check.metrics for name, check in channels.items()}),
        warnings=[
            SceneWarning(w.code, f"{bake.folder}: {w.message}", w.object)
            for bake in (first, second)
            for w in bake.warnings
        ],
        seconds=time.monotonic() - start,
    )


def _largest_error(
    value: NDArray[np.float64], reference: NDArray[np.float64], floor: float
) -> NDArray[np.float64]:
    """Return (n,) float64: the larger of the relative error of the mean and the largest error of a colour.

    Only the error of a colour is above 0 at points whose values differ but have equal means. Channels without
    three components, and channels with negative reference values, have no error of a colour.
    """
    error = relative_error(value, reference, floor)
    if value.shape[1] != 3 or (reference < 0).any():
        return error
    return np.asarray(np.maximum(error, colour_error(value, reference, floor).max(axis=1)), np.float64)


def _owners(bake: StoredBake, sides: ComparedSurfaces) -> NDArray[np.int32]:
    """Return (P, H, W) int32: the instance of each texel of bake a, -1 for texels that are not compared.

    Invalid and dilated texels, and texels of objects that bake b lacks, are not compared.
    """
    owner = instance_map(sides.a, bake.atlas.n_pages, bake.atlas.resolution)
    covered = np.isin(bake.status, (TexelStatus.COVERED, TexelStatus.UNCONVERGED))
    return np.where(covered & ~sides.missing_a[owner], owner, -1).astype(np.int32)


def _choose(
    bake: StoredBake, sides: ComparedSurfaces, owner: NDArray[np.int32], name: str, settings: DiffSettings
) -> tuple[NDArray[np.int64], TrianglePoints, TrianglePoints, NDArray[np.int64]]:
    """Choose texels of bake a that have a matching surface point in bake b.

    The results are:

    - the texels (n,) as (page * H + row) * W + column;
    - their points on the surface of a, and the matching points on the surface of b;
    - for each instance of a, the number of texels that were dropped because they have no matching point. This
      number is 0 for objects that b lacks.
    """
    brightness = bake.maps[name].mean(axis=3, dtype=np.float64).reshape(-1)
    owner = owner.reshape(-1)
    pixel = choose_texels(owner, owner >= 0, brightness, settings.texels, settings.seed)
    points = TrianglePoints(*one_surface_point(sides.a, pixel, bake.atlas.resolution, settings.seed))
    other = match(sides, points)
    met = other.triangle >= 0
    lost = np.bincount(sides.a.instance[points.triangle[~met]], minlength=len(bake.scene.instances))
    return pixel[met], points[met], other[met], np.where(sides.missing_a, 0, lost)


def _check_pages(bake: StoredBake, names: list[str]) -> None:
    for name in names:
        if len(bake.maps[name]) != bake.atlas.n_pages:
            message = f"the bake lacks pages of {name}; bake the scene again"
            raise InputError(message, file=str(bake.folder))


def _objects(
    bake: StoredBake,
    channels: dict[str, ChannelDifference],
    means: FlipMeans,
    owner: NDArray[np.int32],
    lost: NDArray[np.int64],
) -> list[dict[str, Any]]:
    """Return the metrics of each object of bake a that has compared or unmatched points.

    `owner` (n,) is the instance of each point, and `lost` (I,) the number of unmatched points of each
    instance.
    """
    found = []
    floor = {name: dark_floor(check.reference) for name, check in channels.items()}
    for number, instance in enumerate(bake.scene.instances):
        mine = owner == number
        if not mine.any() and not lost[number]:
            continue
        entry: dict[str, Any] = {"object": instance.name, "node": instance.node}
        entry["unmatched"] = int(lost[number])
        entry["channels"] = {
            name: {
                **error_metrics(check.value[mine], check.reference[mine], floor=floor[name]),
                "flip": means.object.get((name, number)),
            }
            for name, check in channels.items()
        }
        found.append(entry)
    return found


def _add_texels_of_b(
    worst: list[dict[str, Any]],
    a: StoredBake,
    b: StoredBake,
    sides: ComparedSurfaces,
    pixel: NDArray[np.int64],
    other: TrianglePoints,
) -> None:
    """Add to each entry of `worst` the texel of bake b at the same surface point, as `in_b`."""
    size_a, size_b = a.atlas.resolution, b.atlas.resolution
    uv = other.at(sides.b, "uv")
    for entry in worst:
        del entry["standard_error"]
        i = np.searchsorted(pixel, (entry["page"] * size_a + entry["row"]) * size_a + entry["column"])
        column, row = np.clip(np.floor(uv[i] * size_b), 0, size_b - 1).astype(int).tolist()
        triangle = other.triangle[i]
        instance = b.scene.instances[int(sides.b.instance[triangle])]
        texel = {"page": int(sides.b.page[triangle]), "row": row, "column": column}
        entry["in_b"] = {"object": instance.name, "node": instance.node, **texel}


def _named(bake: StoredBake, which: NDArray[np.bool_]) -> list[dict[str, Any]]:
    some = (bake.scene.instances[i] for i in np.flatnonzero(which))
    return [{"object": instance.name, "node": instance.node} for instance in some]
