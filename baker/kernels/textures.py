"""Material textures packed for kernels: mip pyramids in one flat array, bilinear or nearest lookups.

Colours are averaged in linear light when the pyramid is made.
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

MAX_LEVELS = 16
# Columns of `TexturePack.level`, of `.wrap`, and the alpha channel of `.pixels`.
OFFSET, WIDTH, HEIGHT = 0, 1, 2
WRAP_U, WRAP_V, NEAREST = 0, 1, 2
ALPHA = 3
# Values of WRAP_U and WRAP_V.
_REPEAT, _MIRROR, _CLAMP = 0, 1, 2
_WRAP = {"repeat": _REPEAT, "mirror": _MIRROR, "clamp": _CLAMP}


class TexturePack(NamedTuple):
    """Linear RGBA of K textures with their mip levels.

    Attributes
    ----------
    pixels : (n, 4) float32
        Rows of all levels of all textures.
    level : (K, 16, 3) int64
        OFFSET in `pixels`, WIDTH and HEIGHT of each level, finest first.
    n_levels : (K,) int64
        Levels of each texture.
    wrap : (K, 3) int64
        WRAP_U and WRAP_V: 0 repeat, 1 mirror, 2 clamp; NEAREST: 1 if lookups take the nearest texel.
    """

    pixels: NDArray[np.float32]
    level: NDArray[np.int64]
    n_levels: NDArray[np.int64]
    wrap: NDArray[np.int64]


_LINEAR_FROM_BYTE = linear_from_srgb(np.arange(256) / 255.0)


def _linear_image(image: NDArray[Any]) -> NDArray[np.float32]:
    if image.dtype != np.uint8:
        return image.astype(np.float32)
    linear: NDArray[np.float32] = _LINEAR_FROM_BYTE[image]
    linear[..., 3] = image[..., 3] / np.float32(255.0)
    return linear


def _halved(image: NDArray[np.float32]) -> NDArray[np.float32]:
    rows = (
        image
        if image.shape[0] == 1
        else (image[: image.shape[0] // 2 * 2 : 2] + image[1::2]) * np.float32(0.5)
    )
    if rows.shape[1] == 1:
        return rows
    halved: NDArray[np.float32] = (rows[:, : rows.shape[1] // 2 * 2 : 2] + rows[:, 1::2]) * np.float32(0.5)
    return halved


def pack_textures(
    images: Sequence[tuple[NDArray[Any], tuple[str, str]]], nearest: Sequence[bool] = ()
) -> TexturePack:
    """Build the mip pyramids of textures.

    Parameters
    ----------
    images : sequence of (image, (wrap_u, wrap_v))
        RGBA (H, W, 4), uint8 in sRGB or float32 linear, and the wrap modes: repeat, mirror or clamp.
    nearest : sequence of bool, optional
        Which of them `sample_texture` looks up without interpolation.

    Returns
    -------
    TexturePack
        In the order of `images`; one row without texels if there are none.
    """
    level = np.zeros((max(len(images), 1), MAX_LEVELS, 3), np.int64)
    n_levels = np.zeros(max(len(images), 1), np.int64)
    wrap = np.zeros((max(len(images), 1), 3), np.int64)
    wrap[: len(nearest), NEAREST] = nearest
    parts: list[NDArray[np.float32]] = []
    offset = 0
    for k, (image, modes) in enumerate(images):
        wrap[k, :2] = [_WRAP[m] for m in modes]
        current = _linear_image(image)
        for n in range(MAX_LEVELS):
            level[k, n] = offset, current.shape[1], current.shape[0]
            n_levels[k] = n + 1
            parts.append(current.reshape(-1, 4))
            offset += current.shape[0] * current.shape[1]
            if current.shape[0] == 1 and current.shape[1] == 1:
                break
            current = _halved(current)
    pixels = np.concatenate(parts) if parts else np.zeros((1, 4), np.float32)
    return TexturePack(pixels, level, n_levels, wrap)


@inner
def wrapped(i, n, mode):  # type: ignore[no-untyped-def]
    """Return the column or row 0 to n - 1 that texel i is read from; mode: see `TexturePack.wrap`."""
    if mode == _REPEAT:
        return i % n
    if mode == _MIRROR:
        j = i % (2 * n)
        return j if j < n else 2 * n - 1 - j
    return smaller(larger(i, 0), n - 1)


@inner
def sample_alpha(pixels, level, wrap, k, u, v):  # type: ignore[no-untyped-def]
    """Return the bilinear alpha of texture k at (u, v) in its finest level.

    pixels (n, 4) float32, level (K, 16, 3) int64, wrap (K, 3) int64 : see `TexturePack`
    """
    offset, w, h = level[k, 0, OFFSET], level[k, 0, WIDTH], level[k, 0, HEIGHT]
    # Keep only the fraction of two periods of a repeated uv.
    wrap_u, wrap_v = wrap[k, WRAP_U], wrap[k, WRAP_V]
    x = (u - math.floor(u / 2.0) * 2.0 if wrap_u != _CLAMP else smaller(larger(u, -1.0), 2.0)) * w - 0.5
    y = (v - math.floor(v / 2.0) * 2.0 if wrap_v != _CLAMP else smaller(larger(v, -1.0), 2.0)) * h - 0.5
    x0 = np.int64(math.floor(x))
    y0 = np.int64(math.floor(y))
    fx = x - x0
    fy = y - y0
    left, right = wrapped(x0, w, wrap_u), wrapped(x0 + 1, w, wrap_u)
    upper = offset + wrapped(y0, h, wrap_v) * w
    lower = offset + wrapped(y0 + 1, h, wrap_v) * w
    above = (1.0 - fx) * pixels[upper + left, ALPHA] + fx * pixels[upper + right, ALPHA]
    below = (1.0 - fx) * pixels[lower + left, ALPHA] + fx * pixels[lower + right, ALPHA]
    return (1.0 - fy) * above + fy * below


@inner
def sample_texture(pack, k, u, v, footprint, out):  # type: ignore[no-untyped-def]
    """Write the linear RGBA of texture k at (u, v).

    pack : TexturePack
    footprint : width to average over, in uv of the whole image; it selects the mip level
    out : (4,) float64 output
    """
    # Select the level whose texels are nearest in size to the footprint.
    width = larger(pack.level[k, 0, WIDTH], pack.level[k, 0, HEIGHT])
    n = 0
    if footprint * width > 1.0:
        # Take the minimum of floats: an infinite footprint has no integer level.
        n = int(smaller(math.log2(footprint * width) + 0.5, float(pack.n_levels[k] - 1)))
    offset, w, h = pack.level[k, n, OFFSET], pack.level[k, n, WIDTH], pack.level[k, n, HEIGHT]
    # Keep only the fraction of two periods of a repeated uv.
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
                out[c] += weight * pack.pixels[at, c]
