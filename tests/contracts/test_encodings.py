"""The contract of every encoding: decoding its files gives the values, within the stated tolerance."""

from __future__ import annotations

import hashlib

import numpy as np
import pytest
from PIL import Image

from baker.core.encoding import ENCODINGS, encoding_of, measure_loss
from baker.core.errors import InputError, ResourceError

HEADER = {"quantity": "irradiance", "unit": "lx"}
# {encoding: option values} to test in addition to the defaults.
OPTIONS = {
    "exr": [
        {"dtype": dtype, "exr_compression": method}
        for dtype in ("half", "float")
        for method in ("zip", "piz")
    ],
    "rgbm": [{"rgbm_range": top} for top in (0.5, 34.49, 20000.0)],
    "webp": [{"rgbm_range": top} for top in (0.5, 34.49)],
}
CASES = [
    pytest.param(name, number, options, id=f"{name}-{number}")
    for name in ENCODINGS.names()
    for number in ENCODINGS.get(name).components
    for options in (ENCODINGS.get(name).options_type(**values) for values in OPTIONS.get(name, [{}]))
]


def names_of(number):
    """Return the names of `number` components."""
    return {1: ("Y",), 3: ("R", "G", "B")}.get(number, tuple(f"layer.{k:02}" for k in range(number)))


def fitted(encoding, **values):
    """Return the options of an encoding, fitted to maps whose largest value is 1."""
    return encoding.fitted(encoding.options_type(**values), 1.0)


def image(encoding, options, number, height=23, width=70, seed=5):
    """Return pixels with zeros, tiny and random values, gradients, and the largest value of the encoding."""
    low, high = encoding.limits(options)
    high = min(high, 1e30)
    rng = np.random.default_rng(seed)
    pixels = high * 10.0 ** rng.uniform(-6, 0, (height, width, number))
    pixels[0] = 0.0
    pixels[1] = np.linspace(0.0, high, width)[:, None]
    pixels[2:5] = high * 10.0 ** np.linspace(-9, 0, width)[:, None]
    # Rows with light in one component only, and constant rows, which run-length coding compresses.
    pixels[5:9, :, 1:] = 0.0
    pixels[9:13] = 0.25 * high
    pixels[13, ::2] = high
    if low < 0:
        pixels[14] *= -1.0
    return np.clip(pixels, low, high).astype(np.float32)


@pytest.mark.parametrize("name", ENCODINGS.names())
def test_the_header_tells_the_size(tmp_path, name):
    encoding = ENCODINGS.get(name)
    path = tmp_path / f"a{encoding.suffix}"
    options = fitted(encoding)
    encoding.encode(path, image(encoding, options, encoding.components[0]), options=options, header=HEADER)
    assert encoding.size(path) == (70, 23)


@pytest.mark.parametrize(("name", "number", "options"), CASES)
def test_a_file_holds_every_value_within_the_stated_tolerance(tmp_path, name, number, options):
    encoding = ENCODINGS.get(name)
    pixels = image(encoding, options, number)
    path = tmp_path / f"a{encoding.suffix}"
    encoding.encode(path, pixels, options=options, header=HEADER, names=names_of(number))
    assert encoding_of(path.name) is encoding
    read = encoding.decode(path)
    assert read.pixels.dtype == np.float32
    assert read.channels == names_of(number)
    assert read.header["unit"] == "lx"
    assert read.header["quantity"] == "irradiance"
    miss = np.abs(read.pixels.astype(np.float64) - pixels)
    tolerance = encoding.tolerance(pixels, options)
    assert tolerance.shape == pixels.shape
    assert (miss <= tolerance).all(), (miss / np.maximum(tolerance, 1e-300)).max()
    assert np.array_equal(read.pixels, encoding.stored(pixels, options))
    # The tolerance is not too large: the error of some pixel is more than 0.4 times its tolerance.
    if tolerance.any():
        assert (miss > 0.4 * tolerance).any()


@pytest.mark.parametrize(("name", "number", "options"), CASES)
def test_zero_and_the_largest_value_are_kept(tmp_path, name, number, options):
    encoding = ENCODINGS.get(name)
    low, high = encoding.limits(options)
    assert low <= 0 < high
    pixels = np.zeros((9, 9, number), np.float32)
    pixels[4, 4] = high
    stored = encoding.stored(pixels, options)
    assert not stored[pixels == 0].any()
    assert stored[4, 4] == pytest.approx(np.float32(high), rel=1e-6)


@pytest.mark.parametrize(("name", "number", "options"), CASES)
def test_values_out_of_range_are_counted_and_clamped(tmp_path, name, number, options):
    encoding = ENCODINGS.get(name)
    low, high = encoding.limits(options)
    pixels = np.full((12, 12, number), 0.5 * min(high, 1e30), np.float32)
    pixels[0, 0, 0], pixels[7, 3] = np.inf, np.inf
    if low == 0:
        pixels[2, 2, 0] = -1.0
    loss = measure_loss(encoding, pixels, np.ones((12, 12), bool), options)
    assert loss.clipped == (3 if low == 0 else 2)
    encoding.encode(
        tmp_path / f"a{encoding.suffix}", pixels, options=options, header={}, names=names_of(number)
    )
    read = encoding.decode(tmp_path / f"a{encoding.suffix}").pixels
    assert np.isfinite(read).all()
    assert read.min() >= low
    assert read[7, 3] == pytest.approx(high, rel=1e-6)


@pytest.mark.parametrize(("name", "number", "options"), CASES)
def test_the_same_pixels_give_the_same_bytes(tmp_path, name, number, options):
    encoding = ENCODINGS.get(name)
    digests = set()
    for file in ("a", "b"):
        path = tmp_path / f"{file}{encoding.suffix}"
        encoding.encode(
            path, image(encoding, options, number), options=options, header=HEADER, names=names_of(number)
        )
        digests.add(hashlib.sha256(path.read_bytes()).hexdigest())
    assert len(digests) == 1


@pytest.mark.parametrize("name", ENCODINGS.names())
def test_odd_sizes(tmp_path, name):
    encoding = ENCODINGS.get(name)
    for shape in ((1, 1), (1, 7), (3, 8), (2, 129), (2, 300)):
        number = encoding.components[-1]
        pixels = np.random.default_rng(1).random((*shape, number), np.float32)
        pixels[0] = pixels[0, :1]
        path = tmp_path / f"{shape[1]}{encoding.suffix}"
        options = fitted(encoding)
        encoding.encode(path, pixels, options=options, header={}, names=names_of(number))
        assert np.array_equal(encoding.decode(path).pixels, encoding.stored(pixels, options))


@pytest.mark.parametrize("name", ENCODINGS.names())
def test_errors_are_sentences(tmp_path, name):
    encoding = ENCODINGS.get(name)
    path = tmp_path / f"a{encoding.suffix}"
    number = encoding.components[0]
    bad = np.ones((4, 5, number), np.float32)
    bad[2, 2] = np.nan
    with pytest.raises(ValueError, match="1 texels are not a number"):
        encoding.encode(path, bad, options=fitted(encoding), header={})
    with pytest.raises(ValueError, match="pixels of shape"):
        encoding.encode(path, np.ones((4, 5, 17), np.float32), options=fitted(encoding), header={})
    assert not path.exists()
    with pytest.raises(ResourceError, match="could not be written"):
        encoding.encode(
            tmp_path / "absent" / path.name,
            np.ones((4, 5, number), np.float32),
            options=fitted(encoding),
            header={},
        )
    with pytest.raises(InputError, match=r"no such file|cannot be read"):
        encoding.decode(path)
    path.write_bytes(b"hello")
    with pytest.raises(InputError, match="not a readable"):
        encoding.decode(path)
    pixels = np.random.default_rng(2).random((64, 64, number), np.float32)
    encoding.encode(path, pixels, options=fitted(encoding), header={})
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    with pytest.raises(InputError, match="not a readable"):
        encoding.decode(path)


def test_webp_and_png_hold_the_same_rgbm(tmp_path):
    pixels = image(ENCODINGS.get("rgbm"), fitted(ENCODINGS.get("rgbm")), 3)
    stored = []
    for name in ("rgbm", "webp"):
        encoding = ENCODINGS.get(name)
        path = tmp_path / f"a{encoding.suffix}"
        encoding.encode(path, pixels, options=fitted(encoding), header={})
        with Image.open(path) as picture:
            assert picture.mode == "RGBA"
            stored.append(np.asarray(picture))
        if name == "webp":
            assert b"VP8L" in path.read_bytes()[:64], "the lossless kind of WebP"
    assert np.array_equal(*stored)


def test_suffixes_tell_encodings_apart():
    suffixes = [ENCODINGS.get(name).suffix for name in ENCODINGS.names()]
    assert len(set(suffixes)) == len(suffixes)
    assert {"exr", "hdr", "ktx2", "rgbm", "png8", "png16", "webp"} <= set(ENCODINGS.names())
    assert encoding_of("a.png") is None
    assert encoding_of("A.RGBM.PNG") is ENCODINGS.get("rgbm")


def test_rgbm_by_hand(tmp_path):
    """a = ceil(255 m), rgb = root / a, where root = (value / top)^(1 / 2.2) and m is the largest root."""
    encoding = ENCODINGS.get("rgbm")
    encoding.encode(
        tmp_path / "a.rgbm.png",
        np.float32([[[8, 2, 0]]]),
        options=fitted(encoding, rgbm_range=34.49),
        header={},
    )
    with Image.open(tmp_path / "a.rgbm.png") as picture:
        red, green, blue, alpha = np.asarray(picture)[0, 0].tolist()
        assert (picture.text["top"], picture.text["gamma"]) == ("34.49", "2.2")
    root = [(v / 34.49) ** (1 / 2.2) for v in (8, 2)]
    assert alpha == np.ceil(root[0] * 255)
    assert red == round(root[0] * 255 * 255 / alpha)
    assert green == round(root[1] * 255 * 255 / alpha)
    assert blue == 0
    assert 34.49 * (red / 255 * alpha / 255) ** 2.2 == pytest.approx(8, rel=0.01)


def test_radiance_hdr_by_hand(tmp_path):
    """1.0 is stored as mantissa 128 and exponent 129; a row is four run-length coded planes."""
    encoding = ENCODINGS.get("hdr")
    encoding.encode(tmp_path / "a.hdr", np.ones((1, 10, 3), np.float32), options=fitted(encoding), header={})
    head, _, body = (tmp_path / "a.hdr").read_bytes().partition(b"-Y 1 +X 10\n")
    assert head.startswith(b"#?RADIANCE\n")
    assert b"FORMAT=32-bit_rle_rgbe\n" in head
    assert list(body) == [2, 2, 0, 10, 138, 128, 138, 128, 138, 128, 138, 129]


def test_banding_is_where_steps_show():
    surface = np.ones((64, 64), bool)
    ramp = np.linspace(0.02, 1.0, 64 * 64, dtype=np.float32).reshape(64, 64, 1)
    eight, sixteen = ENCODINGS.get("png8"), ENCODINGS.get("png16")
    # Half a step of 1/255 is more than 1 % of values below 0.196.
    loss = measure_loss(eight, ramp, surface, fitted(eight))
    wrong = np.abs(np.rint(ramp * 255) / 255 - ramp) > 0.01 * ramp
    assert loss.banded == int(wrong.sum()) > 300
    assert measure_loss(sixteen, ramp, surface, fitted(sixteen)).banded == 0
    # With an RGBM range far above the largest value, steps become visible; with range 1 they do not.
    light = np.repeat(ramp, 3, axis=2)
    rgbm = ENCODINGS.get("rgbm")
    assert measure_loss(rgbm, light, surface, fitted(rgbm, rgbm_range=1e6)).banded > 500
    assert measure_loss(rgbm, light, surface, fitted(rgbm, rgbm_range=1.0)).banded < 41
    # Texels off the surface, and nearly black texels, are not counted.
    assert measure_loss(rgbm, light, ~surface, fitted(rgbm, rgbm_range=1e6)).banded == 0
    light[:32] *= 1e-4
    assert measure_loss(rgbm, light, surface, fitted(rgbm, rgbm_range=1.0)).banded < 41
