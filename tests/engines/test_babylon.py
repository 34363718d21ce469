"""Babylon.js in headless Chromium draws the export `babylon` correctly, and changed exports incorrectly."""

from __future__ import annotations

import pytest
from engine_scenes import QUADRANT, probe_expected, srgb_page, write_probe
from proof import (
    changed,
    draw,
    lower_left_quarter,
    middles,
    shows_something_else,
    shows_the_probe,
    shows_the_room,
)
from shared_probe import shows_the_squares, write_shared_probe

pytestmark = pytest.mark.engines


def test_the_probe_is_shown_exactly(browser, probe):
    picture = draw(browser, probe / "babylon", "babylon", camera="front")
    assert shows_the_probe(picture, rel=0.001), middles(picture)


def test_exposure_multiplies(browser, probe):
    picture = draw(browser, probe / "babylon", "babylon", camera="front", options='{"exposure": 0.25}')
    assert shows_the_probe(picture, probe_expected() * 0.25, rel=0.001), middles(picture)


def test_piz_pages_need_no_other_library(browser, tmp_path):
    out = write_probe(tmp_path, "babylon", exr_compression="piz")
    picture = draw(browser, out / "babylon", "babylon", camera="front", options='{"fflate": "/nowhere.js"}')
    assert shows_the_probe(picture, rel=0.001), middles(picture)


def test_a_room_of_known_radiosity(browser, room):
    assert shows_the_room(draw(browser, room / "babylon", "babylon", camera="inside"))


def test_offset_and_scale_of_an_object_are_used(browser, probe, tmp_path):
    copy = lower_left_quarter(probe / "babylon", tmp_path / "part")
    picture = draw(browser, copy, "babylon", camera="front")
    expected = probe_expected() / QUADRANT.ravel()[:, None] * QUADRANT[1, 0]
    assert shows_the_probe(picture, expected, rel=0.001), middles(picture)


@pytest.mark.parametrize(
    ("right", "wrong"),
    [
        (": -object.uv_scale[1]", ": object.uv_scale[1]"),
        ("texture.coordinatesIndex = 1", "texture.coordinatesIndex = 0"),
        ("(options.exposure ?? 1) / Math.PI", "options.exposure ?? 1"),
        ("texture.gammaSpace = false; resolve", "texture.gammaSpace = true; resolve"),
        ("lit.useLightmapAsShadowmap = true", "lit.useLightmapAsShadowmap = false"),
    ],
    ids=["v not turned over", "channel 0", "no pi", "srgb", "added"],
)
def test_a_wrong_export_fails(browser, probe, tmp_path, right, wrong):
    copy = changed(probe / "babylon", tmp_path / "wrong", "lightmap.js", right, wrong)
    assert shows_something_else(draw(browser, copy, "babylon", camera="front"))


def test_srgb_numbers_in_the_pages_fail(browser, tmp_path):
    out = write_probe(tmp_path, "babylon", page=srgb_page())
    assert shows_something_else(draw(browser, out / "babylon", "babylon", camera="front"))


def test_instances_of_a_mesh_have_their_own_places(browser, tmp_path):
    out = write_shared_probe(tmp_path, "babylon")
    assert shows_the_squares(draw(browser, out / "babylon", "babylon", camera="front"))
    right, wrong = "createInstances = false", "createInstances = true"
    copy = changed(out / "babylon", tmp_path / "wrong", "lightmap.js", right, wrong)
    # Babylon.js reports that an instance cannot have a material of its own.
    with pytest.raises(AssertionError):
        draw(browser, copy, "babylon", camera="front")
