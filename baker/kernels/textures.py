"""Packs material textures into mip pyramids in flat arrays, and looks textures up in kernels.

The levels of a pyramid are averages of linear colours.
Based on: Williams, Pyramidal parametrics, 1983; IEC 61966-2-1 (the sRGB curve).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from baker.core.colour import linear_from_srgb
from baker.trace.jit import inner, larger, smaller

# Largest number of mip levels of a texture.
MAX_LEVELS = 16
# OFFSET to HEIGHT: columns of `TexturePack.level`. WRAP_U to STORAGE: columns of `TexturePack.wrap`. ALPHA:
# column of `TexturePack.pixels` and `.coded`.
OFFSET, WIDTH, HEIGHT = 0, 1, 2
WRAP_U, WRAP_V, NEAREST, STORAGE = 0, 1, 2, 3
ALPHA = 3
# Values of WRAP_U and WRAP_V.
_REPEAT, _MIRROR, _CLAMP = 0, 1, 2
_WRAP = {"repeat": _REPEAT, "mirror": _MIRROR, "clamp": _CLAMP}
# Values in column STORAGE.
FLOATS, SRGB_BYTES, LINEAR_BYTES = 0, 1, 2
# Number of rows of a level that are decoded in one step to compute the next level. It must be even.
_STRIP = 256


class TexturePack(NamedTuple):
    """RGBA of K textures with their mip levels.

    The finest level of an 8-bit image is stored in 8 bits, and each lookup decodes it. All other levels are
    linear float32. An 8-bit image of n texels takes 9.3 n bytes, a float32 image 21.3 n bytes.

    Attributes
    ----------
    pixels : (n, 4) float32
        Linear RGBA of all levels that are stored as floats, row after row.
    coded : (m, 4) uint8
        RGBA of the finest levels of 8-bit images, unchanged, row after row.
    level : (K, 16, 3) int64
        OFFSET, WIDTH and HEIGHT of each level, finest first. OFFSET is the index of the level's first texel.
        It is an index of `coded` if the level is the finest and STORAGE is not `FLOATS`, else of `pixels`.
    n_levels : (K,) int64
        Number of levels of each texture.
    wrap : (K, 4) int64
        WRAP_U and WRAP_V: 0 repeat, 1 mirror, 2 clamp. NEAREST: 1 if lookups take the nearest texel, 0 if
        they interpolate. STORAGE of the finest level: 0 float32, 1 bytes with sRGB-encoded colour and linear
        alpha, 2 linear bytes.
    """

    pixels: NDArray[np.float32]
    coded: NDArray[np.uint8]
    level: NDArray[np.int64]
    n_levels: NDArray[np.int64]
    wrap: NDArray[np.int64]


_LINEAR_BYTE = (np.arange(256) / np.float32(255.0)).astype(np.float32)
# (3, 256): linear value of each byte, with one row for each value of STORAGE. Row 0 (FLOATS) is not used.
_VALUE_OF_BYTE = np.stack([_LINEAR_BYTE, linear_from_srgb(np.arange(256) / 255.0), _LINEAR_BYTE])


class PackImage(NamedTuple):
    """An image to be packed.

    Attributes
    ----------
    image : (H, W, 4) uint8 or float32
        RGBA. float32 is linear.
    wrap : (str, str)
        Wrap modes along u and v: "repeat", "mirror" or "clamp".
    nearest : bool
        Whether `sample_texture` takes the nearest texel instead of interpolating.
    linear : bool
        Whether the bytes of a uint8 image are linear; otherwise RGB is sRGB-encoded.
    """

    image: NDArray[Any]
    wrap: tuple[str, str]
    nearest: bool = False
    linear: bool = False


def pack_textures(images: Sequence[PackImage]) -> TexturePack:
    """Build the mip pyramids of textures.

    Parameters
    ----------
    images : sequence of PackImage
        The textures.

    Returns
    -------
    TexturePack
        Textures in the order of `images`. Without images, each array has one row of zeros.
    """
    pack = _empty_pack(images)
    for k, image in enumerate(images):
        _fill(pack, k, image.image)
    return pack


def _empty_pack(images: Sequence[PackImage]) -> TexturePack:
    """Return the pack of the images: the position of each level is computed, and all texels are 0."""
    count = max(len(images), 1)
    level = np.zeros((count, MAX_LEVELS, 3), np.int64)
    n_levels, wrap = np.zeros(count, np.int64), np.zeros((count, 4), np.int64)
    floats = bytes_ = 0
    for k, image in enumerate(images):
        wrap[k, [WRAP_U, WRAP_V]] = [_WRAP[mode] for mode in image.wrap]
        wrap[k, NEAREST] = image.nearest
        if image.image.dtype == np.uint8:
            wrap[k, STORAGE] = LINEAR_BYTES if image.linear else SRGB_BYTES
        height, width = image.image.shape[:2]
        for n in range(MAX_LEVELS):
            in_bytes = n == 0 and wrap[k, STORAGE] != FLOATS
            level[k, n] = bytes_ if in_bytes else floats, width, height
            n_levels[k] = n + 1
            bytes_ += width * height if in_bytes else 0
            floats += 0 if in_bytes else width * height
            if width == 1 and height == 1:
                break
            width, height = max(width // 2, 1), max(height // 2, 1)
    pixels, coded = np.zeros((max(floats, 1), 4), np.float32), np.zeros((max(bytes_, 1), 4), np.uint8)
    return TexturePack(pixels, coded, level, n_levels, wrap)


def _fill(pack: TexturePack, k: int, image: NDArray[Any]) -> None:
    """Write all levels of texture k; `image` is its finest level."""
    level_rows(pack, k, 0)[:] = image.reshape(-1, 4)
    for n in range(1, int(pack.n_levels[k])):
        before, after = (
            level_rows(pack, k, m).reshape(*pack.level[k, m, [HEIGHT, WIDTH]], 4) for m in (n - 1, n)
        )
        for first in range(0, len(after), _STRIP // 2):
            strip = decoded(before[2 * first : 2 * first + _STRIP], int(pack.wrap[k, STORAGE]))
            after[first : first + _STRIP // 2] = _halved(strip)


def level_rows(pack: TexturePack, k: int, n: int) -> NDArray[Any]:
    """Return the stored texels of a level.

    Parameters
    ----------
    pack : TexturePack
        The textures.
    k, n : int
        Texture and level; level 0 is the finest.

    Returns
    -------
    (H * W, 4) float32 or uint8
        View of `pixels` or `coded`. `decoded` converts bytes to linear float32.
    """
    offset, width, height = (int(x) for x in pack.level[k, n])
    rows = pack.coded if n == 0 and pack.wrap[k, STORAGE] != FLOATS else pack.pixels
    return rows[offset : offset + width * height]


def decoded(stored: NDArray[Any], storage: int) -> NDArray[np.float32]:
    """Decode stored texels.

    Parameters
    ----------
    stored : (..., 4) uint8 or float32
        RGBA, from `level_rows`.
    storage : int
        STORAGE of the texture; used only if `stored` is uint8.

    Returns
    -------
    (..., 4) float32
        Linear RGBA; `stored` itself if it is float32.
    """
    if stored.dtype != np.uint8:
        return np.asarray(stored, np.float32)
    linear: NDArray[np.float32] = _VALUE_OF_BYTE[storage][stored]
    linear[..., ALPHA] = _LINEAR_BYTE[stored[..., ALPHA]]
    return linear


def value_limits(pack: TexturePack, k: int) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return the smallest and the largest linear value of each channel of a texture.

    Parameters
    ----------
    pack : TexturePack
        The textures.
    k : int
        Number of the texture.

    Returns
    -------
    lowest, highest : (4,) float32
        Linear RGBA, over the finest level.
    """
    finest, storage = level_rows(pack, k, 0), int(pack.wrap[k, STORAGE])
    return decoded(finest.min(axis=0), storage), decoded(finest.max(axis=0), storage)


def _halved(image: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the averages of blocks of 2 x 2 texels.

    If the number of rows or columns is odd, the last row or column is left out, unless it is the only one.
    """
    rows = (
        image
        if image.shape[0] == 1
        else (image[: image.shape[0] // 2 * 2 : 2] + image[1::2]) * np.float32(0.5)
    )
    if rows.shape[1] == 1:
        return rows
    halved: NDArray[np.float32] = (rows[:, : rows.shape[1] // 2 * 2 : 2] + rows[:, 1::2]) * np.float32(0.5)
    return halved


@inner
def wrapped(i, n, mode):  # type: ignore[no-untyped-def]
    """Return the column or row, 0 to n - 1, for any integer i under a wrap mode, see `TexturePack.wrap`."""
    if mode == _REPEAT:
        return i % n
    if mode == _MIRROR:
        j = i % (2 * n)
        return j if j < n else 2 * n - 1 - j
    return smaller(larger(i, 0), n - 1)


@inner
def _texel(pack, storage, at, c):  # type: ignore[no-untyped-def]
    """Return channel c of a texel, linear.

    storage : value of STORAGE; with FLOATS, row `at` of `pack.pixels` is read, else row `at` of `pack.coded`
    """
    if storage == FLOATS:
        return pack.pixels[at, c]
    return _VALUE_OF_BYTE[storage if c != ALPHA else LINEAR_BYTES, pack.coded[at, c]]


@inner
def sample_alpha(pack, k, u, v):  # type: ignore[no-untyped-def]
    """Return the bilinear alpha of texture k at (u, v) in its finest level.

    pack : TexturePack
    """
    offset, w, h = pack.level[k, 0, OFFSET], pack.level[k, 0, WIDTH], pack.level[k, 0, HEIGHT]
    storage = pack.wrap[k, STORAGE]
    # Reduce a repeated uv modulo 2, the period of mirroring.
    wrap_u, wrap_v = pack.wrap[k, WRAP_U], pack.wrap[k, WRAP_V]
    x = (u - math.floor(u / 2.0) * 2.0 if wrap_u != _CLAMP else smaller(larger(u, -1.0), 2.0)) * w - 0.5
    y = (v - math.floor(v / 2.0) * 2.0 if wrap_v != _CLAMP else smaller(larger(v, -1.0), 2.0)) * h - 0.5
    x0 = np.int64(math.floor(x))
    y0 = np.int64(math.floor(y))
    fx = x - x0
    fy = y - y0
    left, right = wrapped(x0, w, wrap_u), wrapped(x0 + 1, w, wrap_u)
    upper = offset + wrapped(y0, h, wrap_v) * w
    lower = offset + wrapped(y0 + 1, h, wrap_v) * w
    above = (1.0 - fx) * _texel(pack, storage, upper + left, ALPHA) + fx * _texel(
        pack, storage, upper + right, ALPHA
    )
    below = (1.0 - fx) * _texel(pack, storage, lower + left, ALPHA) + fx * _texel(
        pack, storage, lower + right, ALPHA
    )
    return (1.0 - fy) * above + fy * below


@inner
def sample_texture(pack, k, u, v, footprint, out):  # type: ignore[no-untyped-def]
    """Write the linear RGBA of texture k at (u, v).

    pack : TexturePack
    footprint : width of the averaged area in uv, which selects the mip level
    out : (4,) float64 output
    """
    # Select the level whose texel width is nearest to the footprint.
    width = larger(pack.level[k, 0, WIDTH], pack.level[k, 0, HEIGHT])
    n = 0
    if footprint * width > 1.0:
        # Take the minimum before the conversion to int, because the footprint may be infinite.
        n = int(smaller(math.log2(footprint * width) + 0.5, float(pack.n_levels[k] - 1)))
    offset, w, h = pack.level[k, n, OFFSET], pack.level[k, n, WIDTH], pack.level[k, n, HEIGHT]
    storage = pack.wrap[k, STORAGE] if n == 0 else FLOATS
    # Reduce a repeated uv modulo 2, the period of mirroring.
    wrap_u, wrap_v = pack.wrap[k, WRAP_U], pack.wrap[k, WRAP_V]
    x = (u - math.floor(u / 2.0) * 2.0 if wrap_u != _CLAMP else smaller(larger(u, -1.0), 2.0)) * w - 0.5
    y = (v - math.floor(v / 2.0) * 2.0 if wrap_v != _CLAMP else smaller(larger(v, -1.0), 2.0)) * h - 0.5
    x0 = math.floor(x)
    y0 = math.floor(y)
    fx = x - x0
    fy = y - y0
    if pack.wrap[k, NEAREST] != 0:
        fx, fy = 1.0 if fx >= 0.5 else 0.0, 1.0 if fy >= 0.5 else 0.0
    # Sum the four texels with bilinear weights.
    for c in range(4):
        out[c] = 0.0
    for j in range(2):
        for i in range(2):
            weight = (fx if i else 1.0 - fx) * (fy if j else 1.0 - fy)
            at = offset + wrapped(y0 + j, h, wrap_v) * w + wrapped(x0 + i, w, wrap_u)
            for c in range(4):
                out[c] += weight * _texel(pack, storage, at, c)
