"""PlayCanvas in headless Chromium draws the export `playcanvas` correctly. Changed exports look different."""

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

# Radiance HDR has 8 bits for the brightest colour, so the error is at most 1/256, and half floats add 1/2048.
REL = 1 / 256 + 1 / 2048


def test_the_probe_is_shown_exactly(browser, probe):
    picture = draw(browser, probe / "playcanvas", "playcanvas", camera="front")
    assert shows_the_probe(picture, rel=REL), middles(picture)


def test_exposure_multiplies(browser, probe):
    picture = draw(browser, probe / "playcanvas", "playcanvas", camera="front", options='{"exposure": 0.25}')
    assert shows_the_probe(picture, probe_expected() * 0.25, rel=REL), middles(picture)


def test_a_room_of_known_radiosity(browser, room):
    assert shows_the_room(draw(browser, room / "playcanvas", "playcanvas", camera="inside"))


def test_offset_and_scale_of_an_object_are_used(browser, probe, tmp_path):
    copy = lower_left_quarter(probe / "playcanvas", tmp_path / "part")
    picture = draw(browser, copy, "playcanvas", camera="front")
    expected = probe_expected() / QUADRANT.ravel()[:, None] * QUADRANT[1, 0]
    assert shows_the_probe(picture, expected, rel=REL), middles(picture)


@pytest.mark.parametrize(
    ("right", "wrong"),
    [
        ("lit.lightMapUv = 1", "lit.lightMapUv = 0"),
        ("exposure / Math.PI)", "exposure)"),
        ("new pc.Vec2(scaleU, scaleV)", "new pc.Vec2(scaleU, -scaleV)"),
    ],
    ids=["uv set 0", "no pi", "v turned over"],
)
def test_a_wrong_export_fails(browser, probe, tmp_path, right, wrong):
    copy = changed(probe / "playcanvas", tmp_path / "wrong", "lightmap.js", right, wrong)
    assert shows_something_else(draw(browser, copy, "playcanvas", camera="front"))


def test_srgb_numbers_in_the_pages_fail(browser, tmp_path):
    out = write_probe(tmp_path, "playcanvas", page=srgb_page())
    assert shows_something_else(draw(browser, out / "playcanvas", "playcanvas", camera="front"))


def test_instances_of_a_mesh_have_their_own_places(browser, tmp_path):
    out = write_shared_probe(tmp_path, "playcanvas")
    assert shows_the_squares(draw(browser, out / "playcanvas", "playcanvas", camera="front"), REL)
    right, wrong = "lit.lightMapTiling =", "lit.tiling ="
    copy = changed(out / "playcanvas", tmp_path / "wrong", "lightmap.js", right, wrong)
    assert not shows_the_squares(draw(browser, copy, "playcanvas", camera="front"), REL)
