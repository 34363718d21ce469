"""Draws exports in the browser, and compares their pixels with the expected colours."""

from __future__ import annotations

import json
import shutil
import struct
from pathlib import Path
from urllib.parse import urlencode

import numpy as np
from browser import need_modules, run, serve
from engine_scenes import ALBEDO, MIDDLE, ROOM_RADIANCE, probe_expected
from gltf_builder import pack_glb

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
    """Return whether 99 % of the pixels are within 1 % of the known radiance, and all within 4 %.
    The larger errors are at the edges of the room.
    """
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


def curve(linear):
    """Return the sRGB numbers of linear light, 0 to 1."""
    return np.where(linear > 0.0031308, 1.055 * linear ** (1 / 2.4) - 0.055, 12.92 * linear)


def light_in_codes(code, exposures, lowest, offset=0.0):
    """Return the light that 8-bit pictures of one scene show.

    Parameters
    ----------
    code : (E, ...) float64
        sRGB codes, one picture for each exposure.
    exposures : list of float
        Factor on the light in each picture.
    lowest : int
        The result is the mean over the pictures in which the code is between `lowest` and 250.
    offset : float
        A code c represents the light of (c + offset) / 255: 0 if the renderer rounds, 0.5 if it truncates.
    """
    level = (code + offset) / 255.0
    linear = np.where(level <= 0.04045, level / 12.92, ((level + 0.055) / 1.055) ** 2.4)
    good = (code >= lowest) & (code <= 250)
    factor = np.reshape(exposures, (-1,) + (1,) * (code.ndim - 1))
    return (linear / factor * good).sum(axis=0) / np.maximum(good.sum(axis=0), 1)


def edited(folder, target, edit):
    """Copy an export to `target`, call `edit` with the document of its scene.glb, and return the copy."""
    shutil.copytree(folder, target)
    path = target / "scene.glb"
    data = path.read_bytes()
    (length,) = struct.unpack_from("<I", data, 12)
    document = json.loads(data[20 : 20 + length])
    edit(document)
    # Replace the file instead of writing into it.
    path.unlink()
    path.write_bytes(pack_glb(document, data[28 + length :]))
    return target


def with_material(alpha=1.0, **members):
    """Return an edit of a probe's document that sets alpha and members of all materials."""

    def edit(document):
        for material in document["materials"]:
            material |= members
            material["pbrMetallicRoughness"]["baseColorFactor"] = [*ALBEDO, alpha]

    return edit
