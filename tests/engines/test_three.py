"""three.js in headless Chromium draws the export `three` correctly, and changed exports incorrectly."""

from __future__ import annotations

import io
import json
import re
from pathlib import Path

import numpy as np
import pytest
from browser import need_modules, page_at, serve
from engine_scenes import QUADRANT, probe_expected, srgb_page, write_probe
from PIL import Image
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
    picture = draw(browser, probe / "three", camera="front")
    # With half floats and linear output, the error is far below the required 1 %.
    assert shows_the_probe(picture, rel=0.001), middles(picture)


def test_standard_materials_are_a_little_darker(browser, probe):
    picture = draw(browser, probe / "three", camera="front", options='{"matte": false}')
    ratio = middles(picture) / probe_expected()
    assert (ratio < 0.995).all(), ratio
    assert (ratio > 0.97).all(), ratio


def test_exposure_multiplies(browser, probe):
    picture = draw(browser, probe / "three", camera="front", options='{"exposure": 0.25}')
    assert shows_the_probe(picture, probe_expected() * 0.25, rel=0.001)


def test_the_page_of_the_docs_shows_a_bake(browser, probe, tmp_path):
    text = (Path(__file__).parents[2] / "docs" / "engines" / "three.md").read_text("utf-8")
    (found,) = re.findall(r"```html\n(<!doctype html>.*?)```", text, re.DOTALL)
    (tmp_path / "index.html").write_text(found.replace('"./', '"/').replace("'./", "'/"))
    with (
        serve({"page": tmp_path, "out": probe, "node_modules": need_modules()}) as address,
        page_at(browser, f"{address}/page/index.html") as (page, troubles),
    ):
        page.wait_for_selector("canvas")
        levels = np.zeros(1)
        for _ in range(20):
            picture = np.asarray(Image.open(io.BytesIO(page.screenshot())).convert("L"))
            levels = np.unique(picture[60:-60, 60:-60])
            if len(levels) > 3:
                break
            page.wait_for_timeout(500)
    assert troubles == []
    assert len(levels) > 3, "the page stays empty"


def test_a_room_of_known_radiosity(browser, room):
    """In a closed room of one material with emission L, the radiance is L / (1 - albedo) everywhere."""
    picture = draw(browser, room / "three", camera="inside")
    assert shows_the_room(picture)


def test_offset_and_scale_of_an_object_are_used(browser, probe, tmp_path):
    copy = lower_left_quarter(probe / "three", tmp_path / "part")
    picture = draw(browser, copy, camera="front")
    expected = probe_expected() / QUADRANT.ravel()[:, None] * QUADRANT[1, 0]
    assert shows_the_probe(picture, expected, rel=0.001), middles(picture)


@pytest.mark.parametrize(
    ("right", "wrong", "matte"),
    [
        ("topDown ? scaleV : -scaleV", "scaleV", True),
        ("texture.channel = 1", "texture.channel = 0", True),
        ("lit.lightMapIntensity = exposure", "lit.lightMapIntensity = exposure * Math.PI", True),
        ("lit.aoMap = null;", "", False),
    ],
    ids=["v not turned over", "channel 0", "pi", "ao twice"],
)
def test_a_wrong_export_fails(browser, probe, tmp_path, right, wrong, matte):
    copy = changed(probe / "three", tmp_path / "wrong", "lightmap.js", right, wrong)
    options = json.dumps({"matte": matte})
    # Correct pictures of standard materials differ from the expected colours by up to 2 %, because these
    # materials also reflect specularly.
    rel = 0.01 if matte else 0.03
    if not matte:
        assert shows_the_probe(draw(browser, probe / "three", camera="front", options=options), rel=rel)
    assert shows_something_else(draw(browser, copy, camera="front", options=options), rel=rel)


def test_srgb_numbers_in_the_pages_fail(browser, tmp_path):
    out = write_probe(tmp_path, "three", page=srgb_page())
    assert shows_something_else(draw(browser, out / "three", camera="front"))


@pytest.mark.parametrize("ao", [False, True])
def test_instances_of_a_mesh_have_their_own_places(browser, tmp_path, ao):
    out = write_shared_probe(tmp_path, "three", ao=ao)
    assert shows_the_squares(draw(browser, out / "three", camera="front"))
    wrong = changed(out / "three", tmp_path / "wrong", "lightmap.js", "offset.set(offsetU", "offset.set(0")
    assert not shows_the_squares(draw(browser, wrong, camera="front"))
