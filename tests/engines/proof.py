"""Draws exports in the browser, and compares their pixels with the expected colours."""

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
    """Return the (64, 64, 3) picture of an export folder that an HTML page draws, row 0 on top."""
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
    """Return whether the pixels are wrong but not all black; an all-black picture means a failed page."""
    return middles(picture).max() > 0.05 and not shows_the_probe(picture, rel=rel)


def shows_the_room(picture):
    """Return whether 99 % of the pixels differ by less than 1 %, and all by less than 4 % (room edges)."""
    miss = np.abs(picture / ROOM_RADIANCE - 1.0)
    return np.quantile(miss, 0.99) < 0.01 and miss.max() < 0.04


def changed(folder, target, name, right, wrong):
    """Copy an export to `target`, replace `right` by `wrong` in the file `name`, and return the copy."""
    shutil.copytree(folder, target)
    path = target / name
    text = path.read_text("utf-8")
    assert text.count(right) == 1, text.count(right)
    path.write_text(text.replace(right, wrong), "utf-8")
    return target


def lower_left_quarter(folder, target):
    """Copy an export and change the probe's first object to use only the lower left quarter of its page."""
    shutil.copytree(folder, target)
    path = target / "lightmap.json"
    bake = json.loads(path.read_text("utf-8"))
    bake["objects"][0] |= {"uv_scale": [0.5, 0.5], "uv_offset": [0.0, 0.5]}
    path.write_text(json.dumps(bake), "utf-8")
    return target
