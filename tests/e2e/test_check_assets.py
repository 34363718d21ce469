"""The findings of `baker check` in all scenes of assets/ equal those in check_findings.txt."""

from __future__ import annotations

import re
from collections import Counter
from pathlib import Path

import pytest

from baker.checks.run import check_scene
from baker.checks.settings import CheckSettings
from baker.core.errors import InputError
from baker.core.settings import BakeSettings
from baker.io.load import load_scene

ASSETS = Path(__file__).parents[2] / "assets"
KEPT = Path(__file__).with_name("check_findings.txt")
SCENES = sorted(p for p in ASSETS.rglob("*") if p.suffix in (".glb", ".obj"))
LINE = re.compile(r"  (\w+) +(\S+) +(\d+) +(\d+)  (\S.*)")


def kept():
    """Return {scene: {(severity, code): (number of objects, count)}} of check_findings.txt."""
    found, scene = {}, ""
    for line in KEPT.read_text("utf-8").splitlines():
        match = LINE.fullmatch(line)
        if match:
            severity, code, objects, count, _ = match.groups()
            found[scene][severity, code] = int(objects), int(count)
        elif line and not line.startswith("#"):
            scene = line
            found[scene] = {}
    return found


@pytest.fixture(scope="module")
def reports():
    return {p.relative_to(ASSETS).as_posix(): check_scene(p, CheckSettings(), BakeSettings()) for p in SCENES}


def test_findings_are_those_that_were_looked_at(reports):
    seen = {}
    for name, report in reports.items():
        objects, count = Counter(), Counter()
        for finding in report.findings:
            objects[finding.severity, finding.code] += 1
            count[finding.severity, finding.code] += finding.found.count
        seen[name] = {key: (objects[key], count[key]) for key in objects}
    assert seen == kept()


def test_errors_stand_only_where_a_bake_refuses_the_scene(reports):
    for path in SCENES:
        report = reports[path.relative_to(ASSETS).as_posix()]
        if any(finding.severity == "error" for finding in report.findings):
            with pytest.raises(InputError):
                load_scene(path)
        else:
            assert load_scene(path).n_triangles > 0
