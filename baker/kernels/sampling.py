"""Generates low-discrepancy points in the unit square, and maps them to directions and triangles.

The points are the first two Sobol dimensions (a (0,2)-sequence) with nested uniform (Owen) scrambling. The
leading bits (`shared_bits_mask`) are scrambled in the same way for all texels, the other bits differently for
each texel. So the rays of sample s have similar directions in all texels, and ray packets stay coherent. The
points of one texel are still a fully scrambled net.

Based on: Sobol, 1967; Owen, Randomly permuted (t,m,s)-nets, 1995; Laine and Karras, Stratified
sampling for stochastic transparency, 2011 (the hash); Burley, Practical hash-based Owen scrambling,
2020; Shirley and Chiu, A low distortion map between disk and square, 1997; Duff et al., Building an
orthonormal basis, revisited, 2017.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from baker.trace.jit import inner, larger

# Numba widens uint32 arithmetic to 64 bits, so the result of each step is converted back to uint32.
_u = np.uint32
_INV_2_24 = np.float32(5.9604645e-08)


@inner
def hash_u32(x):  # type: ignore[no-untyped-def]
    """Return the uint32 hash of a uint32 (Wellons' lowbias32)."""
    x = _u(x ^ (x >> _u(16)))
    x = _u(x * _u(0x7FEB352D))
    x = _u(x ^ (x >> _u(15)))
    x = _u(x * _u(0x846CA68B))
    return _u(x ^ (x >> _u(16)))


@inner
def hash_combine(a, b):  # type: ignore[no-untyped-def]
    """Return the uint32 hash of two uint32 numbers; their order matters."""
    return hash_u32(_u(hash_u32(_u(a)) ^ _u(_u(b) * _u(0x9E3779B9) + _u(0x7F4A7C15))))


@inner
def reverse_bits(x):  # type: ignore[no-untyped-def]
    """Return the uint32 with its bits in reverse order."""
    x = _u(((x >> _u(1)) & _u(0x55555555)) | ((x & _u(0x55555555)) << _u(1)))
    x = _u(((x >> _u(2)) & _u(0x33333333)) | ((x & _u(0x33333333)) << _u(2)))
    x = _u(((x >> _u(4)) & _u(0x0F0F0F0F)) | ((x & _u(0x0F0F0F0F)) << _u(4)))
    x = _u(((x >> _u(8)) & _u(0x00FF00FF)) | ((x & _u(0x00FF00FF)) << _u(8)))
    return _u((x >> _u(16)) | (x << _u(16)))


@inner
def scramble_reversed(x, seed):  # type: ignore[no-untyped-def]
    """Owen-scramble a bit-reversed uint32: each bit is flipped by a hash of the bits below it."""
    x = _u(x + seed)
    x = _u(x ^ _u(x * _u(0x6C50B47C)))
    x = _u(x ^ _u(x * _u(0xB82F1E52)))
    x = _u(x ^ _u(x * _u(0xC7AFE638)))
    return _u(x ^ _u(x * _u(0x8D22F6E6)))


@inner
def texel_scramble(shared_reversed, seed, mask):  # type: ignore[no-untyped-def]
    """Return a float32 in [0, 1): a Sobol number with its unshared bits scrambled by the texel's seed.

    shared_reversed : uint32, Sobol number from `sobol_reversed`: all its bits are already scrambled in the
        same way for all texels; bit-reversed
    seed : uint32, seed of the texel
    mask : uint32, from `shared_bits_mask`; shared bits are the lowest bits of a bit-reversed number
    The result is truncated to 24 bits, because rounding up could move it into the next stratum of the net.
    """
    y = scramble_reversed(shared_reversed, seed)
    y = _u((y & _u(~mask)) | (shared_reversed & mask))
    return np.float32(reverse_bits(y) >> _u(8)) * _INV_2_24


def sobol_reversed(n: int, seed: int, dimension_pair: int) -> NDArray[np.uint32]:
    """Return n points of a (0,2)-sequence, scrambled in the same way for all texels, as bit-reversed numbers.

    Parameters
    ----------
    n : int
        Number of points.
    seed : int
        Seed of the scramble.
    dimension_pair : int
        Number of the sequence. Different numbers give independently scrambled sequences.

    Returns
    -------
    (n, 2) uint32
        `shared_reversed` of `texel_scramble`.
    """
    number = np.arange(n, dtype=np.uint32)
    seeds = np.array([[_u(3 * dimension_pair)], [_u(3 * dimension_pair + 1)]])
    seed_x, seed_y = hash_combine(np.array([_u(seed)]), seeds)
    y, v = np.zeros(n, np.uint32), _u(1 << 31)
    for bit in range(int(n).bit_length()):
        y ^= np.where(number >> _u(bit) & _u(1), v, _u(0))
        v ^= v >> _u(1)
    return np.stack([scramble_reversed(number, seed_x), scramble_reversed(reverse_bits(y), seed_y)], axis=1)


def shared_bits_mask(n_samples: int) -> np.uint32:
    """Return the mask of the bits that all texels share.

    The shared bits divide the unit square into equal cells, with at least one sample per cell and at most
    16 x 16 cells.

    Parameters
    ----------
    n_samples : int
        Number of samples of a texel.

    Returns
    -------
    uint32
        `mask` of `texel_scramble`.
    """
    return np.uint32((1 << min(int(math.log2(max(n_samples, 1))) // 2, 4)) - 1)


@inner
def cosine_direction(u, v):  # type: ignore[no-untyped-def]
    """Map (u, v) float32 in [0, 1) to a unit direction x, y, z of the hemisphere about +z; pdf = cos / pi.

    A concentric map to the disc is followed by a projection to the hemisphere. Sine and cosine of angles up
    to pi / 4 are polynomials with an error below 3e-7.
    """
    a = np.float32(2.0) * u - np.float32(1.0)
    b = np.float32(2.0) * v - np.float32(1.0)
    wide = abs(a) > abs(b)
    r = a if wide else b
    other = b if wide else a
    # Avoid branches, so that loops over lanes are vectorised. If r is 0, `other` is 0, too.
    t = np.float32(0.78539816) * other / (r if r != np.float32(0.0) else np.float32(1.0))
    t2 = t * t
    c = np.float32(1.0) + t2 * (
        np.float32(-0.5)
        + t2 * (np.float32(4.1666642e-2) + t2 * (np.float32(-1.3888397e-3) + t2 * np.float32(2.4760495e-5)))
    )
    s = t * (
        np.float32(1.0)
        + t2 * (np.float32(-1.6666667e-1) + t2 * (np.float32(8.3333310e-3) + t2 * np.float32(-1.9840874e-4)))
    )
    x = r * (c if wide else s)
    y = r * (s if wide else c)
    return x, y, math.sqrt(larger(np.float32(0.0), np.float32(1.0) - r * r))


@inner
def tangent_frame(nx, ny, nz):  # type: ignore[no-untyped-def]
    """Return six floats: the tangent and bitangent of a right-handed frame about the unit normal."""
    sign = np.float32(1.0) if nz >= np.float32(0.0) else np.float32(-1.0)
    a = np.float32(-1.0) / (sign + nz)
    b = nx * ny * a
    return (
        np.float32(1.0) + sign * nx * nx * a, sign * b, -sign * nx,
        b, sign + ny * ny * a, -ny,
    )  # fmt: skip


@inner
def triangle_barycentric(u, v):  # type: ignore[no-untyped-def]
    """Map (u, v), uniform in the unit square, to barycentrics (b1, b2), uniform in a triangle.

    Compact strata of the square become compact strata of the triangle.

    Based on: Heitz, A low-distortion map between triangle and square, 2019.
    """
    if v > u:
        b1 = u * np.float32(0.5)
        b2 = v - b1
    else:
        b2 = v * np.float32(0.5)
        b1 = u - b2
    return b1, b2
