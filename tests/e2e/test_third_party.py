"""Every scene of assets/third-party bakes, or is refused with one sentence."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import baker

FOLDER = Path(__file__).parents[2] / "assets" / "third-party"
SCENES = sorted(p for p in FOLDER.rglob("*") if p.suffix in {".glb", ".gltf", ".obj"})


def test_there_are_scenes():
    assert len(SCENES) >= 12


def bake_or_refuse(path):
    try:
        return baker.bake(path, resolution=128, quality="preview", sky="1"), None
    except baker.InputError as error:
        return None, error


@pytest.mark.parametrize("path", SCENES, ids=lambda p: p.stem)
def test_scene_bakes_or_is_refused_in_one_sentence(path):
    result, refusal = bake_or_refuse(path)
    if result is None:
        assert "\n" not in str(refusal)
        assert str(path) in str(refusal)
        assert len(refusal.message) > 20
        return
    irradiance, ao = (result.lightmaps[name].value for name in ("irradiance", "ao"))
    covered = (result.status != 0) & (result.status != 2)
    assert covered.sum() > 20
    assert (result.texel_count > 0).all()
    for value in (irradiance, ao):
        assert np.isfinite(value).all()
        assert value.min() >= 0
    assert ao.max() <= 1
    # The sky of 1 cd/m2 lights some texels.
    assert irradiance[covered].max() > 0.1
    energy = result.solve["energy"]
    assert energy["absorbed"] + energy["escaped"] == pytest.approx(energy["emitted"], rel=1e-2)
