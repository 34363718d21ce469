"""Encodes Radiance HDR files: 8-bit RGB mantissas with a shared exponent, run-length coded, row 0 at the top.

`value = mantissa * 2^(exponent - 136)`, as current readers decode it. Ward's original code adds 0.5 to the
mantissa. Here mantissas are rounded to nearest, so decoding without the 0.5 has no bias.

Based on: G. Ward, Real Pixels, Graphics Gems II, 1991; the Radiance picture file format.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from baker.core.encoding import (
    ENCODINGS,
    DecodedImage,
    Encoding,
    EncodingOptions,
    check_pixels,
    check_size,
    write_image,
)
from baker.core.errors import InputError
from baker.io.regular_file import read_regular

# Largest value: the largest mantissa, 255, with the largest stored exponent, 255.
HDR_MAX = 255.0 * 2.0 ** (255 - 136)
# Image widths, texels, whose rows can be run-length coded; rows of other widths are stored flat.
_CODED = range(8, 32768)
# Shortest run of equal bytes that is coded as a run, bytes.
_SHORTEST = 4


class HdrEncoding(Encoding[EncodingOptions]):
    """Radiance HDR files; registered as `hdr`."""

    suffix = ".hdr"
    components: tuple[int, ...] = (3,)
    options_type = EncodingOptions

    def limits(self, options: EncodingOptions) -> tuple[float, float]:
        """Return 0 and the largest value, about 2^127."""
        return 0.0, HDR_MAX

    def stored(self, pixels: NDArray[np.float32], options: EncodingOptions) -> NDArray[np.float32]:
        """Return pixels after encoding and decoding."""
        return _from_rgbe(_to_rgbe(pixels))

    def tolerance(self, pixels: NDArray[np.float32], options: EncodingOptions) -> NDArray[np.float64]:
        """Return the largest rounding error: 1/256 of the texel's brightest channel, at least 2^-127."""
        brightest = pixels.max(axis=-1, keepdims=True).astype(np.float64)
        return np.broadcast_to(np.maximum(brightest / 256.0, 2.0**-127), pixels.shape)

    def encode(
        self,
        path: Path,
        pixels: NDArray[np.float32],
        *,
        options: EncodingOptions,
        header: Mapping[str, str],
        names: tuple[str, ...] | None = None,
    ) -> None:
        """Write pixels (H, W, 3).

        Raises
        ------
        ValueError
            If a pixel is not a number, or the shape is not (H, W, 3).
        ResourceError
            If the file cannot be written.
        """
        check_pixels(pixels, self.components, path.name)
        write_image(path, hdr_file(pixels, header))

    def size(self, path: Path) -> tuple[int, int]:
        """Return width and height."""
        with _readable(path):
            _, height, width, _ = _read_head(read_regular(path))
        return width, height

    def decode(self, path: Path) -> DecodedImage:
        """Read a file.

        Raises
        ------
        InputError
            If the file is missing, damaged or not Radiance RGBE.
        """
        with _readable(path):
            data = read_regular(path)
            header, height, width, at = _read_head(data)
            check_size(path, width, height)
            rgbe = _decoded(data, at, height, width)
        return DecodedImage(_from_rgbe(rgbe), header, "uint", ("R", "G", "B"))


ENCODINGS.register("hdr")(HdrEncoding())


def hdr_file(pixels: NDArray[np.float32], header: Mapping[str, str]) -> bytes:
    """Return the content of a Radiance HDR file.

    Parameters
    ----------
    pixels : (H, W, 3) float32
        Row 0 is the top row.
    header : mapping of str to str
        Written as comments.

    Returns
    -------
    bytes
        Header and run-length coded pixels.
    """
    height, width = pixels.shape[:2]
    lines = [f"# {key}: {text}" for key, text in sorted(header.items())]
    # PRIMARIES: CIE xy of the Rec.709 primaries and of D65 white. EXPOSURE: factor of the values.
    about = ["#?RADIANCE", *lines, "FORMAT=32-bit_rle_rgbe", "EXPOSURE=1.0"]
    about += ["PRIMARIES=0.64 0.33 0.30 0.60 0.15 0.06 0.3127 0.3290"]
    head = "\n".join(about) + f"\n\n-Y {height} +X {width}\n"
    rgbe = _to_rgbe(pixels)
    body = [_coded(row) for row in rgbe] if width in _CODED else [rgbe.tobytes()]
    return head.encode("utf-8") + b"".join(body)


@contextlib.contextmanager
def _readable(path: Path) -> Iterator[None]:
    """Convert errors about a damaged or missing file to `InputError`."""
    try:
        yield
    except OSError as error:
        raise InputError(f"the image cannot be read ({error.strerror})", file=str(path)) from None
    except (ValueError, IndexError) as error:
        message = f"this is not a readable Radiance HDR image ({error})"
        raise InputError(message, file=str(path)) from None


def _to_rgbe(pixels: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Return the mantissas and exponent, (..., 4) uint8, of pixels (..., 3)."""
    value = np.clip(pixels.astype(np.float64), 0.0, HDR_MAX)
    brightest = value.max(axis=-1)
    exponent = np.frexp(brightest)[1]
    # If the brightest mantissa is rounded to 256, increase the exponent; the mantissa is then 128.
    exponent = exponent + (np.rint(np.ldexp(brightest, 8 - exponent)) > 255.0)
    mantissa = np.rint(np.ldexp(value, (8 - exponent)[..., None]))
    code = np.concatenate([mantissa, (exponent + 128)[..., None]], axis=-1)
    code[(exponent + 128 < 1) | (brightest == 0.0)] = 0.0
    return code.astype(np.uint8)


def _from_rgbe(rgbe: NDArray[np.uint8]) -> NDArray[np.float32]:
    exponent = rgbe[..., 3:].astype(np.int32) - 136
    value = np.ldexp(rgbe[..., :3].astype(np.float64), exponent)
    return np.where(rgbe[..., 3:] == 0, 0.0, value).astype(np.float32)


def _coded(row: NDArray[np.uint8]) -> bytes:
    """Return one row (W, 4) as bytes: its four channels, run-length coded one after the other."""
    width = len(row)
    parts = [bytes((2, 2, width >> 8, width & 255))]
    for plane in np.ascontiguousarray(row.T):
        edge = np.flatnonzero(np.diff(plane)) + 1
        start = np.concatenate([[0], edge])
        length = np.diff(np.concatenate([start, [width]]))
        long = length >= _SHORTEST
        raw, done = plane.tobytes(), 0
        for first, count in zip(start[long].tolist(), length[long].tolist(), strict=True):
            parts.append(_literal(raw[done:first]))
            value = raw[first : first + 1]
            parts += [bytes((128 + min(127, count - at),)) + value for at in range(0, count, 127)]
            done = first + count
        parts.append(_literal(raw[done:]))
    return b"".join(parts)


def _literal(raw: bytes) -> bytes:
    return b"".join(bytes((min(128, len(raw) - at),)) + raw[at : at + 128] for at in range(0, len(raw), 128))


def _read_head(data: bytes) -> tuple[dict[str, str], int, int, int]:
    """Return the entries of the header, height, width, and the offset of the pixels in bytes."""
    if not data.startswith((b"#?RADIANCE", b"#?RGBE")):
        raise ValueError("no Radiance header")
    end = data.index(b"\n\n")
    size_end = data.index(b"\n", end + 2)
    header: dict[str, str] = {}
    for line in data[:end].decode("utf-8", "replace").split("\n")[1:]:
        key, separator, text = line.removeprefix("# ").partition(": " if line.startswith("#") else "=")
        if separator:
            header[key] = text
    if header.get("FORMAT", "32-bit_rle_rgbe") != "32-bit_rle_rgbe":
        raise ValueError(f"its format is {header['FORMAT']}")
    words = data[end + 2 : size_end].split()
    if len(words) != 4 or words[0] != b"-Y" or words[2] != b"+X":
        raise ValueError("its rows do not run from top to bottom")
    return header, int(words[1]), int(words[3]), size_end + 1


def _decoded(data: bytes, at: int, height: int, width: int) -> NDArray[np.uint8]:
    """Return the mantissas and exponents, (H, W, 4) uint8, from the file's bytes starting at offset `at`."""
    if data[at : at + 2] != b"\x02\x02" or width not in _CODED:
        flat = np.frombuffer(data, np.uint8, height * width * 4, at)
        return flat.reshape(height, width, 4)
    planes = np.zeros((height, 4, width), np.uint8)
    for row in planes:
        if data[at : at + 4] != bytes((2, 2, width >> 8, width & 255)):
            raise ValueError("a line does not begin as it should")
        at += 4
        for plane in row:
            at = _decode_plane(data, at, plane)
    return planes.transpose(0, 2, 1)


def _decode_plane(data: bytes, at: int, plane: NDArray[np.uint8]) -> int:
    """Fill one channel of a row from `data` at offset `at`, and return the offset of the next channel."""
    done = 0
    while done < len(plane):
        count = data[at]
        run = count > 128
        count = count - 128 if run else count
        size = 1 if run else count
        if not 0 < count <= len(plane) - done or at + 1 + size > len(data):
            raise ValueError("a line runs over its end")
        plane[done : done + count] = np.frombuffer(data, np.uint8, size, at + 1)
        at, done = at + 1 + size, done + count
    return at
