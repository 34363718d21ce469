"""The speed of earlier bakes is read from their manifests; damaged manifests are skipped or refused."""

from __future__ import annotations

import json

import pytest
from io_scenes import quad_result

from baker.checks.bake_rates import rates_beside, rates_of
from baker.core.errors import SettingsError
from baker.core.stage import Stage
from baker.io.bake.write_bake import write_bake

DAMAGE = {
    "no JSON": lambda _: "{",
    "an endless number": lambda text: text.replace('"timings": {', '"timings": {"load": 1e999, ', 1),
    "negative rays": lambda text: text.replace('"rays": {', '"rays": {"final_gather": -1, ', 1),
    "texels of a word": lambda text: text.replace('"texels": ', '"texels": "many", "n": ', 1),
    "no path": lambda text: text.replace('"path": ', '"way": ', 1),
}


@pytest.fixture
def out(tmp_path):
    write_bake(quad_result(tmp_path), tmp_path / "out")
    manifest = json.loads((tmp_path / "out" / "bake.json").read_text())
    manifest["timings"] |= {Stage.FINAL_GATHER: 3.0}
    manifest["rays"] |= {Stage.FINAL_GATHER: 600}
    (tmp_path / "out" / "bake.json").write_text(json.dumps(manifest))
    return tmp_path / "out"


def scene_of(out):
    return out / json.loads((out / "bake.json").read_text())["input"]["path"]


def test_the_latest_bake_beside_a_scene_is_found(out):
    rates = rates_beside(scene_of(out))
    assert rates.ray[Stage.FINAL_GATHER] == rates_of(out).ray[Stage.FINAL_GATHER] == 0.005
    assert rates.basis == "the bake in 'out'"
    assert rates_beside(scene_of(out).with_name("other.glb")) is None


def test_folders_that_the_user_did_not_name_are_only_read(out, monkeypatch):
    scene, recovered = scene_of(out), []
    monkeypatch.setattr("baker.io.bake.read_manifest.recover", recovered.append)
    assert rates_beside(scene) is not None
    assert recovered == []
    rates_of(out)
    assert recovered == [out]


@pytest.mark.parametrize("name", DAMAGE)
def test_a_damaged_manifest_is_skipped_or_refused(out, name):
    scene, text = scene_of(out), (out / "bake.json").read_text()
    damaged = DAMAGE[name](text)
    assert damaged != text
    (out / "bake.json").write_text(damaged)
    assert rates_beside(scene) is None
    with pytest.raises(SettingsError, match="tells its rays and timings"):
        rates_of(out)
