"""Runs all rules on a scene."""

from __future__ import annotations

import time
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from baker.checks.bake_rates import rates_beside, rates_of
from baker.checks.context import CheckContext
from baker.checks.finding import SEVERITIES, Finding, Location, RawFinding, finding_json
from baker.checks.ignore import Ignore, ignored_by_nodes, parse_ignore
from baker.checks.rule import CHECKS, all_checks, run_check
from baker.checks.settings import CheckSettings, with_extras
from baker.core.errors import IndexRangeError
from baker.core.progress import Progress, silent
from baker.core.progress import report as report_progress
from baker.core.result import Result
from baker.core.scene import Scene
from baker.core.settings import BakeSettings
from baker.core.stage import Stage
from baker.io.load import load_for_bake


@dataclass(frozen=True, repr=False)
class CheckReport(Result):
    """The findings about one scene.

    Attributes
    ----------
    path : Path
    findings : tuple of Finding
        Findings that are not ignored, sorted by severity (errors first), then by code and object.
    ignored : tuple of Finding
        Findings that match a pattern of the setting `ignore` or of the scene's extras.
    fail_on : str
        Lowest severity that fails the check.
    seconds : float
        Duration of reading and checking, seconds.
    timings : dict of str to float
        Duration of each rule by its code, seconds. The key "load" is the duration of reading the scene.
    """

    path: Path
    findings: tuple[Finding, ...]
    ignored: tuple[Finding, ...]
    fail_on: str
    seconds: float = 0.0
    timings: dict[str, float] = field(default_factory=dict)

    @property
    def passed(self) -> bool:
        """Return whether no finding has the severity `fail_on` or a higher one."""
        limit = SEVERITIES.index(self.fail_on)
        return all(finding.rank < limit for finding in self.findings)

    def summary(self) -> dict[str, Any]:
        """Return the names and values that `repr` and notebooks show."""
        counts = Counter(finding.severity for finding in self.findings)
        return {
            "scene": self.path.name,
            "passed": self.passed,
            **{f"{severity}s": counts[severity] for severity in reversed(SEVERITIES)},
        }

    def to_dict(self) -> dict[str, Any]:
        """Return the report as JSON-serialisable values, with the number of ignored findings."""
        return {
            "scene": str(self.path),
            "passed": self.passed,
            "fail_on": self.fail_on,
            "findings": [finding_json(finding) for finding in self.findings],
            "ignored": len(self.ignored),
            "seconds": self.seconds,
        }


def check_scene(
    scene: Scene | Path | str,
    settings: CheckSettings,
    bake_settings: BakeSettings,
    progress: Progress = silent,
) -> CheckReport:
    """Run every rule on a scene.

    Parameters
    ----------
    scene : Scene, Path or str
        A scene, or the path of a scene file. A file is read with `lenient=True`, so that most defects become
        findings.
    settings : CheckSettings
        Settings of the check. The settings in the scene's extras are added.
    bake_settings : BakeSettings
        Settings of the bake that the scene is checked for: resolution, padding, uv, sky and others.
    progress : Progress
        Called with the stage "checks".

    Returns
    -------
    CheckReport
        The findings about the scene and about its file.

    Raises
    ------
    InputError
        If the file cannot be read, or a light is of an unknown kind.
    SettingsError
        If `ignore` has an unknown code, `rates` is not the folder of a bake, or the scene's extras have wrong
        values.
    """
    start = time.perf_counter()
    path = (scene.path or Path("scene")) if isinstance(scene, Scene) else Path(scene)
    parse_ignore(settings.ignore)
    by_nodes: list[Ignore] = []
    timings: dict[str, float] = {}
    try:
        if not isinstance(scene, Scene):
            scene = load_for_bake(path, bake_settings, lenient=True)
    except IndexRangeError as error:
        found = [_index_range(error)]
    else:
        timings[Stage.LOAD] = time.perf_counter() - start
        settings, by_nodes = with_extras(settings, scene), ignored_by_nodes(scene)
        found = _run(path, scene, settings, bake_settings, progress, timings)
    found.sort(key=lambda finding: (-finding.rank, finding.code, finding.object))
    ignore = parse_ignore(settings.ignore) + by_nodes
    counted = tuple(finding for finding in found if not _ignored(ignore, finding))
    ignored = tuple(finding for finding in found if _ignored(ignore, finding))
    limit = settings.fail_on or "error"
    return CheckReport(path, counted, ignored, limit, time.perf_counter() - start, timings)


def _run(
    path: Path,
    scene: Scene,
    settings: CheckSettings,
    bake_settings: BakeSettings,
    progress: Progress,
    timings: dict[str, float],
) -> list[Finding]:
    rates = rates_beside(path) if settings.rates is None else rates_of(settings.rates)
    context = CheckContext(scene, bake_settings, mip=settings.mip, rates=rates, probe=settings.cost)
    found: list[Finding] = []
    entries = all_checks()
    for k, entry in enumerate(entries):
        report_progress(progress, Stage.CHECKS, k / len(entries))
        begin = time.perf_counter()
        found += run_check(entry, context)
        timings[entry.code] = time.perf_counter() - begin
    return found


def _index_range(error: IndexRangeError) -> Finding:
    # An importer that stops at an index out of range returns no scene, so no other rule can run.
    entry = CHECKS.require("index-range", "check")
    found = RawFinding(error.message, Location(error.object or ""))
    return Finding(entry.code, entry.severity, error.message, entry.fix, found)


def _ignored(ignore: list[Ignore], finding: Finding) -> bool:
    return any(rule.matches(finding.code, finding.object, finding.node) for rule in ignore)
