"""Scenes without light: the values that are baked, and the warnings before the bake."""

from __future__ import annotations

from dataclasses import replace

import pytest
from flawed_scenes import CASES

from baker.checks.context import CheckContext
from baker.checks.rules.light_sources import no_light
from baker.core.progress import notify, silent
from baker.core.settings import BakeSettings
from baker.io.load import load_scene
from baker.pipeline.no_light import fit_to_light


@pytest.fixture
def dark(tmp_path):
    return loaded(tmp_path, CASES["no-light"].bad)


@pytest.fixture
def lit(tmp_path):
    return loaded(tmp_path, CASES["no-light"].good)


def loaded(folder, data):
    path = folder / "scene.glb"
    path.write_bytes(data)
    return load_scene(path)


def chosen(scene, **values):
    settings, warning = fit_to_light(scene, BakeSettings(**values))
    return settings.channels, None if warning is None else warning.message


def test_ambient_occlusion_alone_is_baked_by_default(dark):
    channels, message = chosen(dark, resolution=64)
    assert channels == ("ao",)
    assert message.startswith("nothing emits light, so only ao is baked")
    assert all(way in message for way in ("emissive", "lights", "`sky`"))


@pytest.mark.parametrize(
    "values",
    [
        {"channels": ("irradiance", "ao")},
        {"channels": "irradiance"},
        {"export": "three"},
        {"encode": "rgbm"},
    ],
)
def test_light_that_was_asked_for_is_baked_black(dark, values):
    channels, message = chosen(dark, **values)
    assert "irradiance" in channels
    assert message.startswith("nothing emits light, so the maps of light are black")


@pytest.mark.parametrize("values", [{"sky": "1,1,1"}, {"channels": "ao"}])
def test_nothing_is_said_about_a_sky_or_ambient_occlusion(dark, values):
    settings = BakeSettings(**values)
    assert fit_to_light(dark, settings) == (settings, None)


def test_nothing_is_said_about_a_scene_with_light(dark, lit):
    assert chosen(lit) == (("irradiance", "ao"), None)
    emissive = replace(dark, materials=tuple(replace(m, emission=(1.0, 0.0, 0.0)) for m in dark.materials))
    assert chosen(emissive) == (("irradiance", "ao"), None)
    assert chosen(dark, sky="1", sky_strength=0.0)[0] == ("ao",)


def test_the_check_says_what_a_bake_would_do(dark):
    (found,) = no_light(CheckContext(dark, BakeSettings()))
    assert "ambient occlusion only" in found.message
    (found,) = no_light(CheckContext(dark, BakeSettings(channels="irradiance")))
    assert "black" in found.message


def test_a_message_reaches_callbacks_that_take_messages():
    class Callback:
        said = ()

        def __call__(self, stage, fraction, detail="", /):
            return None

        def note(self, message):
            self.said = (message,)

    callback = Callback()
    notify(callback, "x")
    notify(silent, "x")
    assert callback.said == ("x",)
    assert BakeSettings(seed=3).changed(samples=4).model_fields_set == {"seed", "samples"}
