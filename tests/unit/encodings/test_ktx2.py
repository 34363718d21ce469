"""KTX2: the conversion of EXT_texture_shared_exponent, the Khronos layout, and damaged files."""

from __future__ import annotations

import math
import struct
from fractions import Fraction

import numpy as np
import pytest

from baker.core.encoding import ENCODINGS
from baker.core.errors import InputError
from baker.io.ktx2 import _zstandard, decode_ktx2, encode_ktx2

KTX2 = ENCODINGS.get("ktx2")
OPTIONS = KTX2.options_type()
LARGEST = 65408.0


def stored(*colour):
    """Return a colour after encoding and decoding, as three Python floats."""
    return KTX2.stored(np.float32([[colour]]), OPTIONS)[0, 0].tolist()


def words(tmp_path, *colours):
    """Return the 32-bit words of a file of one row, as (red, green, blue, exponent)."""
    KTX2.encode(tmp_path / "a.ktx2", np.float32([colours]), options=OPTIONS, header={})
    code, _ = decode_ktx2(tmp_path / "a.ktx2")
    return [(w & 511, w >> 9 & 511, w >> 18 & 511, w >> 27) for w in code[0].tolist()]


def extension(colour):
    """Return the formula of EXT_texture_shared_exponent for one colour, in exact arithmetic."""
    n, bias = 9, 15
    clamped = [max(Fraction(0), min(Fraction(c), Fraction(LARGEST))) for c in colour]
    brightest = max(clamped)
    log = -math.inf
    if brightest:
        log = brightest.numerator.bit_length() - brightest.denominator.bit_length()
        log -= Fraction(2) ** log > brightest
    exponent = max(-bias - 1, log) + 1 + bias
    whole = math.floor(brightest / Fraction(2) ** (exponent - bias - n) + Fraction(1, 2))
    exponent += whole == 2**n
    step = Fraction(2) ** (exponent - bias - n)
    return (*(math.floor(c / step + Fraction(1, 2)) for c in clamped), exponent)


def test_words_by_hand(tmp_path):
    assert words(
        tmp_path,
        (1.0, 0.5, 0.25),
        (LARGEST, LARGEST, LARGEST),
        (0.0, 0.0, 0.0),
        (2.0**-24, 0.0, 0.0),
        # Half of the smallest step is rounded up, less than half is rounded down.
        (2.0**-25, 0.49 * 2.0**-24, 0.0),
        # 511.5 of 512 is rounded to the next exponent, 511.4 is not.
        (511.5 / 512.0, 0.0, 0.0),
        (511.4 / 512.0, 0.0, 0.0),
        # Clamped: negative and too large.
        (-3.0, 1e9, 0.0),
    ) == [
        (256, 128, 64, 16),
        (511, 511, 511, 31),
        (0, 0, 0, 0),
        (1, 0, 0, 0),
        (1, 0, 0, 0),
        (256, 0, 0, 16),
        (511, 0, 0, 15),
        (0, 511, 0, 31),
    ]


def test_every_exponent_agrees_with_the_formula_of_the_extension(tmp_path):
    rng = np.random.default_rng(3)
    power = np.float32(2.0) ** np.arange(-30, 18, dtype=np.float32)
    near = np.float32([1.0, 1.0 - 2.0**-24, 511.5 / 512, 511.499 / 512, 1.001953125, 1.5])
    red = (power[:, None] * near).ravel()
    colours = np.stack([red, red * rng.random(len(red), np.float32), red * 0.003], axis=-1)
    colours = np.concatenate([colours, colours[:, ::-1], colours[:, [1, 0, 2]]]).astype(np.float32)
    assert words(tmp_path, *colours.tolist()) == [extension(c) for c in colours.tolist()]


def test_what_can_be_stored_stays(tmp_path):
    mantissa = np.random.default_rng(4).integers(256, 512, (32, 50, 3))
    value = (mantissa * 2.0 ** (np.arange(32)[:, None, None] - 24.0)).astype(np.float32)
    assert np.array_equal(KTX2.stored(value, OPTIONS), value)


@pytest.mark.parametrize("dark", [0, 1, 2])
def test_the_error_is_uniform_within_half_a_step(dark):
    """Errors in steps of the mantissa have mean 0 and deviation 1 / sqrt(12), in bright and dark channels."""
    rng = np.random.default_rng(dark)
    n = 40000
    bright = rng.uniform(256.0, 511.0, n)
    exponent = rng.integers(1, 31, n)
    pixels = np.empty((1, n, 3))
    pixels[0] = bright[:, None]
    pixels[0, :, dark] = rng.uniform(0.5, 40.0, n)
    step = 2.0 ** (exponent - 24.0)
    pixels = (pixels * step[:, None]).astype(np.float32)
    miss = (KTX2.stored(pixels, OPTIONS) - pixels.astype(np.float64))[0] / step[:, None]
    assert np.abs(miss).max() <= 0.5
    # Mean and mean square have the standard deviations 0.0014 and 0.0004; the limits are 5 of them.
    assert np.abs(miss.mean(axis=0)).max() < 0.0072
    assert np.abs((miss**2).mean(axis=0) - 1.0 / 12.0).max() < 0.002


def test_a_dark_channel_beside_a_bright_one_loses_its_digits():
    red, green, blue = stored(1000.0, 1.0, 0.9)
    # With 1000 the step is 2, so 1 is rounded up to 2 and 0.9 down to 0.
    assert (red, green, blue) == (1000.0, 2.0, 0.0)
    assert KTX2.tolerance(np.float32([[[1000.0, 1.0, 0.9]]]), OPTIONS).max() == pytest.approx(1000 / 511.5)


def test_the_layout_is_that_of_the_specification():
    text = {"unit": "lx", "quantity": "irradiance"}
    data = encode_ktx2(np.uint32([[1, 2, 3], [4, 5, 6]]), text, "baker test")
    assert data[:12] == bytes.fromhex("AB4B5458203230BB0D0A1A0A")
    # Format 123, words of 4 bytes, 3 x 2 x 0, no layers, one face, one level, Zstandard.
    assert struct.unpack_from("<9I", data, 12) == (123, 4, 3, 2, 0, 0, 1, 1, 2)
    format_at, format_size, text_at, text_size, *global_data = struct.unpack_from("<4I2Q", data, 48)
    at, size, raw_size = struct.unpack_from("<3Q", data, 80)
    assert (format_at, format_size) == (104, 4 + 24 + 6 * 16)
    assert text_at == format_at + format_size
    assert global_data == [0, 0]
    # Compressed levels need no alignment; the texts before them end at a multiple of four.
    assert at == text_at + text_size
    assert text_size % 4 == 0
    assert at + size == len(data)
    raw = _zstandard().decompress(data[at:])
    assert raw_size == len(raw) == 24
    assert struct.unpack("<6I", raw) == (1, 2, 3, 4, 5, 6)
    keys, at = [], text_at
    while at < text_at + text_size:
        (length,) = struct.unpack_from("<I", data, at)
        keys.append(data[at + 4 : at + 4 + length])
        at += 4 + length + -length % 4
    assert keys == [
        b"KTXorientation\0rd\0", b"KTXwriter\0baker test\0", b"quantity\0irradiance\0", b"unit\0lx\0"
    ]  # fmt: skip


def test_the_data_format_descriptor_is_that_of_khronos():
    """The words that dfdutils of KTX-Software makes for VK_FORMAT_E5B9G9R9_UFLOAT_PACK32."""
    data = encode_ktx2(np.uint32([[0]]), {}, "baker")
    found = struct.unpack_from("<31I", data, 104)
    samples = []
    for channel in range(3):
        samples += [channel << 24 | 8 << 16 | 9 * channel, 0, 0, 8448]
        samples += [(0x20 | channel) << 24 | 4 << 16 | 27, 0, 15, 31]
    # Size; vendor and type 0; block size and version 2; linear, BT709, RGBSDA; texel block; bytes of plane 0.
    assert found == (124, 0, 120 << 16 | 2, 1 << 16 | 1 << 8 | 1, 0, 4, 0, *samples)


def changed(data, offset, form, value):
    """Return data with one number replaced."""
    return data[:offset] + struct.pack(form, value) + data[offset + struct.calcsize(form) :]


@pytest.mark.parametrize(
    ("offset", "form", "value", "why"),
    [
        (12, "<I", 97, "its format is 97"),
        (20, "<I", 0, "its size is 0 x 5"),
        (20, "<I", 9, r"180 bytes of pixels|instead of 180|truncated"),
        (20, "<I", 3, "more than 60 bytes"),
        (24, "<I", 1 << 31, "at most 16384"),
        (28, "<I", 2, "only flat images"),
        (32, "<I", 6, "only flat images"),
        (36, "<I", 6, "only flat images"),
        (44, "<I", 1, "its compression 1"),
        (44, "<I", 0, "bytes of pixels instead of 140"),
        (56, "<I", 1 << 30, "truncated"),
        (60, "<I", 1 << 30, "truncated"),
        (80, "<Q", 1 << 62, "truncated"),
        (80, "<Q", 4, "not a readable KTX2 image"),
        (88, "<Q", 5, "truncated"),
        (228, "<I", 0, "a key of its texts has no end"),
        (247, "<B", ord("l"), "rows do not run from top to bottom"),
    ],
)
def test_other_and_damaged_files_are_refused(tmp_path, offset, form, value, why):
    path = tmp_path / "a.ktx2"
    data = encode_ktx2(np.arange(35, dtype=np.uint32).reshape(5, 7), {}, "baker")
    path.write_bytes(data)
    assert decode_ktx2(path)[0].shape == (5, 7)
    path.write_bytes(changed(data, offset, form, value))
    with pytest.raises(InputError, match=why) as caught:
        decode_ktx2(path)
    assert "not a readable KTX2 image" in caught.value.message


def test_a_small_file_of_many_zeros_is_not_unpacked(tmp_path):
    data = encode_ktx2(np.uint32([[0]]), {}, "baker")
    (at,) = struct.unpack_from("<Q", data, 80)
    packed = _zstandard().compress(bytes(1 << 26))
    (tmp_path / "a.ktx2").write_bytes(changed(data, 88, "<Q", len(packed))[:at] + packed)
    with pytest.raises(InputError, match="more than 4 bytes"):
        decode_ktx2(tmp_path / "a.ktx2")


def test_a_file_without_compression_is_read(tmp_path):
    code = np.arange(6, dtype=np.uint32).reshape(2, 3)
    data = changed(encode_ktx2(code, {"unit": "lx"}, "baker"), 44, "<I", 0)
    (at,) = struct.unpack_from("<Q", data, 80)
    data = changed(changed(data, 88, "<Q", 24), 40, "<I", 0)[:at] + code.astype("<u4").tobytes()
    (tmp_path / "a.ktx2").write_bytes(data)
    found, text = decode_ktx2(tmp_path / "a.ktx2")
    assert np.array_equal(found, code)
    assert text == {"KTXorientation": "rd", "KTXwriter": "baker", "unit": "lx"}
