"""Bake settings refuse invalid values with a clear message, and accept values such as `inf` and `10%`."""

from __future__ import annotations

import pytest

from baker.core.errors import SettingsError
from baker.core.settings import QUALITY_SAMPLES, BakeSettings, make_settings, parse_sky


@pytest.mark.parametrize(
    ("name", "near"),
    [
        ("resolutoin", "resolution"),
        ("ao-distanse", "ao_distance"),
        ("pading", "padding"),
        ("Samples", "samples"),
    ],
)
def test_an_unknown_name_brings_the_nearest(name, near):
    with pytest.raises(SettingsError, match=f"no setting '{name}'; did you mean '{near}'") as caught:
        make_settings({name: 1})
    assert caught.value.object == name
    assert caught.value.exit_code == 2


def test_a_name_like_no_other_brings_the_list():
    with pytest.raises(SettingsError) as caught:
        make_settings({"xyzzy": 1})
    assert all(name in caught.value.message for name in BakeSettings.model_fields)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("resolution", 15),
        ("resolution", 16385),
        ("resolution", "wide"),
        ("resolution", 512.5),
        ("density", 0),
        ("density", -1),
        ("max_pages", 0),
        ("max_pages", 257),
        ("padding", -1),
        ("padding", 65),
        ("uv", "maybe"),
        ("unwrapper", "blender"),
        ("quality", "best"),
        ("samples", 0),
        ("samples", 65537),
        ("light_samples", 0),
        ("ao_samples", 0),
        ("sky_strength", -0.1),
        ("sky_strength", float("inf")),
        ("sky", "1e16,0,0"),
        ("bounces", -1),
        ("bounces", 1001),
        ("dtype", "int"),
        ("up", "x"),
        ("scale", 0),
        ("seed", -1),
        ("seed", 2**31),
        ("threads", 0),
        ("threads", 1025),
        ("denoise", "perhaps"),
        ("channels", 5),
    ],
)
def test_a_value_out_of_range_is_named(name, value):
    with pytest.raises(SettingsError) as caught:
        make_settings({name: value})
    assert caught.value.object.startswith(name)
    assert str(value) in caught.value.message
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("resolution", 16),
        ("resolution", 16384),
        ("samples", 1),
        ("bounces", 0),
        ("seed", 2**31 - 1),
        ("sky_strength", 0),
        ("padding", 0),
        ("threads", 1024),
    ],
)
def test_the_ends_of_ranges_belong_to_them(name, value):
    assert getattr(make_settings({name: value}), name) == value


def test_dashes_and_lists():
    settings = make_settings(
        {"ao-distance": 2, "channels": "ao, irradiance ,", "max-pages": 3, "sky": [1, 0.5, 2]}
    )
    assert settings.ao_distance == "2"
    assert settings.channels == ("ao", "irradiance")
    assert settings.max_pages == 3
    assert settings.sky_radiance == (1.0, 0.5, 2.0)
    assert make_settings({"channels": ["ao"]}).channels == ("ao",)
    for nothing in ("", ",", []):
        with pytest.raises(SettingsError, match="nothing to bake"):
            make_settings({"channels": nothing})


def test_settings_do_not_change():
    settings = make_settings({})
    assert settings == BakeSettings()
    with pytest.raises(SettingsError):
        settings.resolution = 32


@pytest.mark.parametrize(
    ("text", "radiance"),
    [("1", (1, 1, 1)), ("1,2,3", (1, 2, 3)), (" 0 , 0.5 ,1e3", (0, 0.5, 1000)), ("0", (0, 0, 0))],
)
def test_sky(text, radiance):
    assert parse_sky(text) == radiance
    assert make_settings({"sky": text, "sky_strength": 2}).sky_radiance == tuple(2 * x for x in radiance)


@pytest.mark.parametrize(
    "text", ["", "1,2", "1,2,3,4", "red", "-1,0,0", "1,inf,1", "nan", "1,nan,1", "1;2;3", "-0.001"]
)
def test_no_sky(text):
    with pytest.raises(SettingsError, match=r"not three numbers R,G,B"):
        make_settings({"sky": text})


def test_without_a_sky_it_is_dark():
    assert make_settings({"sky_strength": 5}).sky_radiance == (0, 0, 0)
    assert make_settings({"sky": 2}).sky_radiance == (2, 2, 2)


@pytest.mark.parametrize(
    ("text", "reach"),
    [
        ("10%", 0.7),
        ("100 %", 7.0),
        ("0.5", 0.5),
        (" 3 ", 3.0),
        ("inf", float("inf")),
        (2, 2.0),
        (0.25, 0.25),
        ("1e-3", 1e-3),
    ],
)
def test_ao_distance(text, reach):
    assert make_settings({"ao_distance": text}).ao_reach(7.0) == pytest.approx(reach)


@pytest.mark.parametrize("text", ["0", "-1", "far", "", "%", "-5%", "0%", "nan", "nan%", "-inf", "5 m", 0])
def test_no_ao_distance(text):
    with pytest.raises(SettingsError, match="not a positive number of metres, a percentage or inf"):
        make_settings({"ao_distance": text})


def test_quality_sets_the_samples():
    for name, samples in QUALITY_SAMPLES.items():
        assert make_settings({"quality": name}).hemisphere_samples == samples
        assert make_settings({"quality": name, "samples": 7}).hemisphere_samples == 7
    assert list(QUALITY_SAMPLES.values()) == sorted(QUALITY_SAMPLES.values())
