"""Each check reports its code for the scene with the flaw, and not for the scene without it."""

from __future__ import annotations

import pytest
from flawed_scenes import CASES
from gltf_builder import write

from baker.checks.rule import CHECKS, all_checks
from baker.checks.run import check_scene
from baker.checks.settings import CheckSettings
from baker.core.settings import BakeSettings


def findings(tmp_path, data, settings=None, name="scene.glb"):
    report = check_scene(write(tmp_path / name, data), CheckSettings(), BakeSettings(**(settings or {})))
    return list(report.findings)


def test_every_code_has_a_case():
    assert sorted(CASES) == CHECKS.names()


@pytest.mark.parametrize("code", sorted(CASES))
def test_each_code_is_reported_for_the_flawed_scene_only(tmp_path, code):
    case = CASES[code]
    fired = [f for f in findings(tmp_path, case.bad, case.settings) if f.code == code]
    silent = [f for f in findings(tmp_path, case.good, case.settings) if f.code == code]
    assert fired
    assert not silent, silent
    for finding in fired:
        assert finding.fix
        assert finding.message
        assert finding.severity in ("info", "warning", "error")


@pytest.mark.parametrize("entry", all_checks(), ids=lambda entry: entry.code)
def test_every_check_is_documented_in_a_sentence(entry):
    assert entry.title.endswith(".") or ":" in entry.title
    assert len(entry.title) <= 110
    assert "\n" not in entry.fix
