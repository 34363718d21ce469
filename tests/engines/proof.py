"""Draws exports in the browser and checks the pixels."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from urllib.parse import urlencode

import numpy as np
from browser import need_modules, run, serve
from engine_scenes import MIDDLE, ROOM_RADIANCE, probe_expected

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


def shows_something_else(picture, rel=0.01):
    """Say whether a wrong export shows as wrong. A black picture shows nothing: the page would be broken."""
    return middles(picture).max() > 0.05 and not shows_the_probe(picture, rel=rel)


def shows_the_room(picture):
    """Say whether 99 of 100 pixels are right to 1 %: where walls meet, the bake itself is up to 4 % off."""
    miss = np.abs(picture / ROOM_RADIANCE - 1.0)
    return np.quantile(miss, 0.99) < 0.01 and miss.max() < 0.04


def changed(folder, target, name, right, wrong):
    """Copy an export and replace one piece of one of its files; return the copy."""
    shutil.copytree(folder, target)
    path = target / name
    text = path.read_text("utf-8")
    assert text.count(right) == 1, text.count(right)
    path.write_text(text.replace(right, wrong), "utf-8")
    return target


def lower_left_quarter(folder, target):
    """Copy an export and let the probe's first object read only the lower left quarter of its page."""
    shutil.copytree(folder, target)
    path = target / "lightmap.json"
    bake = json.loads(path.read_text("utf-8"))
    bake["objects"][0] |= {"uv_scale": [0.5, 0.5], "uv_offset": [0.0, 0.5]}
    path.write_text(json.dumps(bake), "utf-8")
    return target
