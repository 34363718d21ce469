"""Other programs read the KTX2 pages: ktx-parse, and three.js and Babylon.js, which draw every texel."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

import numpy as np
import pytest
from browser import need_modules, need_program
from engine_scenes import ALBEDO, SIZE, write_probe
from proof import changed, draw

from baker.core.encoding import ENCODINGS
from baker.io.ktx2 import decode_ktx2

pytestmark = pytest.mark.engines
KTX2 = ENCODINGS.get("ktx2")
ENGINES = ["three", "babylon"]


def colourful_page():
    """Return a page of random colours, from dark to bright, often with one channel far below the others.

    The radiance stays below 30, to which materials of Babylon.js clamp their result.
    """
    rng = np.random.default_rng(9)
    brightness = 10.0 ** rng.uniform(-3.0, 2.0, (SIZE, SIZE, 1))
    return (brightness * rng.uniform(0.0, 1.0, (SIZE, SIZE, 3)) ** 3).astype(np.float32)


@pytest.fixture(scope="module")
def out(tmp_path_factory):
    folder = tmp_path_factory.mktemp("ktx2")
    return write_probe(folder, "three,babylon", page=colourful_page(), encode="ktx2")


def read(path):
    """Return what ktx-parse and zstddec find in a file."""
    script = Path(__file__).with_name("read_ktx2.mjs")
    done = subprocess.run(
        [need_program("node", "nodejs"), str(script), str(need_modules()), str(path)],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def test_ktx_parse_reads_and_rewrites_the_same_file(out):
    path = out / "irradiance_0.ktx2"
    found = read(path)
    # VK_FORMAT_E5B9G9R9_UFLOAT_PACK32 and Zstandard.
    assert (found["vkFormat"], found["typeSize"], found["supercompressionScheme"]) == (123, 4, 2)
    assert (found["pixelWidth"], found["pixelHeight"], found["pixelDepth"]) == (SIZE, SIZE, 0)
    assert (found["layerCount"], found["faceCount"], found["levels"], found["globalData"]) == (0, 1, 1, None)
    (description,) = found["dataFormatDescriptor"]
    # RGBSDA, BT709, linear; ktx-parse gives the dimensions of a texel block as they are stored, minus 1.
    assert [description[key] for key in ("colorModel", "colorPrimaries", "transferFunction")] == [1, 1, 1]
    assert description["texelBlockDimension"] == [0, 0, 0, 0]
    assert description["bytesPlane"] == [4, 0, 0, 0, 0, 0, 0, 0]
    assert [s["bitOffset"] for s in description["samples"]] == [0, 27, 9, 27, 18, 27]
    assert found["keyValue"]["KTXorientation"] == "rd"
    # ktx-parse reads values as text only under keys of Khronos.
    assert bytes(found["keyValue"]["unit"].values()) == b"lx\0"
    assert found["sameBytes"]
    assert np.array_equal(np.uint32(found["words"]).reshape(SIZE, SIZE), decode_ktx2(path)[0])


def right_picture():
    """Return albedo x E / pi of the page after encoding, (SIZE, SIZE, 3)."""
    return KTX2.stored(colourful_page(), KTX2.options_type()) * np.array(ALBEDO) / np.pi


def is_right(picture):
    """Return whether all pixels agree to a share of 1e-4, or 1e-6 of the brightest one."""
    right = right_picture()
    return np.allclose(picture, right, rtol=1e-4, atol=1e-6 * right.max())


@pytest.mark.parametrize("engine", ENGINES)
def test_every_texel_is_shown_as_it_was_encoded(browser, out, engine):
    picture = draw(browser, out / engine, engine, camera="front", ktx2="1")
    assert is_right(picture), np.abs(picture - right_picture()).max()
    # The page before encoding differs visibly from it, so the comparison notices an error of a step.
    assert not np.allclose(right_picture(), colourful_page() * np.array(ALBEDO) / np.pi, rtol=1e-3)


@pytest.mark.parametrize(
    ("engine", "right", "wrong"),
    [
        ("three", "topDown: Boolean(ktx2)", "topDown: false"),
        ("babylon", "zstd !== undefined", "false"),
        ("babylon", "texture.gammaSpace = false;\n  return", "texture.gammaSpace = true;\n  return"),
    ],
)
def test_a_wrong_export_fails(browser, out, tmp_path, engine, right, wrong):
    copy = changed(out / engine, tmp_path / "wrong", "lightmap.js", right, wrong)
    picture = draw(browser, copy, engine, camera="front", ktx2="1")
    assert picture.max() > 0.05
    assert not is_right(picture)


@pytest.mark.parametrize("engine", ENGINES)
def test_channels_in_another_order_fail(browser, tmp_path, engine):
    swapped = colourful_page()[:, :, ::-1].copy()
    out = write_probe(tmp_path, engine, page=swapped, encode="ktx2")
    assert not is_right(draw(browser, out / engine, engine, camera="front", ktx2="1"))


@pytest.mark.parametrize("engine", ENGINES)
def test_without_ktx2_pages_the_error_names_the_flag(browser, probe, engine):
    with pytest.raises(AssertionError, match="no KTX2 pages; bake with --encode ktx2"):
        draw(browser, probe / engine, engine, camera="front", ktx2="1")
