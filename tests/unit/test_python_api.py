"""The Python API has the documented names, settings, results, errors and docs."""

from __future__ import annotations

import doctest
import inspect
import json
import pickle
import pkgutil
import pydoc
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import baker
from baker.api import keywords
from baker.core.result import picture_uri
from baker.core.settings_model import Settings

ROOT = Path(__file__).parents[2]
CORNELL = ROOT / "assets" / "cornell.glb"
FUNCTIONS = sorted(name for name in baker.__all__ if name.islower())


def test_each_stage_alone_before_and_after_a_bake():
    scene = baker.load(CORNELL)
    first = baker.unwrap(scene, resolution=64)
    result = baker.bake(scene, resolution=64, samples=2, denoise=False)
    again = baker.unwrap(scene, resolution=64)
    assert first.resolution == again.resolution == 64
    for one, other in zip(first.layouts, again.layouts, strict=True):
        np.testing.assert_array_equal(one.uv, other.uv)
    assert result.lightmaps["irradiance"].value.shape == (1, 64, 64, 3)


def test_no_module_hides_a_function():
    """No package or module of `baker` has the name of an API function."""
    modules = {found.name for found in pkgutil.iter_modules(baker.__path__)}
    assert modules & {*baker.__all__} == set()


def test_the_api_is_all_that_is_seen():
    assert set(FUNCTIONS) == {
        "ao", "bake", "batch", "check", "diff", "export", "load", "render", "repair", "save", "unwrap",
        "verify", "view",
    }  # fmt: skip
    assert set(dir(baker)) == {*baker.__all__, "__version__"}
    assert not [name for name in dir(baker) if name.startswith("_") and not name.startswith("__")]
    for name in baker.__all__:
        assert getattr(baker, name).__doc__, name
    with pytest.raises(AttributeError, match="no attribute 'bkae'"):
        baker.bkae  # noqa: B018


@pytest.mark.timed
def test_the_import_is_quick_and_imports_nothing_heavy():
    code = (
        "import sys, time; t = time.perf_counter(); import baker; dir(baker); print(time.perf_counter() - t)"
    )
    code += "; print(*sys.modules)"
    seconds = []
    for _ in range(3):
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
        seconds.append(float(done.stdout.splitlines()[0]))
    assert min(seconds) < 0.15
    assert not {"numpy", "numba", "pydantic", "baker.core.settings"} & set(done.stdout.split())


def test_keywords_and_docstrings_are_those_of_the_settings():
    done = subprocess.run(
        [sys.executable, str(ROOT / "docs" / "make_keywords.py"), "--check"], capture_output=True, text=True
    )
    assert (done.returncode, done.stdout) == (0, ""), done.stderr + "run docs/make_keywords.py"


@pytest.mark.parametrize("name", ["bake", "batch", "check", "diff", "render", "repair", "unwrap", "verify"])
def test_help_lists_every_setting_with_type_default_and_unit(name):
    function = getattr(baker, name)
    text = pydoc.plain(pydoc.render_doc(function))
    model = getattr(baker, f"{name.capitalize()}Settings")
    assert issubclass(model, Settings)
    listed = getattr(keywords, f"{name.capitalize()}Keywords")
    assert list(listed.__annotations__) == list(model.model_fields)
    for setting, field in model.model_fields.items():
        assert f"        {setting} : " in text, setting
        assert f"default {field.default!r}" in " ".join(text.split())
    annotation = inspect.get_annotations(function)["keywords"]
    assert annotation == f"Unpack[{listed.__name__}]"


def test_settings_are_keywords_or_an_object_or_both():
    scene = baker.load(CORNELL)
    settings = baker.BakeSettings(samples=2, denoise=False, channels=("ao",), resolution=32)
    one = baker.bake(scene, settings)
    two = baker.bake(scene, samples=2, denoise=False, channels=["ao"], resolution=32)
    three = baker.bake(scene, settings.changed(samples=5), samples=2)
    assert one.settings == two.settings == three.settings == settings
    assert np.array_equal(one.lightmaps["ao"].value, two.lightmaps["ao"].value)
    with pytest.raises(baker.SettingsError, match="did you mean 'samples'"):
        baker.bake(scene, sampels=3)
    with pytest.raises(baker.SettingsError, match="`samples` should be"):
        baker.bake(scene, samples=0)
    with pytest.raises(baker.SettingsError, match="VerifySettings are no BakeSettings"):
        baker.bake(scene, baker.VerifySettings())


def test_an_atlas_is_used_as_it_is():
    scene = baker.load(CORNELL)
    atlas = baker.unwrap(scene, baker.UnwrapSettings(resolution=48, padding=3))
    result = baker.bake(scene, atlas=atlas, settings=baker.BakeSettings(samples=2, denoise=False))
    assert result.atlas is atlas
    assert (result.settings.resolution, result.settings.padding) == (48, 3)
    plain = baker.bake(scene, samples=2, denoise=False, resolution=48, padding=3)
    np.testing.assert_array_equal(plain.lightmaps["irradiance"].value, result.lightmaps["irradiance"].value)
    other = baker.load(ROOT / "assets" / "interior.glb")
    with pytest.raises(baker.SettingsError, match="another scene"):
        baker.bake(other, atlas=atlas)


def test_results_have_a_short_text_a_picture_and_plain_values(tmp_path):
    result = baker.ao(CORNELL, samples=2, denoise=False, resolution=32, out=tmp_path / "out")
    report = baker.check(CORNELL)
    for found, words in ((result, "ao mean"), (report, "passed yes")):
        assert words in repr(found)
        assert len(repr(found)) < 300
        assert "\n" not in repr(found)
        assert json.loads(json.dumps(found.to_dict(), allow_nan=False))
        assert "<table>" in found._repr_html_()
    assert "data:image/png;base64," in result._repr_html_()
    assert len(result._repr_html_()) < 200_000
    assert result.to_dict()["pages"] == json.loads((tmp_path / "out" / "bake.json").read_text())["pages"]


def test_what_is_made_on_the_way_has_a_short_text_too():
    scene = baker.load(CORNELL)
    atlas = baker.unwrap(scene, resolution=32)
    result = baker.bake(scene, atlas=atlas, samples=2, denoise=False)
    for found, words in (
        (scene, "objects 8, triangles 32"),
        (atlas, "pages 1 of 32 x 32, objects 8"),
        (result.lightmaps["irradiance"], "channel irradiance, unit lx, components R G B, pages 1 of 32 x 32"),
    ):
        assert words in repr(found)
        assert len(repr(found)) < 200
        assert "\n" not in repr(found)
        assert json.loads(json.dumps(found.to_dict(), allow_nan=False)) == found.to_dict()
        assert "<table>" in found._repr_html_()
    assert "data:image/png;base64," in result.lightmaps["ao"]._repr_html_()


def test_results_are_compared_by_identity_and_pickled(tmp_path):
    scene = baker.load(CORNELL)
    result = baker.bake(scene, resolution=32, samples=2, denoise=False)
    picture = baker.render(scene, width=8, height=6, spp=2)
    for found in (scene, result, result.atlas, result.lightmaps["ao"], picture):
        copy = pickle.loads(pickle.dumps(found))
        assert found == found
        assert found != copy
        assert len({found, copy}) == 2
        assert repr(copy) == repr(found)
    saved = baker.save(pickle.loads(pickle.dumps(result)), tmp_path / "out")
    report = baker.diff(saved, saved, texels=20)
    assert report != baker.diff(saved, saved, texels=20)
    assert report.channels["ao"] != pickle.loads(pickle.dumps(report)).channels["ao"]


def test_texts_are_escaped_and_thumbnails_are_png(tmp_path):
    import base64
    import io

    from PIL import Image

    path = tmp_path / "<b>&.glb"
    shutil.copy(CORNELL, path)
    page = baker.check(path)._repr_html_()
    assert "&lt;b&gt;&amp;.glb" in page
    assert "<b>&." not in page
    value = np.linspace(0, 1, 600 * 300, dtype=np.float32).reshape(300, 600)
    for picture, size in ((value, (200, 100)), (np.dstack([value] * 3), (200, 100)), (value[:5, :7], (7, 5))):
        data = base64.b64decode(picture_uri(picture).partition(",")[2])
        with Image.open(io.BytesIO(data)) as image:
            assert image.size == size
            shown = np.asarray(image)
        assert shown.shape[2] == 3
        assert shown.max() > 0
    step = value[::3, ::3]
    with Image.open(io.BytesIO(base64.b64decode(picture_uri(value).partition(",")[2]))) as image:
        np.testing.assert_array_equal(np.asarray(image)[..., 0], np.rint(step * 255).astype(np.uint8))


def test_progress_may_cancel():
    with pytest.raises(baker.Cancelled):
        baker.bake(CORNELL, resolution=32, progress=lambda *_: True)


def test_the_page_of_the_api_is_current():
    done = subprocess.run(
        [sys.executable, str(ROOT / "docs" / "make_api_page.py"), "--print"],
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    page = (ROOT / "docs" / "API.md").read_text("utf-8")
    assert page == done.stdout, "run docs/make_api_page.py"
    for name in FUNCTIONS:
        assert f"\n### {name}\n" in page


def test_examples_run(tmp_path, monkeypatch):
    """Run the examples of all functions in a fixed order, because later ones use results of earlier ones."""
    monkeypatch.chdir(tmp_path)
    shutil.copy(CORNELL, tmp_path / "cornell.glb")
    names = {"baker": baker}
    parser, runner = doctest.DocTestParser(), doctest.DocTestRunner()
    order = ("load", "check", "repair", "unwrap", "bake", "ao", "save", "export", "verify", "diff", "render")
    for name in (*order, "view", "batch"):
        text = inspect.getdoc(getattr(baker, name))
        assert ">>>" in text, name
        test = parser.get_doctest(text, names, f"baker.{name}", None, 0)
        runner.run(test, clear_globs=False)
        names = test.globs
    assert runner.summarize().failed == 0


WRONG_ARGUMENTS = [
    (lambda: baker.load(None), "`path` should be a scene file (was NoneType)"),
    (lambda: baker.load(CORNELL, scale=0), "`scale` should be greater than 0 (was 0)"),
    (lambda: baker.check(3), "`scene` should be a file or a baker.Scene (was int)"),
    (
        lambda: baker.check(CORNELL, bake={"resolution": 32}),
        "`bake` should be a baker.BakeSettings (was dict)",
    ),
    (lambda: baker.repair(baker.load(CORNELL)), "`scene` should be a scene file (was Scene)"),
    (lambda: baker.unwrap(str(CORNELL)), "`scene` should be a baker.Scene (was str); baker.load reads one"),
    (lambda: baker.bake(None), "`scene` should be a file or a baker.Scene (was NoneType)"),
    (
        lambda: baker.bake(CORNELL, atlas=3),
        "`atlas` should be a baker.Atlas (was int); baker.unwrap makes one",
    ),
    (lambda: baker.bake(CORNELL, out=3), "`out` should be a path (was int)"),
    (
        lambda: baker.bake(CORNELL, progress=3),
        "`progress` should be a function of stage, fraction and detail (was int)",
    ),
    (lambda: baker.ao([]), "`scene` should be a file or a baker.Scene (was list)"),
    (lambda: baker.save("out", "x"), "`bake` should be a baker.BakeResult (was str); baker.bake makes one"),
    (lambda: baker.export("out", ["godot"], "x"), "`engine` should be the name of one export (was list)"),
    (lambda: baker.verify(3), "`bake` should be an output folder or a baker.BakeResult (was int)"),
    (lambda: baker.diff("out", None), "`b` should be an output folder or a baker.BakeResult (was NoneType)"),
    (lambda: baker.render(None), "`scene` should be a file or a baker.Scene (was NoneType)"),
    (lambda: baker.view("out", port=70000), "`port` is no number from 0 to 65535 (was 70000)"),
    (lambda: baker.batch(["a"]), "`jobs_file` should be a path (was list)"),
]


@pytest.mark.parametrize(("call", "message"), WRONG_ARGUMENTS)
def test_an_argument_of_a_wrong_type_is_a_sentence(call, message):
    with pytest.raises(baker.SettingsError) as caught:
        call()
    assert caught.value.message == message


def test_errors_of_the_system_are_those_of_baker(tmp_path):
    (tmp_path / "out").mkdir()
    baker.ao(CORNELL, resolution=32, samples=2, denoise=False, out=tmp_path / "bake")
    (tmp_path / "file").write_text("x")
    with pytest.raises(baker.ResourceError) as caught:
        baker.export(tmp_path / "bake", "gltf", tmp_path / "file" / "below")
    assert isinstance(caught.value.__cause__, OSError)
