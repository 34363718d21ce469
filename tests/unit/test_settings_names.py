"""Messages of the library contain names of settings, never flags. The command line shows them as flags."""

from __future__ import annotations

import ast
import io
import re
from pathlib import Path

import numpy as np
import pytest

from baker.cli.failures import report
from baker.cli.flags import has_flag, in_flags, in_keys, values_in_flags
from baker.core.errors import SettingsError
from baker.core.settings import BakeSettings
from baker.rendering.settings import RenderSettings
from baker.verification.settings import VerifySettings

BAKER = Path(__file__).parents[2] / "baker"
FLAG = re.compile(r"(?<![\w-])--[a-z]")
# Texts with flags of other programs.
OTHERS = ("blender --python",)


def texts(path):
    """Yield (line, text) of the string literals of a file, without docstrings."""
    tree = ast.parse(path.read_text("utf-8"))
    docs = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef) and ast.get_docstring(node):
            docs.add(id(node.body[0].value))
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in docs:
            yield node.lineno, node.value


def flags_in(path):
    for line, text in texts(path):
        for other in OTHERS:
            text = text.replace(other, "")
        if FLAG.search(text):
            yield line, text


def test_no_text_of_the_library_names_a_flag():
    found = [
        f"{path.relative_to(BAKER)}:{line} {text}"
        for path in sorted(BAKER.rglob("*.py"))
        if "templates" not in path.parts
        for line, text in flags_in(path)
    ]
    assert found == []


def test_a_flag_in_a_text_is_seen(tmp_path):
    path = tmp_path / "a.py"
    path.write_text(
        '"""Of `--json`."""\nx = f"lower --resolution {1}"\ny = "a -- b"\nz = "blender --python x"\n'
    )
    assert [line for line, _ in flags_in(path)] == [2]


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("raise `resolution`", "raise --resolution"),
        ("bake with `denoise=False`", "bake with --no-denoise"),
        ("use `dtype='float'` or `exr_compression`", "use --dtype float or --exr-compression"),
        ("write elsewhere with `out`, or add `force=True`", "write elsewhere with -o, or add --force"),
        ("`camera='1,2,-3e2,0,0,0,45'`", "--camera 1,2,-3e2,0,0,0,45"),
        (
            "lights whose `range` ends, `three`, `pip install x`",
            "lights whose `range` ends, `three`, `pip install x`",
        ),
        ("name its folder with `three=PATH`", "name its folder with --three PATH"),
    ],
)
def test_settings_in_messages_become_flags(text, shown):
    assert in_flags(text) == shown
    assert values_in_flags({"a": [text, 1, None], "`seed`": {"b": (text,)}}) == {
        "a": [shown, 1, None],
        "`seed`": {"b": [shown]},
    }


def test_settings_in_messages_become_keys():
    assert in_keys("`max_depth` bounds paths; `range`") == "'max_depth' bounds paths; `range`"
    for name in ("resolution", "time_limit", "fail_on", "flip", "camera", "repair", "out"):
        assert has_flag(name)
    assert not has_flag("extras")


@pytest.mark.parametrize(
    ("model", "values", "words"),
    [
        (BakeSettings, {"resolution": 3}, ["`resolution`", "16", "(was 3)"]),
        (BakeSettings, {"resolutoin": 64}, ["did you mean 'resolution'"]),
        (BakeSettings, {"ao-distance": 1, "ao_distance": 2}, ["twice"]),
        (VerifySettings, {"texels": 0}, ["`texels`", "1"]),
        (RenderSettings, {"ao": True, "lightmap": "x"}, ["`ao` and `lightmap` exclude each other"]),
    ],
)
def test_a_wrong_setting_is_a_settings_error_that_names_it(model, values, words):
    with pytest.raises(SettingsError) as caught:
        model(**values)
    assert all(word in caught.value.message for word in words), caught.value.message
    with pytest.raises(SettingsError) as caught:
        model.make(values, file="a.toml")
    assert caught.value.file == "a.toml"


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"sky": "1,2"}, "`sky` is not three numbers R,G,B of zero or more, like 1,1,1 (was '1,2')"),
        ({"sky": 1e30}, "`sky` is above 1e+15 cd/m2 (was '1e+30')"),
        (
            {"ao_distance": -1},
            "`ao_distance` is not a positive number of metres, a percentage or inf (was '-1')",
        ),
        ({"rgbm_range": -1}, "`rgbm_range` is neither auto nor a number of lx above 0 (was '-1')"),
        ({"channels": ""}, "`channels` names nothing to bake"),
        ({"density": float("inf")}, "`density` should be a finite number (was inf)"),
        ({"scale": float("inf")}, "`scale` should be a finite number (was inf)"),
    ],
)
def test_a_value_out_of_range_is_named_once_as_setting_flag_or_key(values, message):
    with pytest.raises(SettingsError) as caught:
        BakeSettings(**values)
    assert (caught.value.message, caught.value.object) == (message, next(iter(values)))


def test_a_message_that_does_not_name_its_setting_gets_the_flag(capsys):
    error = SettingsError("there is no figure 'p96'", object="fail_if")
    report(error, as_json=False, traceback=False, out=io.StringIO())
    assert capsys.readouterr().err == "baker: --fail-if: there is no figure 'p96'\n"


def test_a_long_value_is_cut_in_the_message():
    with pytest.raises(SettingsError) as caught:
        BakeSettings(resolution="x" * 5000)
    assert len(caught.value.message) < 250
    assert caught.value.message.endswith("xxx...)")


def test_numbers_and_arrays_of_numpy_are_settings():
    settings = BakeSettings(sky=np.array([1, 2, 3.5]), ao_distance=np.float32(0.5), samples=np.int64(4))
    assert (settings.sky_radiance, settings.ao_reach(9.0), settings.samples) == ((1, 2, 3.5), 0.5, 4)
    camera = (0, 1, 3, 0, 1, 0, 50)
    assert RenderSettings(camera=camera).camera == RenderSettings(camera=np.array(camera)).camera
    assert (RenderSettings(camera=camera).camera, RenderSettings(camera=1).camera) == ("0,1,3,0,1,0,50", "1")
    with pytest.raises(SettingsError, match=r"`lightmap` is not a valid path \(was 3\)"):
        RenderSettings(lightmap=3)
    with pytest.raises(SettingsError, match="`sky` should be a valid string"):
        BakeSettings(sky=[[1, 2, 3]])


def test_changed_settings_are_checked():
    settings = VerifySettings(texels=5, spp=7)
    assert settings.changed(spp=8) == VerifySettings(texels=5, spp=8)
    assert (settings.seconds, VerifySettings().seconds) == (None, 40.0)
    assert VerifySettings(time_limit="inf").seconds is None
    with pytest.raises(SettingsError):
        settings.changed(spp=0)
    with pytest.raises(SettingsError, match=r"changed\(spp=...\) returns a copy"):
        settings.spp = 8
    assert settings.spp == 7
