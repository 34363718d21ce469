"""Generates random numbers of paths, which depend only on seed, pass, point, sample and number of the vertex.

`draw` returns the next number of a SplitMix64 generator, whose state `path_state` computes from (seed, pass,
point, sample). `random_lanes` hashes (seed, pass, point, sample, vertex) for eight paths at once. It
multiplies only 32-bit integers, because SIMD instructions multiply eight of these at a time.

Based on: Steele, Lea and Flood, Fast splittable pseudorandom number generators, 2014; Jarzynski and Olano,
Hash functions for GPU rendering, 2020 (pcg4d).
"""

from __future__ import annotations

import numpy as np

from baker.kernels.sampling import hash_u32, reverse_bits, scramble_reversed, texel_scramble
from baker.pathtracer.path_blocks import (
    BLOCK_WIDTH,
    CHOICE,
    COUNT,
    KEY,
    LOBE,
    ROULETTE,
    SAMPLE,
    U_DIRECTION,
    U_LIGHT,
    W_DIRECTION,
    W_LIGHT,
    unsigned,
)
from baker.trace.jit import inner

_w = np.uint32
_L = BLOCK_WIDTH
_u = np.uint64
_STEP = np.uint64(0x9E3779B97F4A7C15)
_INV_2_53 = 1.0 / 9007199254740992.0


@inner
def mix64(x):  # type: ignore[no-untyped-def]
    """Return a hash (uint64) of a uint64: the output function of SplitMix64."""
    x = _u(x ^ (x >> _u(30)))
    x = _u(x * _u(0xBF58476D1CE4E5B9))
    x = _u(x ^ (x >> _u(27)))
    x = _u(x * _u(0x94D049BB133111EB))
    return _u(x ^ (x >> _u(31)))


@inner
def path_state(seed, number, point, sample):  # type: ignore[no-untyped-def]
    """Return the initial generator state (uint64) of sample `sample` of point `point` in pass `number`."""
    x = mix64(_u(_u(seed) + _STEP))
    x = mix64(_u(x ^ _u(_u(number) + _u(1)) * _u(0xD1342543DE82EF95)))
    x = mix64(_u(x ^ _u(_u(point) + _u(1)) * _u(0x2545F4914F6CDD1D)))
    return mix64(_u(x ^ _u(_u(sample) + _u(1)) * _STEP))


@inner
def draw(state, lane):  # type: ignore[no-untyped-def]
    """Advance the generator `state[lane]` and return its next number, float64 in [0, 1).

    state : (16,) uint64
    """
    state[lane] = _u(state[lane] + _STEP)
    return np.float64(mix64(state[lane]) >> _u(11)) * _INV_2_53


@inner
def stratum(sobol_points, sample, point, seed, number_of_pass, pair):  # type: ignore[no-untyped-def]
    """Return point `sample` of a (0,2)-sequence: two float64 in [0, 1).

    The sequence is scrambled independently for each point, pass and `pair`.

    sobol_points : (n, 2) uint32, bit-reversed Sobol points
    pair : 0 for the pair that samples a light, 1 for the pair that samples a direction
    """
    bits = path_state(seed, number_of_pass, point, _u(1) << _u(40 + pair))
    first = np.uint32(bits & _u(0xFFFFFFFF))
    second = np.uint32(bits >> _u(32))
    none = np.uint32(0)
    return (
        np.float64(texel_scramble(sobol_points[sample, 0], first, none)),
        np.float64(texel_scramble(sobol_points[sample, 1], second, none)),
    )


@inner
def mix4(x, y, z, w):  # type: ignore[no-untyped-def]
    """Return a hash of four uint32, as four uint32 (pcg4d)."""
    x, y = _w(x * _w(1664525) + _w(1013904223)), _w(y * _w(1664525) + _w(1013904223))
    z, w = _w(z * _w(1664525) + _w(1013904223)), _w(w * _w(1664525) + _w(1013904223))
    x = _w(x + _w(y * w))
    y = _w(y + _w(z * x))
    z = _w(z + _w(x * y))
    w = _w(w + _w(y * z))
    x, y = _w(x ^ (x >> _w(16))), _w(y ^ (y >> _w(16)))
    z, w = _w(z ^ (z >> _w(16))), _w(w ^ (w >> _w(16)))
    x = _w(x + _w(y * w))
    y = _w(y + _w(z * x))
    z = _w(z + _w(x * y))
    w = _w(w + _w(y * z))
    return x, y, z, w


def seed_salt(seed: int) -> int:
    """Return the hash of a seed, below 2^32, which `random_lanes` adds to twice the number of the vertex."""
    # Hash an array, because NumPy scalars warn of overflow.
    return int(hash_u32(np.array([(seed ^ (seed >> 32)) & 0xFFFFFFFF], np.uint32))[0])


@inner
def random_lanes(words, base, number, salt):  # type: ignore[no-untyped-def]
    """Write the seven random numbers of each lane's next vertex, and add 2 to `COUNT`.

    words : blocks, uint32, see `path_blocks`
    base : index of the block's first number; number : number of the pass; salt : `seed_salt` of the seed
    """
    base = unsigned(base)
    number, salt, one, bits = _w(number), _w(salt), _w(0x3F800000), _w(9)
    for lane in range(BLOCK_WIDTH):
        point, sample = words[base + KEY * _L + lane], words[base + SAMPLE * _L + lane]
        count = words[base + COUNT * _L + lane]
        words[base + COUNT * _L + lane] = _w(count + _w(2))
        x, y, z, w = mix4(point, sample, number, _w(salt + count))
        words[base + CHOICE * _L + lane] = x
        words[base + U_LIGHT * _L + lane] = _w((y >> bits) | one)
        words[base + W_LIGHT * _L + lane] = _w((z >> bits) | one)
        words[base + ROULETTE * _L + lane] = _w((w >> bits) | one)
        x, y, z, w = mix4(point, sample, number, _w(_w(salt + count) + _w(1)))
        words[base + LOBE * _L + lane] = x
        words[base + U_DIRECTION * _L + lane] = _w((y >> bits) | one)
        words[base + W_DIRECTION * _L + lane] = _w((z >> bits) | one)


@inner
def spread_lanes(words, base, sobol_points, number, salt):  # type: ignore[no-untyped-def]
    """Replace the random numbers of paths at their first vertex by stratified ones.

    The pair that samples a light and the pair that samples a direction are each replaced by a point of a
    (0,2)-sequence. The sequence is scrambled independently for each point, pass and pair.

    words : blocks, uint32, see `path_blocks`; base : index of the block's first number
    sobol_points : (n, 2) uint32, bit-reversed Sobol points; number, salt : see `random_lanes`
    """
    base = unsigned(base)
    for lane in range(BLOCK_WIDTH):
        if words[base + COUNT * _L + lane] == _w(2):
            sample = unsigned(words[base + SAMPLE * _L + lane])
            key = words[base + KEY * _L + lane]
            x, y, z, w = mix4(key, _w(0xFFFFFFFF), _w(number), _w(salt))
            words[base + U_LIGHT * _L + lane] = scrambled(sobol_points[sample, 0], x)
            words[base + W_LIGHT * _L + lane] = scrambled(sobol_points[sample, 1], y)
            words[base + U_DIRECTION * _L + lane] = scrambled(sobol_points[sample, 0], z)
            words[base + W_DIRECTION * _L + lane] = scrambled(sobol_points[sample, 1], w)


@inner
def scrambled(number, seed):  # type: ignore[no-untyped-def]
    """Scramble a bit-reversed Sobol number with `seed`; return the bits (uint32) of a float32 in [1, 2)."""
    return _w((reverse_bits(scramble_reversed(number, seed)) >> _w(9)) | _w(0x3F800000))
