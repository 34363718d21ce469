"""`baker verify` on folders that were moved, have one channel, many pages or no light, or are damaged."""

from __future__ import annotations

import json
import shutil
from io import StringIO
from pathlib import Path

import numpy as np
import pytest
from tiny_scenes import Quad, box_quads, grey, quad_scene

from baker.cli.app import run
from baker.core.settings import make_settings
from baker.pipeline.bake import bake
from baker.verification.settings import VerifySettings
from baker.verification.verify import verify

QUICK = VerifySettings(texels=120, spp=128, time_limit=None)


def room(emission=0.0):
    return quad_scene(box_quads((0, 0, 0), (1, 1, 1), inward=True, material=grey(0.5, emission)))


def baked(out: Path, scene=None, **settings) -> Path:
    chosen = {"resolution": 48, "samples": 64, **settings}
    bake(room(1.0) if scene is None else scene, settings=make_settings(chosen), out=out)
    return out


@pytest.fixture(scope="module")
def plain(tmp_path_factory) -> Path:
    return baked(tmp_path_factory.mktemp("plain") / "out")


def test_a_moved_folder(plain, tmp_path):
    moved = tmp_path / "else where" / "bake"
    shutil.copytree(plain, moved)
    found = verify(moved, QUICK)
    assert found.passed
    # All surfaces have the same emission and albedo (a furnace), so E = pi L / (1 - albedo) everywhere.
    assert found.channels["irradiance"].reference.mean() == pytest.approx(2 * np.pi, rel=0.01)
    assert abs(found.channels["irradiance"].metrics["bias"]) < 0.005


def test_ao_alone(tmp_path):
    out = baked(tmp_path / "out", channels="ao", ao_distance="0.4", samples=256)
    found = verify(out, QUICK)
    assert list(found.channels) == ["ao"]
    assert found.passed
    with pytest.raises(Exception, match="no channel 'irradiance'"):
        verify(out, VerifySettings(fail_if="irradiance.median > 1"))


def test_many_pages(tmp_path):
    out = baked(tmp_path / "out", resolution=32, density=20.0, max_pages=16)
    found = verify(out, QUICK)
    assert found.bake.atlas.n_pages > 1
    assert len(np.unique(found.pixel // 32**2)) == found.bake.atlas.n_pages
    assert found.passed
    assert {entry["page"] for entry in found.worst} <= set(range(found.bake.atlas.n_pages))


def test_nothing_is_lit(tmp_path):
    found = verify(baked(tmp_path / "out", room(0.0), channels="irradiance,ao"), QUICK)
    assert found.passed
    figures = found.channels["irradiance"].metrics
    assert figures["bias"] == figures["median"] == figures["max"] == 0
    # The result contains no NaN or infinity, which JSON cannot represent.
    json.dumps(found.to_dict(), allow_nan=False)


def test_sky_alone(tmp_path):
    floor = Quad((0, 0, 0), (0, 0, 1), (1, 0, 0))
    post = box_quads((0.4, 0, 0.4), (0.6, 0.5, 0.6), inward=False)
    found = verify(baked(tmp_path / "out", quad_scene([floor, *post]), sky="2,1,0.5"), QUICK)
    assert found.passed
    # The red radiance of the sky is L = 2 cd/m2. Far from the post, which hides a part of the sky, E is
    # nearly pi L.
    assert found.channels["irradiance"].reference[:, 0].max() == pytest.approx(2 * np.pi, rel=0.1)


def without(name):
    return lambda out: (out / name).unlink()


def spoilt(name, content=b"nonsense"):
    return lambda out: (out / name).write_bytes(content)


def cut(name):
    return lambda out: (out / name).write_bytes((out / name).read_bytes()[:200])


@pytest.mark.parametrize(
    ("harm", "named"),
    [
        (without("irradiance_0.exr"), "irradiance_0.exr"),
        (cut("irradiance_0.exr"), "irradiance_0.exr"),
        (spoilt("ao_0.exr"), "ao_0.exr"),
        (without("status_0.png"), "status_0.png"),
        (spoilt("status_0.png"), "status_0.png"),
        (without("scene.glb"), "scene.glb"),
        (cut("scene.glb"), "scene.glb"),
        (without("bake.json"), "out"),
        (spoilt("bake.json"), "out"),
        (spoilt("bake.json", b'{"version": 1}'), "out"),
    ],
)
def test_damage_is_told_in_one_sentence(plain, tmp_path, harm, named):
    out = tmp_path / "out"
    shutil.copytree(plain, out)
    harm(out)
    stream = StringIO()
    assert run(["verify", str(out), "--json", "-q"], out=stream) == 3
    error = json.loads(stream.getvalue())["error"]
    assert named in error["file"]
    assert "\n" not in error["message"]
    assert "Traceback" not in error["message"]
