"""ktx-parse reads KTX2 pages. three.js and Babylon.js draw every texel of KTX2 and WebP pages."""

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
EACH = pytest.mark.parametrize("encoding", ["ktx2", "webp"])
IN_EACH_ENGINE = pytest.mark.parametrize("engine", ["three", "babylon"])


def colourful_page():
    """Return a page of random colours, from dark to bright, often with one channel far below the others.

    The radiance stays below 30, to which materials of Babylon.js clamp their result.
    """
    rng = np.random.default_rng(9)
    brightness = 10.0 ** rng.uniform(-3.0, 2.0, (SIZE, SIZE, 1))
    return (brightness * rng.uniform(0.0, 1.0, (SIZE, SIZE, 3)) ** 3).astype(np.float32)


@pytest.fixture(scope="module")
def out(tmp_path_factory):
    folder = tmp_path_factory.mktemp("web")
    return write_probe(folder, "three,babylon", page=colourful_page(), encode="ktx2,webp")


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


def right_picture(encoding):
    """Return albedo x E / pi of the page after encoding, (SIZE, SIZE, 3)."""
    plugin = ENCODINGS.get(encoding)
    page = colourful_page()
    stored = plugin.stored(page, plugin.fitted(plugin.options_type(), float(page.max())))
    return stored * np.array(ALBEDO) / np.pi


def is_right(picture, encoding):
    """Return whether all pixels agree up to the rounding of the texture on the graphics card.

    RGB9E5 texels are not rounded. RGBM is decoded to half floats, whose error is 2^-11, or 2^-25 for small
    numbers.
    """
    rel, least = {"ktx2": (1e-4, 1e-9), "webp": (2.0**-11 + 1e-4, 2.0**-25)}[encoding]
    return np.allclose(picture, right_picture(encoding), rtol=rel, atol=least)


def drawn(browser, folder, engine, encoding):
    return draw(browser, folder, engine, camera="front", encoding=encoding)


@EACH
@IN_EACH_ENGINE
def test_every_texel_is_shown_as_it_was_encoded(browser, out, engine, encoding):
    picture = drawn(browser, out / engine, engine, encoding)
    assert is_right(picture, encoding), np.abs(picture - right_picture(encoding)).max()
    # The page before encoding fails, so the comparison notices an error of a step.
    assert not is_right(colourful_page() * np.array(ALBEDO) / np.pi, encoding)


@pytest.mark.parametrize(
    ("engine", "encoding", "right", "wrong"),
    [
        ("three", "ktx2", "options.ktx2 || options.webp", "false"),
        ("three", "webp", "options.ktx2 || options.webp", "false"),
        ("three", "webp", "encoded.max", "1.01 * encoded.max"),
        ("babylon", "ktx2", "options.zstd || options.webp", "false"),
        ("babylon", "webp", "options.zstd || options.webp", "false"),
        ("babylon", "ktx2", "texture.gammaSpace = false;\n  return", "texture.gammaSpace = true;\n  return"),
    ],
)
def test_a_wrong_export_fails(browser, out, tmp_path, engine, encoding, right, wrong):
    copy = changed(out / engine, tmp_path / "wrong", "lightmap.js", right, wrong)
    picture = drawn(browser, copy, engine, encoding)
    assert picture.max() > 0.05
    assert not is_right(picture, encoding)


@pytest.mark.parametrize(
    ("right", "wrong"),
    [("premultiplyAlpha: 'none'", "premultiplyAlpha: 'premultiply'"), ("** 2.2", "** 2.19")],
)
def test_a_wrong_reader_of_rgbm_fails(browser, out, tmp_path, right, wrong):
    copy = changed(out / "three", tmp_path / "wrong", "rgbm.js", right, wrong)
    assert not is_right(drawn(browser, copy, "three", "webp"), "webp")


@EACH
def test_channels_in_another_order_fail(browser, tmp_path, encoding):
    swapped = colourful_page()[:, :, ::-1].copy()
    out = write_probe(tmp_path, "three", page=swapped, encode=encoding)
    assert not is_right(drawn(browser, out / "three", "three", encoding), encoding)


@EACH
@IN_EACH_ENGINE
def test_without_such_pages_the_error_names_the_flag(browser, probe, engine, encoding):
    with pytest.raises(AssertionError, match=f"bake with --encode {encoding}"):
        drawn(browser, probe / engine, engine, encoding)
