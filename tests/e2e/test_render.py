"""`baker render`: cameras, layers, closed forms of simple views, errors, and no partly written files."""

from __future__ import annotations

import json
import math
import shutil
from io import StringIO
from pathlib import Path

import numpy as np
import pytest
from gltf_builder import GltfBuilder, quad_builder, write

from baker.cli.app import run
from baker.core.errors import Cancelled, InputError, ResourceError
from baker.core.settings import make_settings
from baker.core.stage import Stage
from baker.encodings.exr import decode_exr, encode_exr
from baker.io.png import decode_png
from baker.pipeline.bake import bake
from baker.rendering.baked import bilinear
from baker.rendering.render import render
from baker.rendering.settings import RenderSettings

ASSETS = Path(__file__).resolve().parents[2] / "assets"
CORNELL = ASSETS / "cornell.glb"
SMALL = ("--width", "16", "--height", "12", "--spp", "4")
# Camera 2 m in front of the centre of the unit square. The square fills the picture.
FRONT = "0.5,0.5,2,0.5,0.5,0,20"
LIGHT = (3.0, 2.0, 1.0)


def told(*argv):
    stream = StringIO()
    code = run(["render", *map(str, argv), "--json", "-q"], out=stream)
    return code, json.loads(stream.getvalue())


def planes(path):
    image = decode_exr(path)
    return {name: image.pixels[..., k] for k, name in enumerate(image.channels)}, image.header


@pytest.fixture(scope="module")
def emissive(tmp_path_factory) -> Path:
    """Write the unit square with albedo (0.6, 0.4, 0.2) and emission `LIGHT`."""
    colours = {"pbrMetallicRoughness": {"baseColorFactor": [0.6, 0.4, 0.2, 1], "metallicFactor": 0}}
    strength = {"KHR_materials_emissive_strength": {"emissiveStrength": 3.0}}
    emission = [value / 3 for value in LIGHT]
    builder = quad_builder(**colours, emissiveFactor=emission, extensions=strength)
    builder.json["extensionsUsed"] = ["KHR_materials_emissive_strength"]
    return write(tmp_path_factory.mktemp("render") / "square.glb", builder)


@pytest.fixture(scope="module")
def baked(tmp_path_factory) -> Path:
    out = tmp_path_factory.mktemp("render") / "bake"
    bake(CORNELL, settings=make_settings({"resolution": 128, "samples": 64}), out=out)
    return out


def test_an_emitter_and_its_layers_are_exact(emissive, tmp_path):
    out = tmp_path / "a.exr"
    code, said = told(
        emissive, "-o", out, "--camera", FRONT, *SMALL, "--aov", "albedo,normal,depth", "--max-depth", 1
    )
    assert code == 0
    found, header = planes(out)
    assert set(said["layers"]) == set(found)
    for channel, light, albedo in zip("RGB", LIGHT, (0.6, 0.4, 0.2), strict=True):
        assert found[channel] == pytest.approx(light, rel=1e-5)
        assert found[f"variance.{channel}"] == pytest.approx(0, abs=1e-9)
        assert found[f"albedo.{channel}"] == pytest.approx(albedo, rel=1e-5)
    assert [np.unique(found[f"normal.{axis}"]).tolist() for axis in "XYZ"] == [[0], [0], [1]]
    # Depth is measured along the ray: 2 / cos(angle). A ray passes through a random point of its pixel.
    depth, high = found["depth.Z"], math.tan(math.radians(10))
    row, column = np.mgrid[:12, :16]
    for which, sign in (("least", 1), ("most", -1)):
        x = np.abs((2 * (column + 0.5) / 16 - 1) * 16 / 12) - sign / 12
        y = np.abs(2 * (row + 0.5) / 12 - 1) - sign / 12
        bound = 2 * np.sqrt(1 + (high * x) ** 2 + (high * y) ** 2)
        assert (sign * (depth - bound) > -1e-5).all(), which
    assert header["quantity"] == "radiance"
    assert header["unit"] == "cd/m2"
    assert header["colourSpace"] == "linear Rec.709, D65"
    assert said["camera"]["fov"] == pytest.approx(20)
    assert said["camera"]["position"] == [0.5, 0.5, 2]


def test_the_back_is_black_and_the_sky_shines_behind(emissive, tmp_path):
    out = tmp_path / "a.exr"
    sky = ("--sky", "2,4,6", "--sky-strength", "0.5")
    assert told(emissive, "-o", out, "--camera", "0.5,0.5,-2,0.5,0.5,0,20", *SMALL, *sky)[0] == 0
    assert planes(out)[0]["R"].max() == 0
    assert told(emissive, "-o", out, "--camera", "0.5,0.5,2,0.5,0.5,9,20", *SMALL, *sky)[0] == 0
    assert [float(planes(out)[0][c].mean()) for c in "RGB"] == pytest.approx([1, 2, 3])


def test_the_files_camera_is_that_of_the_flag(tmp_path):
    one, two = tmp_path / "one.exr", tmp_path / "two.exr"
    code, said = told(CORNELL, "-o", one, *SMALL)
    assert code == 0
    eye = said["camera"]
    text = ",".join(repr(v) for v in (*eye["position"], *eye["target"], eye["fov"]))
    assert told(CORNELL, "-o", two, *SMALL, "--camera", text)[0] == 0
    first, second = planes(one)[0], planes(two)[0]
    assert first["R"] == pytest.approx(second["R"], rel=1e-4)
    assert first["R"].std() > 0.1


def test_a_turned_camera_of_the_file(tmp_path):
    # Rotated by 90 degrees about +Y the camera looks along -X, at the front of an emitter.
    builder = quad_builder(emissiveFactor=[1, 1, 1])
    half = math.sqrt(0.5)
    builder.json["nodes"][0]["rotation"] = [0, half, 0, half]
    builder.add("cameras", {"type": "orthographic", "orthographic": {"xmag": 1, "ymag": 1}})
    builder.add("cameras", {"type": "perspective", "perspective": {"yfov": 0.3, "znear": 0.1}})
    builder.node(camera=0)
    builder.node(camera=1, translation=[2, 0.5, -0.5], rotation=[0, half, 0, half])
    scene, out = write(tmp_path / "a.glb", builder), tmp_path / "a.exr"
    code, said = told(scene, "-o", out, *SMALL)
    assert code == 0
    assert said["camera"]["target"] == pytest.approx([1, 0.5, -0.5])
    assert planes(out)[0]["G"] == pytest.approx(1, rel=1e-5)


@pytest.fixture(scope="module")
def watched(tmp_path_factory) -> Path:
    """Write the unit square with four cameras named "eye", "top", "0" and again "eye"."""
    builder = quad_builder(emissiveFactor=[1, 1, 1])
    for k in range(4):
        fov = 0.3 + 0.1 * k
        builder.add("cameras", {"type": "perspective", "perspective": {"yfov": fov, "znear": 0.1}})
    for k, name in enumerate(("eye", "top", "0", "eye")):
        builder.node(camera=k, name=name, translation=[0.5, 0.5, 2 + k])
    return write(tmp_path_factory.mktemp("render") / "watched.glb", builder)


@pytest.mark.parametrize(("text", "number"), [(None, 0), ("top", 1), ("1", 1), ("0", 2), ("3", 3)])
def test_a_camera_of_the_file_by_name_or_number(watched, tmp_path, text, number):
    argv = () if text is None else ("--camera", text)
    code, said = told(watched, "-o", tmp_path / "a.exr", *SMALL, *argv)
    assert code == 0
    assert said["camera"]["position"] == [0.5, 0.5, 2 + number]
    assert math.radians(said["camera"]["fov"]) == pytest.approx(0.3 + 0.1 * number)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        (
            "bottom",
            "no camera 'bottom'; those of the file are 0 (named 'eye'), 1 (named 'top'), 2 (named '0')",
        ),
        ("4", "no camera '4'; those of the file are 0 (named 'eye')"),
        ("-1", "no camera '-1'"),
        ("eye", "2 cameras are named 'eye'; say which by its number; those of the file are 0"),
    ],
)
def test_an_unknown_camera_is_told_what_there_is(watched, tmp_path, text, sentence):
    code, said = told(watched, "-o", tmp_path / "a.exr", *SMALL, f"--camera={text}")
    assert code == 2
    assert sentence in said["error"]["message"]
    assert not (tmp_path / "a.exr").exists()


def test_a_name_where_the_file_has_no_camera(emissive, tmp_path):
    code, said = told(emissive, "-o", tmp_path / "a.exr", *SMALL, "--camera", "eye")
    assert code == 2
    assert "no camera of its own; give seven numbers" in said["error"]["message"]


def test_no_camera_is_one_sentence_with_a_view_that_works(emissive, tmp_path):
    code, said = told(emissive, "-o", tmp_path / "a.exr", *SMALL)
    assert code == 3
    message = said["error"]["message"]
    assert "no perspective camera" in message
    assert said["error"]["file"] == str(emissive)
    hint = message.split("--camera ")[1]
    assert told(emissive, "-o", tmp_path / "a.exr", *SMALL, "--camera", hint)[0] == 0
    seen = planes(tmp_path / "a.exr")[0]["R"]
    assert seen[4:8, 6:10].min() > 0
    # The whole square is visible, so all pixels at the picture's edge are black.
    assert max(seen[0].max(), seen[-1].max(), seen[:, 0].max(), seen[:, -1].max()) == 0


@pytest.mark.parametrize(
    ("argv", "said"),
    [
        (["--camera", "1,2,3"], "seven numbers"),
        (["--camera", "1,2,3,4,5,6,7,8"], "seven numbers"),
        (["--camera", "a,2,3,4,5,6,7"], "seven numbers"),
        (["--camera", ""], "seven numbers"),
        (["--camera", "0,0,0,0,0,0,45"], "same point"),
        (["--camera", "0,0,0,0,0,1,180"], "field of view"),
        (["--camera", "0,0,0,0,0,1,0"], "field of view"),
        (["--camera", "0,0,0,0,0,1,nan"], "field of view"),
        (["--camera", "inf,0,0,0,0,1,45"], "not finite"),
        (["--camera", "1e308,0,0,-1e308,0,1,45"], "too far apart"),
        (["--width", "0"], "--width"),
        (["--height", "20000"], "--height"),
        (["--width", "many"], "integer"),
        (["--spp", "0"], "--spp"),
        (["--time-limit", "0"], "--time-limit"),
        (["--time-limit", "inf"], "--time-limit"),
        (["--time-limit", "nan"], "--time-limit"),
        (["--max-depth", "0"], "--max-depth"),
        (["--max-depth", "2", "--ao"], "--max-depth"),
        (["--estimator", "bdpt", "--ao"], "--ao traces none"),
        (["--estimator", "bdpt", "--lightmap", "x"], "--lightmap traces none"),
        (["--estimator", "mos"], "did you mean 'mis'"),
        (["--aov", "colour"], "no AOV 'colour'"),
        (["--ao", "--ao-distance", "-1"], "--ao-distance"),
        (["--ao-distance", "1"], "needs --ao"),
        (["--ao", "--lightmap", "x"], "exclude each other"),
        (["--sky", "blue"], "sky"),
        (["-o", "a.jpg"], ".exr or .png"),
        (["-o", "a"], ".exr or .png"),
        (["-o", "a.png", "--aov", "depth"], "layers"),
        (["-o", f"{CORNELL}/a.exr"], "is a file"),
    ],
)
def test_wrong_use(argv, said, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    code, found = told(CORNELL, *([] if "-o" in argv else ["-o", "a.exr"]), *argv)
    assert code == 2
    assert said in found["error"]["message"]
    assert "\n" not in found["error"]["message"]
    assert list(tmp_path.iterdir()) == []


def test_what_cannot_be_read(tmp_path, baked):
    out = tmp_path / "a.exr"
    assert told(tmp_path / "no.glb", "-o", out)[0] == 3
    assert told(tmp_path / "no.glb", "-o", out, "--lightmap", baked)[0] == 3
    code, found = told(CORNELL, "-o", out, "--lightmap", tmp_path)
    assert code == 3
    assert "holds no bake" in found["error"]["message"]
    with pytest.raises(InputError, match="no such folder"):
        render(CORNELL, RenderSettings(lightmap=tmp_path / "absent"))
    assert not out.exists()


@pytest.mark.parametrize(
    "argv", [("--estimator", "mis"), ("--estimator", "bdpt"), ("--ao",), ("--denoise",), ("--lightmap",)]
)
def test_the_same_bytes_for_any_threads_and_again(argv, tmp_path, baked):
    argv = [*argv, baked] if argv == ("--lightmap",) else argv
    runs = []
    # The picture has more pixels than one block of the renderer.
    size = ("--width", 150, "--height", 120, "--spp", 2)
    size = SMALL if "bdpt" in argv or "mis" in argv else size
    for number, threads in enumerate((1, 2, 2)):
        out = tmp_path / f"{number}.exr"
        code = told(CORNELL, "-o", out, *size, *argv, "--threads", threads, "--aov", "albedo,normal,depth")[0]
        assert code == 0
        runs.append(out.read_bytes())
    assert runs[0] == runs[1] == runs[2]
    out = tmp_path / "other.exr"
    assert told(CORNELL, "-o", out, *size, *argv, "--seed", 1, "--aov", "albedo,normal,depth")[0] == 0
    assert out.read_bytes() != runs[0]


def test_variance_is_that_of_the_mean():
    # The variance of a pixel over 20 seeds equals the mean variance that the pictures report.
    pictures = [render(CORNELL, RenderSettings(width=16, height=12, spp=32, seed=s)) for s in range(20)]
    spread = np.var([p.colour for p in pictures], axis=0, ddof=1)
    said = np.mean([p.variance for p in pictures], axis=0)
    seen = said > 0
    assert seen.sum() > 200
    assert np.median(spread[seen] / said[seen]) == pytest.approx(1, abs=0.25)


def test_depth_one_shows_emitters_and_their_direct_light_only(tmp_path):
    one, all_of_it = (
        render(CORNELL, RenderSettings(width=16, height=12, spp=64, max_depth=depth)) for depth in (1, None)
    )
    assert 0.2 < one.colour.mean() / all_of_it.colour.mean() < 0.9
    other = render(CORNELL, RenderSettings(width=16, height=12, spp=64, max_depth=1, estimator="light"))
    assert other.colour.mean() == pytest.approx(one.colour.mean(), rel=0.03)


def test_ambient_occlusion_of_known_places(tmp_path):
    # Wall and floor meet at a right angle. For an infinitely long floor, 1 m deep, the AO of the wall at
    # height y is 1 - (1 - y / hypot(y, 1)) / 2.
    builder = GltfBuilder()
    wall = np.float32([[-50, 0, 0], [50, 0, 0], [50, 1, 0], [-50, 1, 0]])
    floor = np.float32([[-50, 0, 1], [50, 0, 1], [50, 0, 0], [-50, 0, 0]])
    triangle = np.uint16([[0, 1, 2], [0, 2, 3]])
    builder.node(mesh=builder.mesh(builder.primitive(wall, triangle), builder.primitive(floor, triangle)))
    scene = write(tmp_path / "corner.glb", builder)
    out, height = tmp_path / "a.exr", 0.4
    # The field of view is so small that all pixels show nearly the same height.
    camera = f"0,{height},5,0,{height},0,0.01"
    for distance, expected in (("0.1", 1.0), ("inf", 1 - 0.5 * (1 - height / math.hypot(height, 1)))):
        argv = ("--ao", "--ao-distance", distance, "--width", 16, "--height", 16, "--spp", 256)
        code, said = told(scene, "-o", out, "--camera", camera, *argv)
        assert (code, said["unit"], said["spp"], said["estimator"]) == (0, "1", 256, None)
        assert planes(out)[0]["R"].mean() == pytest.approx(expected, abs=0.004)
    assert planes(out)[1]["quantity"] == "ambient occlusion"
    png = tmp_path / "a.png"
    code, said = told(scene, "-o", png, "--camera", camera, *argv)
    pixels, text = decode_png(png)
    assert pixels.mean() == pytest.approx(255 * expected, abs=1.5)
    assert text["tone mapping"] == said["tone"] == "none, 0 to 1 is 0 to 255"


def test_a_png_is_mapped_as_it_says(emissive, tmp_path):
    out, stream = tmp_path / "a.png", StringIO()
    assert run(["render", str(emissive), "-o", str(out), "--camera", FRONT, *SMALL], out=stream) == 0
    pixels, text = decode_png(out)
    assert text["tone mapping"] == "L / (L + median luminance), then the sRGB curve"
    assert text["tone mapping"] in stream.getvalue()
    assert pixels.shape == (12, 16, 3)
    middle = 0.2126 * LIGHT[0] + 0.7152 * LIGHT[1] + 0.0722 * LIGHT[2]
    linear = [light / (light + middle) for light in LIGHT]
    expected = [255 * (1.055 * x ** (1 / 2.4) - 0.055) for x in linear]
    assert pixels.reshape(-1, 3).mean(axis=0) == pytest.approx(expected, abs=0.6)


def test_denoising_brings_it_nearer_to_the_truth():
    size = {"width": 64, "height": 48}
    truth = render(CORNELL, RenderSettings(**size, spp=256, seed=9)).colour
    noisy, clean = (render(CORNELL, RenderSettings(**size, spp=4, denoise=d)) for d in (False, True))
    assert np.array_equal(noisy.variance, clean.variance)
    apart = [np.median(np.abs(p.colour - truth) / (truth + 0.1 * truth.mean())) for p in (noisy, clean)]
    assert apart[1] < 0.7 * apart[0]


def test_a_bake_shows_what_path_tracing_shows(baked, tmp_path):
    size = {"width": 64, "height": 48}
    truth = render(CORNELL, RenderSettings(**size, spp=128))
    shown = render(CORNELL, RenderSettings(**size, spp=64, lightmap=baked))
    assert shown.warnings == []
    found, expected = shown.colour.mean(axis=2), truth.colour.mean(axis=2)
    # Exclude the emitter, because a few pixels at its edge would dominate the means.
    seen = (expected > 0) & (expected < 0.1 * expected.max())
    assert seen.sum() > 1000
    assert found[seen].mean() == pytest.approx(expected[seen].mean(), rel=0.03)
    assert np.median(np.abs(found / np.maximum(expected, 1e-9) - 1)[seen]) < 0.1
    assert render(baked / "scene.glb", RenderSettings(**size, spp=2, lightmap=baked)).warnings == []


def test_another_scene_than_the_baked_one_is_told(baked, emissive, tmp_path, capsys):
    code, said = told(emissive, "-o", tmp_path / "a.exr", *SMALL, "--lightmap", baked)
    assert code == 0
    assert [w["code"] for w in said["warnings"]] == ["other-scene"]
    stream = StringIO()
    argv = ["render", str(emissive), "-o", str(tmp_path / "a.exr"), *SMALL, "--lightmap", str(baked)]
    assert run(argv, out=stream) == 0
    assert "[other-scene]" in stream.getvalue()


def test_a_picture_by_a_bake_has_the_sky_it_was_baked_under(emissive, tmp_path):
    settings = make_settings({"resolution": 32, "samples": 16, "sky": "2,4,6", "sky_strength": 0.5})
    bake(emissive, settings=settings, out=tmp_path / "out")
    argv = ("--lightmap", tmp_path / "out", "--camera", "0.5,0.5,2,0.5,0.5,9,20")
    assert told(emissive, "-o", tmp_path / "a.exr", *SMALL, *argv)[0] == 0
    assert [float(planes(tmp_path / "a.exr")[0][c].mean()) for c in "RGB"] == pytest.approx([1, 2, 3])


@pytest.mark.parametrize("more", [{}, {"ao": True}])
def test_a_time_limit_ends_it(more):
    picture = render(CORNELL, RenderSettings(width=64, height=48, time_limit=1.0, **more))
    assert picture.seconds < 3
    assert picture.spp > 4
    # With `spp` and `time_limit`, rendering stops at the limit that is reached first.
    assert render(CORNELL, RenderSettings(width=16, height=12, spp=8, time_limit=60)).spp == 8


def test_progress_rises_to_the_end_and_can_cancel(tmp_path):
    told = []
    render(CORNELL, RenderSettings(width=64, height=48, spp=16), lambda *a: told.append(a) and None)
    shares = [fraction for stage, fraction, *_ in told if stage == Stage.RENDERING]
    assert shares == sorted(shares)
    assert (shares[0], shares[-1]) == (0, 1)
    assert len(set(shares)) > 8
    for more in ({}, {"ao": True}, {"estimator": "bdpt"}):
        with pytest.raises(Cancelled):
            render(CORNELL, RenderSettings(width=64, height=48, **more), lambda _, f, __="": f > 0.1)


def test_a_picture_is_whole_or_as_it_was(emissive, tmp_path, monkeypatch):
    out = tmp_path / "deep" / "a.exr"
    argv = (emissive, "-o", out, "--camera", FRONT, *SMALL)
    assert told(*argv)[0] == 0
    before = out.read_bytes()

    def half_written(path, *_, **__):
        path.write_bytes(b"half")
        raise ResourceError("the disk is full", file=str(path))

    monkeypatch.setattr("baker.rendering.write.encode_layers", half_written)
    assert told(*argv, "--seed", 3)[0] == 4
    assert out.read_bytes() == before
    assert [p.name for p in out.parent.iterdir()] == ["a.exr"]


def test_a_tampered_bake_is_shown_as_it_is(baked, tmp_path):
    out = tmp_path / "out"
    shutil.copytree(baked, out)
    pixels = decode_exr(out / "irradiance_0.exr").pixels
    encode_exr(out / "irradiance_0.exr", 2 * pixels, half=True, header={})
    size = {"width": 16, "height": 12, "spp": 4}
    once, twice = (render(CORNELL, RenderSettings(**size, lightmap=folder)) for folder in (baked, out))
    assert [w.object for w in twice.warnings] == ["irradiance_0.exr"]
    # The lightmap does not change how bright emitters appear, so compare the median.
    lit = once.colour > 0
    assert np.median(twice.colour[lit] / once.colour[lit]) == pytest.approx(2, rel=1e-3)


def test_uv_far_outside_of_a_page_have_the_colour_of_its_rim():
    pages = np.arange(4, dtype=np.float32).reshape(1, 2, 2, 1)
    uv = np.array([[1e37, 1e37], [-1e37, -1e37], [1.5, 0.25], [0.5, 0.5]])
    with np.errstate(all="raise"):
        found = bilinear(pages, np.zeros(4, np.int32), uv)
    np.testing.assert_array_equal(found[:, 0], [3, 0, 1, 1.5])
