"""`baker verify`: correct bakes pass, and changed bakes fail."""

from __future__ import annotations

import json
import shutil
import time
import xml.etree.ElementTree as ElementTree
from dataclasses import replace
from io import StringIO
from pathlib import Path

import numpy as np
import pytest
from tiny_scenes import Quad, box_quads, grey, quad_scene

from baker.cli.app import run
from baker.core.scene import Material, PunctualLight
from baker.core.settings import make_settings
from baker.encodings.exr import decode_exr, encode_exr
from baker.pipeline.bake import bake
from baker.verification import tracing
from baker.verification.settings import VerifySettings
from baker.verification.verify import verify

QUICK = ["--texels", "400", "--spp", "256"]


@pytest.fixture(scope="module")
def sound(tmp_path_factory) -> Path:
    red = Material(base_colour=(0.7, 0.2, 0.1, 1.0))
    walls = box_quads((0, 0, 0), (2, 3, 2), inward=True, material=grey(0.6))
    walls[0] = replace(walls[0], material=red)
    emitter = Quad((0.5, 1.9, 1.95), (0.8, 0, 0), (0, -0.6, 0), grey(0, 8.0))
    block = box_quads((0.3, 0.4, 0.2), (0.9, 1.0, 0.8), inward=False, material=grey(0.4))
    scene = quad_scene([*walls, emitter, *block])
    light = PunctualLight("point", "bulb", 0, (0.4, 0.4, 0.5), (1.6, 0.5, 1.2))
    out = tmp_path_factory.mktemp("verify") / "out"
    settings = make_settings({"resolution": 128, "samples": 128, "ao_distance": "0.7"})
    bake(replace(scene, lights=(light,)), settings=settings, out=out)
    return out


def tampered(sound: Path, tmp_path: Path, change) -> Path:
    out = tmp_path / "out"
    shutil.copytree(sound, out)
    image = decode_exr(out / "irradiance_0.exr")
    encode_exr(out / "irradiance_0.exr", change(image.pixels.copy(), out), half=True, header={})
    return out


def doubled(pixels, out):
    manifest = json.loads((out / "bake.json").read_text())
    from baker.core.geometry import world_geometry
    from baker.io.bake.read_bake import read_bake
    from baker.metrics.texel_area import instance_map

    stored = read_bake(out)
    owner = instance_map(world_geometry(stored.scene, stored.atlas), 1, 128)[0]
    largest = int(np.argmax([entry["texels"] for entry in manifest["instances"]]))
    pixels[owner == largest] *= 2
    return pixels


TAMPERING = {
    "one object's light doubled": doubled,
    "u and v swapped": lambda pixels, _: np.ascontiguousarray(pixels.transpose(1, 0, 2)),
    "rows upside down": lambda pixels, _: pixels[::-1].copy(),
    "shifted by a column": lambda pixels, _: np.roll(pixels, 1, axis=1),
    "shifted by a row": lambda pixels, _: np.roll(pixels, -1, axis=0),
    "gamma applied": lambda pixels, _: pixels ** (1 / 2.2),
    "pi left out": lambda pixels, _: pixels / np.pi,
    "five percent darker": lambda pixels, _: pixels * 0.95,
}


def told(*argv):
    stream = StringIO()
    code = run(["verify", *map(str, argv), "--json", "-q"], out=stream)
    return code, json.loads(stream.getvalue())


def test_a_sound_bake_passes(sound):
    code, found = told(sound, *QUICK)
    assert code == 0
    assert found["passed"] is True
    light, ao = found["channels"]["irradiance"], found["channels"]["ao"]
    assert light["texels"] == ao["texels"] == pytest.approx(400, abs=20)
    assert abs(light["bias"]) < 0.01
    assert light["median"] < 0.03
    # Much of the median error is noise of the path-traced reference. The figure `noise_floor` is this noise.
    assert 0.3 * light["median"] < light["noise_floor"] < light["median"] * 1.2
    assert ao["rmse"] < 0.02
    assert light["shift"] == [0, 0]
    assert light["exponent"] == pytest.approx(1, abs=0.03)
    assert len(found["worst"]) == 10
    assert {"object", "node", "page", "row", "column", "position", "value", "reference"} <= set(
        found["worst"][0]
    )
    assert found["warnings"] == []
    for figures in (light, ao):
        assert 0 < figures["energy_ratio_se"] < 0.01
        assert abs(figures["energy_ratio"] - 1) < 4 * figures["energy_ratio_se"] + 0.005
    assert sum(entry["channels"]["irradiance"]["texels"] for entry in found["objects"]) == light["texels"]
    assert sum(light["z_histogram"]["counts"]) > 3 * 350


@pytest.mark.parametrize("name", TAMPERING)
def test_tampering_is_caught(sound, tmp_path, name):
    out = tampered(sound, tmp_path, TAMPERING[name])
    code, found = told(out, *QUICK)
    assert code == 1
    assert found["passed"] is False
    assert found["problems"] or any(limit["failed"] for limit in found["limits"])
    # `verify` uses the changed file and warns that its hash differs.
    assert [w["object"] for w in found["warnings"]] == ["irradiance_0.exr"]
    if "shifted" in name:
        assert found["channels"]["irradiance"]["shift"] != [0, 0]
    if "gamma" in name:
        assert found["channels"]["irradiance"]["exponent"] == pytest.approx(1 / 2.2, abs=0.05)


def test_limits_on_the_energy_ratio_detect_a_gain_of_light(sound, tmp_path):
    out = tampered(sound, tmp_path, lambda pixels, _: pixels * 1.03)
    limit = ("--fail-if", "irradiance.energy_ratio > 1.02, irradiance.energy_ratio < 0.98")
    code, before = told(sound, *QUICK, *limit)
    assert (code, before["passed"]) == (0, True)
    code, after = told(out, *QUICK, *limit)
    assert (code, [v["failed"] for v in after["limits"]]) == (1, [True, False])
    figures = [found["channels"]["irradiance"] for found in (before, after)]
    ratio = [found["energy_ratio"] for found in figures]
    # Texels are chosen by their rank in brightness. Rounding to half floats changes the ranks, so the two
    # sets of texels differ slightly.
    error = np.hypot(*(found["energy_ratio_se"] for found in figures))
    assert ratio[1] / ratio[0] == pytest.approx(1.03, abs=4 * error)
    stream = StringIO()
    assert run(["verify", str(out), *QUICK, *limit], out=stream) == 1
    assert f"energy ratio {ratio[1]:.4f} +- " in stream.getvalue()


def test_texels_represent_the_area_of_their_objects(sound):
    from baker.core.geometry import world_geometry
    from baker.io.bake.read_bake import read_bake
    from baker.metrics.texel_area import instance_map, surface_points

    stored = read_bake(sound)
    geometry = world_geometry(stored.scene, stored.atlas)
    owner = instance_map(geometry, 1, 128).reshape(-1)
    pixel = np.flatnonzero(owner >= 0)
    size = np.bincount(owner[pixel], weights=surface_points(geometry, pixel, 128, 4, 0).surface)
    # The first six objects are the walls of a room of 2 x 3 x 2 m.
    np.testing.assert_allclose(np.sort(size[:6]), [4, 4, 6, 6, 6, 6], rtol=0.02)
    assert size[6] == pytest.approx(0.48, rel=0.06)
    np.testing.assert_allclose(size[7:], 0.36, rtol=0.06)


def test_limits_decide_the_exit_code(sound):
    code, found = told(sound, *QUICK, "--fail-if", "irradiance.median > 0.5, ao.rmse > 0.5")
    assert (code, found["passed"]) == (0, True)
    code, found = told(sound, *QUICK, "--fail-if", "irradiance.median > 0.5, irradiance.max >= 0")
    assert (code, found["passed"]) == (1, False)
    assert [limit["failed"] for limit in found["limits"]] == [False, True]


@pytest.mark.parametrize(
    ("argv", "code", "said"),
    [
        (["--fail-if", "irradiance.p59 > 1"], 2, "there is no figure 'p59'; did you mean"),
        (["--fail-if", "nonsense"], 2, "not of the form"),
        (["--fail-if", ""], 2, "it is empty"),
        (["--texels", "0"], 2, "--texels"),
        (["--spp", "0"], 2, "--spp"),
        (["--time-limit", "-1"], 2, "--time-limit"),
    ],
)
def test_wrong_use(sound, argv, code, said, capsys):
    got, found = told(sound, *argv)
    assert got == code
    assert said in found["error"]["message"]
    assert capsys.readouterr().err.startswith(f"baker: {argv[0]}")


def test_what_is_no_bake(tmp_path):
    code, found = told(tmp_path)
    assert code == 3
    assert "holds no bake" in found["error"]["message"]


def test_reports(sound, tmp_path):
    page, junit = tmp_path / "r.html", tmp_path / "r.xml"
    stream = StringIO()
    assert run(["verify", str(sound), *QUICK, "--report", str(page), "--junit", str(junit)], out=stream) == 0
    assert "passed" in stream.getvalue()
    text = page.read_text()
    assert text.count("data:image/png;base64,") >= 4 + 9
    assert "http" not in text.replace("http-equiv", "")
    assert "energy_ratio_se" in text
    assert "<h1>Verification of " in text
    assert "The bake is good: irradiance is " in text
    assert "The bake is good: irradiance is " in stream.getvalue()
    # The report contains date, versions and settings, the explanation of each figure, and a plot of the light
    # levels.
    assert " UTC, baker " in text
    assert "--resolution 128" in text
    assert "--texels 400" in text
    assert "mean error relative to the mean light" in text
    assert 'aria-label="error against light level"' in text
    assert "default limits on irradiance" in stream.getvalue()
    # Tables have at most 8 columns, so that they fit a page of 1200 pixels.
    assert max(row.count("<th>") for row in text.split("<tr>")) <= 8
    suite = ElementTree.parse(junit).getroot()[0]
    assert int(suite.attrib["tests"]) >= 6
    assert suite.attrib["failures"] == "0"


def test_the_same_seed_gives_the_same_figures(sound):
    one = verify(sound, VerifySettings(texels=100, spp=32, time_limit=None, seed=3, threads=1))
    two = verify(sound, VerifySettings(texels=100, spp=32, time_limit=None, seed=3, threads=2))
    other = verify(sound, VerifySettings(texels=100, spp=32, time_limit=None, seed=4))
    assert one.channels["irradiance"].metrics == two.channels["irradiance"].metrics
    assert not np.array_equal(one.pixel, other.pixel)


def test_a_time_limit_ends_it(sound):
    found = verify(sound, VerifySettings(texels=300, target_se=1e-6, time_limit=1.0))
    assert found.seconds < 60
    assert found.channels["irradiance"].unresolved > 200


def test_compiling_does_not_use_up_the_time_limit(sound, monkeypatch):
    """Compile time does not count towards `time_limit`, so a first run traces as many paths as later runs."""
    passes, real = [], tracing.irradiance_pass

    def slow_at_first(*args, **options):
        if not passes:
            time.sleep(1.5)
        passes.append(len(args))
        return real(*args, **options)

    monkeypatch.setattr(tracing, "irradiance_pass", slow_at_first)
    found = verify(sound, VerifySettings(texels=40, target_se=1e-4, time_limit=1.0))
    assert len(passes) > 3
    # The compile time is reported separately.
    assert found.compile_seconds > 1.5


def test_few_bounces_are_compared_with_few(tmp_path):
    scene = quad_scene([*box_quads((0, 0, 0), (1, 1, 1), inward=True, material=grey(0.5, 1.0))])
    bake(scene, settings=make_settings({"resolution": 64, "samples": 64, "bounces": 1}), out=tmp_path / "out")
    found = verify(tmp_path / "out", VerifySettings(texels=100, spp=64, time_limit=None))
    assert found.channels["irradiance"].reference.mean() == pytest.approx(1.5 * np.pi, rel=0.01)
    assert found.passed


def test_a_bake_under_a_weaker_sky_is_compared_under_it(tmp_path):
    scene = quad_scene(box_quads((0, 0, 0), (1, 1, 1), inward=False, material=grey(0.5)))
    settings = make_settings({"resolution": 64, "samples": 64, "sky": "2,2,2", "sky_strength": 0.25})
    bake(scene, settings=settings, out=tmp_path / "out")
    found = verify(tmp_path / "out", VerifySettings(texels=100, spp=64, time_limit=None))
    # From the outside of a box, only the sky is visible. Its radiance is L = 0.5 cd/m2, so E = pi L.
    assert found.channels["irradiance"].reference == pytest.approx(0.5 * np.pi, rel=1e-3)
    assert found.channels["irradiance"].metrics["energy_ratio"] == pytest.approx(1, abs=0.002)
