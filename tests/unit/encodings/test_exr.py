"""EXR files: decoded pixels equal the encoded ones, bytes follow the format, broken files are refused."""

from __future__ import annotations

import hashlib
import os
import struct
import zlib
from pathlib import Path

import numpy as np
import pytest

from baker.core.encoding import ENCODINGS
from baker.core.errors import InputError, ResourceError
from baker.encodings.exr import HALF_MAX, decode_exr, encode_exr


def noise(height: int, width: int, channels: int, seed: int = 1) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return (10.0 ** rng.uniform(-4, 4, (height, width, channels))).astype(np.float32)


@pytest.mark.parametrize("channels", [1, 3])
@pytest.mark.parametrize(("half", "dtype", "kind"), [(True, "f2", "half"), (False, "f4", "float")])
def test_what_is_written_is_read_back_to_the_last_bit(
    tmp_path: Path, channels: int, half: bool, dtype, kind
) -> None:
    pixels = noise(37, 53, channels)
    clipped = encode_exr(
        tmp_path / "a.exr", pixels, half=half, header={"quantity": "irradiance", "unit": "lx"}
    )
    image = decode_exr(tmp_path / "a.exr")
    assert clipped == 0
    assert image.dtype == kind
    assert image.channels == (("R", "G", "B") if channels == 3 else ("Y",))
    assert np.array_equal(image.pixels, pixels.astype(dtype).astype(np.float32))
    assert image.header["quantity"] == "irradiance"
    assert image.header["unit"] == "lx"
    assert ("chromaticities" in image.header) == (channels == 3)


def test_layout_is_the_one_every_engine_reads(tmp_path: Path) -> None:
    """Parse the file by hand: version, attributes, order of lines, and the pixels of the first block."""
    # The pixels are smooth, because EXR stores a block uncompressed if compression does not make it smaller.
    pixels = np.linspace(0, 4, 20 * 8 * 3, dtype=np.float32).reshape(20, 8, 3).round(1)
    encode_exr(tmp_path / "a.exr", pixels, half=True, header={})
    data = (tmp_path / "a.exr").read_bytes()
    magic, version = struct.unpack_from("<II", data)
    assert (magic, version) == (20000630, 2), "single part, scanline, no long names"
    attributes, at = {}, 8
    while data[at]:
        name, kind, _ = data[at:].split(b"\0", 2)
        at += len(name) + len(kind) + 2
        (size,) = struct.unpack_from("<I", data, at)
        attributes[name.decode()] = data[at + 4 : at + 4 + size]
        at += 4 + size
    at += 1
    assert attributes["compression"] == b"\x03", "ZIP, 16 lines a block"
    assert attributes["lineOrder"] == b"\x00", "row 0 first"
    assert np.frombuffer(attributes["chromaticities"], "<f4") == pytest.approx(
        [0.64, 0.33, 0.3, 0.6, 0.15, 0.06, 0.3127, 0.329]
    )
    (offset,) = struct.unpack_from("<Q", data, at)
    line, size = struct.unpack_from("<II", data, offset)
    assert line == 0
    # Undo EXR's ZIP compression: inflate, sum the differences of bytes, and interleave the two halves.
    raw = np.frombuffer(zlib.decompress(data[offset + 8 : offset + 8 + size]), np.uint8).astype(np.int64)
    raw = np.cumsum(np.concatenate([raw[:1], raw[1:] - 128])).astype(np.uint8)
    middle = (len(raw) + 1) // 2
    block = np.zeros(len(raw), np.uint8)
    block[0::2], block[1::2] = raw[:middle], raw[middle:]
    lines = block.view("<f2").reshape(16, 3, 8)
    for index, channel in enumerate("BGR"):
        assert np.array_equal(lines[:, index], pixels[:16, :, "RGB".index(channel)].astype(np.float16)), (
            channel
        )


def test_same_pixels_give_same_bytes(tmp_path: Path) -> None:
    digests = set()
    for name in ("a.exr", "b.exr"):
        encode_exr(
            tmp_path / name, noise(64, 64, 3), half=True, header={"unit": "lx", "quantity": "irradiance"}
        )
        digests.add(hashlib.sha256((tmp_path / name).read_bytes()).hexdigest())
    assert len(digests) == 1


def test_too_bright_texels_are_counted_and_never_become_infinite(tmp_path: Path) -> None:
    pixels = np.ones((4, 5, 3), np.float32)
    pixels[0, 0, 0] = 65505.0
    pixels[1, 2] = np.inf
    pixels[3, 4, 1] = HALF_MAX
    assert encode_exr(tmp_path / "a.exr", pixels, half=True) == 2
    read = decode_exr(tmp_path / "a.exr").pixels
    assert np.isfinite(read).all()
    assert read.max() == HALF_MAX
    assert encode_exr(tmp_path / "b.exr", pixels, half=False) == 1
    assert decode_exr(tmp_path / "b.exr").pixels[0, 0, 0] == 65505.0


def test_not_a_number_never_gets_in(tmp_path: Path) -> None:
    pixels = np.ones((4, 5, 3), np.float32)
    pixels[2, 2, 1] = np.nan
    with pytest.raises(ValueError, match="1 texels are not a number"):
        encode_exr(tmp_path / "a.exr", pixels, half=True)
    assert not (tmp_path / "a.exr").exists()


def test_a_shape_that_is_no_image_is_refused(tmp_path: Path) -> None:
    for shape in [(4, 4), (4, 4, 2), (0, 4, 3)]:
        with pytest.raises(ValueError, match="pixels of shape"):
            encode_exr(tmp_path / "a.exr", np.zeros(shape, np.float32))


def test_errors_are_sentences(tmp_path: Path) -> None:
    with pytest.raises(ResourceError, match="could not be written"):
        encode_exr(tmp_path / "absent" / "a.exr", np.ones((2, 2, 1), np.float32))
    with pytest.raises(InputError, match="no such file"):
        decode_exr(tmp_path / "absent.exr")
    (tmp_path / "text.exr").write_bytes(b"hello")
    with pytest.raises(InputError, match="not a readable EXR"):
        decode_exr(tmp_path / "text.exr")


def test_a_file_that_lost_its_end_is_refused(tmp_path: Path) -> None:
    encode_exr(tmp_path / "a.exr", noise(64, 64, 3))
    data = (tmp_path / "a.exr").read_bytes()
    (tmp_path / "a.exr").write_bytes(data[: len(data) - 100])
    with pytest.raises(InputError, match="not a readable EXR"):
        decode_exr(tmp_path / "a.exr")


def test_the_registry_finds_it_by_name() -> None:
    encoding = ENCODINGS.get("exr")
    assert encoding is not None
    assert encoding.suffix == ".exr"


def test_the_library_prints_nothing_about_damaged_files(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "a.exr"
    encode_exr(path, noise(32, 32, 3))
    data = path.read_bytes()
    for end in (200, len(data) // 2, len(data) - 3):
        path.write_bytes(data[:end])
        with pytest.raises(InputError, match="not a readable EXR"):
            decode_exr(path)
    os.write(2, b"still open")
    assert tuple(capfd.readouterr()) == ("", "still open")


def test_a_large_size_is_refused_before_memory_is_allocated(tmp_path: Path) -> None:
    path = tmp_path / "a.exr"
    encode_exr(path, noise(32, 16, 3))
    data = path.read_bytes()
    window = struct.pack("<4i", 0, 0, 15, 31)
    assert data.count(window) == 2
    for box in ((0, 0, 15, 40000), (-(2**31), 0, 2**31 - 1, 31), (0, 0, 2**30, 2**30)):
        path.write_bytes(data.replace(window, struct.pack("<4i", *box)))
        with pytest.raises(InputError, match=r"EXR image|at most 16384 a side"):
            decode_exr(path)
