"""three.js in headless Chromium shows the export `three` as it should, and wrong exports as wrong."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from urllib.parse import urlencode

import numpy as np
import pytest
from browser import need_modules, run, serve
from engine_scenes import MIDDLE, QUADRANT, ROOM_RADIANCE, probe_expected, probe_page, write_probe

pytestmark = pytest.mark.engines
PAGES = Path(__file__).parent / "pages"


def draw(browser, folder, page="three", **query):
    """Return the picture (64, 64, 3) that a page draws of an export folder, row 0 on top."""
    with serve({"modules": need_modules(), "pages": PAGES, "bake": folder}) as address:
        url = f"{address}/pages/{page}.html?{urlencode({'folder': '/bake/', **query})}"
        result, troubles = run(browser, url)
    assert troubles == []
    return np.array(result, np.float64).reshape(64, 64, 4)[:, :, :3]


def middles(picture):
    return np.array([picture[int(y * 64), int(x * 64)] for y, x in MIDDLE])


def shows_the_probe(picture, expected=None, rel=0.01):
    expected = probe_expected() if expected is None else expected
    return np.allclose(middles(picture), expected, rtol=rel, atol=0)


def shows_the_room(picture):
    """Say whether 99 of 100 pixels are right to 1 %: where walls meet, the bake itself is up to 4 % off."""
    miss = np.abs(picture / ROOM_RADIANCE - 1.0)
    return np.quantile(miss, 0.99) < 0.01 and miss.max() < 0.04


def test_the_probe_is_shown_exactly(browser, probe):
    picture = draw(browser, probe / "three", camera="front")
    # Half floats and a linear lookup: far closer than the 1 % asked for.
    assert shows_the_probe(picture, rel=0.001), middles(picture)


def test_standard_materials_are_a_little_darker(browser, probe):
    picture = draw(browser, probe / "three", camera="front", options='{"matte": false}')
    ratio = middles(picture) / probe_expected()
    assert (ratio < 0.995).all(), ratio
    assert (ratio > 0.97).all(), ratio


def test_exposure_multiplies(browser, probe):
    picture = draw(browser, probe / "three", camera="front", options='{"exposure": 0.25}')
    assert shows_the_probe(picture, probe_expected() * 0.25, rel=0.001)


def test_a_room_of_known_radiosity(browser, room):
    """In a closed room of one colour radiance is L / (1 - albedo) everywhere, light and own glow together."""
    picture = draw(browser, room / "three", camera="inside")
    assert shows_the_room(picture)


def test_offset_and_scale_of_an_object_are_used(browser, probe, tmp_path):
    shutil.copytree(probe / "three", tmp_path / "part")
    path = tmp_path / "part" / "lightmap.json"
    bake = json.loads(path.read_text("utf-8"))
    # The lower right quarter of the page, on the whole square.
    bake["objects"][0] |= {"uv_scale": [0.5, 0.5], "uv_offset": [0.5, 0.5]}
    path.unlink()
    path.write_text(json.dumps(bake), "utf-8")
    picture = draw(browser, tmp_path / "part", camera="front")
    expected = probe_expected() / QUADRANT.ravel()[:, None] * QUADRANT[1, 1]
    assert shows_the_probe(picture, expected, rel=0.001), middles(picture)


@pytest.mark.parametrize(
    ("right", "wrong", "matte"),
    [
        ("scaleU, -scaleV", "scaleU, scaleV", True),
        ("texture.channel = 1", "texture.channel = 0", True),
        ("lit.lightMapIntensity = exposure", "lit.lightMapIntensity = exposure * Math.PI", True),
        ("lit.aoMap = null;", "", False),
    ],
    ids=["v not turned over", "channel 0", "pi", "ao twice"],
)
def test_a_wrong_export_fails(browser, probe, tmp_path, right, wrong, matte):
    shutil.copytree(probe / "three", tmp_path / "wrong")
    path = tmp_path / "wrong" / "lightmap.js"
    text = path.read_text("utf-8")
    assert text.count(right) == 1
    path.unlink()
    path.write_text(text.replace(right, wrong), "utf-8")
    options = json.dumps({"matte": matte})
    # Standard materials are up to 2 % off even when right.
    rel = 0.01 if matte else 0.03
    if not matte:
        assert shows_the_probe(draw(browser, probe / "three", camera="front", options=options), rel=rel)
    assert not shows_the_probe(draw(browser, tmp_path / "wrong", camera="front", options=options), rel=rel)


def test_srgb_numbers_in_the_pages_fail(browser, tmp_path):
    page = probe_page() / probe_page().max()
    page = (np.where(page > 0.0031308, 1.055 * page ** (1 / 2.4) - 0.055, 12.92 * page)) * probe_page().max()
    out = write_probe(tmp_path, "three", page=page.astype(np.float32))
    assert not shows_the_probe(draw(browser, out / "three", camera="front"))
