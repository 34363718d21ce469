"""three.js draws the export `unlit` correctly, without code of `baker`."""

from __future__ import annotations

import json

import numpy as np
import pytest
from engine_scenes import QUADRANT, ROOM_RADIANCE, probe_expected, srgb_page, write_probe
from proof import curve, draw, middles, shows_something_else

pytestmark = pytest.mark.engines


def exposure_of(folder):
    return json.loads((folder / "lightmap.json").read_text("utf-8"))["exposure"]


def test_the_probe_is_shown(browser, probe):
    """Textures have 8 bits after the sRGB curve, so the error is at most half a step of that encoding."""
    folder = probe / "unlit"
    exposure = exposure_of(folder)
    picture = middles(draw(browser, folder, camera="front", plain=1))
    miss = np.abs(curve(picture) - curve(probe_expected() * exposure))
    assert miss.max() <= 0.51 / 255, picture
    # For bright values half a step is less than 1 %.
    bright = probe_expected() > 0.3
    assert picture[bright] / exposure == pytest.approx(probe_expected()[bright], rel=0.01)
    # The exposure maps the red channel of the brightest quadrant to 1.
    assert exposure == pytest.approx(1.0 / probe_expected().max(), rel=1e-3)


def test_a_room_of_known_radiosity(browser, room):
    folder = room / "unlit"
    picture = draw(browser, folder, camera="inside", plain=1) / exposure_of(folder)
    miss = np.abs(picture / ROOM_RADIANCE - 1.0)
    # Up to 1 % of the pixels have larger errors, because the bake has errors at chart borders and texels that
    # are brighter than white are clipped.
    assert np.quantile(miss, 0.99) < 0.01
    assert miss.max() < 0.04


def test_numbers_with_a_curve_fail(browser, tmp_path):
    folder = write_probe(tmp_path, "unlit", page=srgb_page()) / "unlit"
    picture = draw(browser, folder, camera="front", plain=1) / exposure_of(folder)
    assert shows_something_else(picture)


def test_without_the_exposure_it_is_another_picture(browser, probe):
    picture = draw(browser, probe / "unlit", camera="front", plain=1)
    assert shows_something_else(picture)
    assert middles(picture)[:, 0] == pytest.approx(QUADRANT.ravel() / 2.0, rel=0.01)
