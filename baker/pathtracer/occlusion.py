"""Casts cosine-weighted occlusion rays from surface points; `verify` compares bakes with the result.

A packet holds one ray from each of eight neighbouring points, all with the same sample number. The leading
bits of the random numbers of a sample are the same for all points (`kernels.sampling.shared_bits_mask`), so
the eight rays are nearly parallel. If the points are also close together, the packet is traced with Embree's
coherent flag, which makes tracing faster. In each loop over lanes that only does arithmetic, all operands are
in one array. Otherwise the compiler would not vectorize a loop of eight iterations (see `path_blocks`).

Based on: Morton, A computer oriented geodetic data base and a new technique in file sequencing, 1966.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from baker.kernels.sampling import cosine_direction, reverse_bits, scramble_reversed
from baker.pathtracer.path_blocks import (
    ALIVE,
    BITANGENT,
    BLOCK_WIDTH,
    CHOICE,
    KEY,
    LOBE,
    NORMAL,
    SHADED,
    TANGENT,
    U_DIRECTION,
    VALUE,
    W_DIRECTION,
)
from baker.pathtracer.rng import mix4
from baker.pathtracer.vertex_simd import start_vertices
from baker.trace.jit import inner, kernel, larger, smaller
from baker.trace.packets import DIR_X, DIR_Y, DIR_Z, ORG_X, TFAR, call_embree_with

_f = np.float32
_w = np.uint32
_ZERO, _ONE = _f(0.0), _f(1.0)
_L = BLOCK_WIDTH
# A packet is traced as coherent if the extent of its origins is below `_ALIKE` times the smaller of two
# lengths. One is the ray length. The other is a tenth of the scene's diagonal, `_FAR` times
# `Surfaces.min_offset_scale`.
_ALIKE, _FAR = _f(0.125), _f(100.0)
# Approximate number of points that `are_dense` examines.
_LOOK = 128
# For each number of ten bits: the number with two zero bits inserted between neighbouring bits.
_SPREAD = np.sum([(np.arange(1024) >> bit & 1) << 3 * bit for bit in range(10)], axis=0)


def alike_within(max_distance: np.float32, min_offset_scale: np.float32) -> np.float32:
    """Return the extent, metres, of a packet's ray origins below which the packet is traced as coherent.

    max_distance : metres, length of the rays; min_offset_scale : metres, see `Surfaces`
    """
    return np.float32(_ALIKE * min(max_distance, _FAR * min_offset_scale))


def are_dense(position: NDArray[np.float64], alike: float) -> bool:
    """Return whether most points (n, 3) are closer than `alike`, metres, to the next point of the array.

    The distance of two points is the largest of its three components. About `_LOOK` points, evenly
    distributed over the array, are examined. Sorting with `near_together` saves time only if the result is
    True, because packets of distant points are not traced as coherent.
    """
    first = np.arange(0, len(position) - 1, max(len(position) // _LOOK, 1))
    step = abs(position[first + 1] - position[first]).max(axis=1)
    return bool(2 * np.count_nonzero(step < alike) > len(first))


def near_together(position: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return the order (m,) of m > 0 points (m, 3) along a Morton curve."""
    low = position.min(axis=0)
    side = max(float((position.max(axis=0) - low).max()), 1.0e-30)
    cell = ((position - low) * ((len(_SPREAD) - 0.5) / side)).astype(np.int64)
    key = _SPREAD[cell[:, 0]] | _SPREAD[cell[:, 1]] << 1 | _SPREAD[cell[:, 2]] << 2
    # Each key contains the index of its point, because `np.sort` is faster than `np.argsort`.
    return np.sort(key << 32 | np.arange(len(position))) & 0xFFFFFFFF


@inner
def seed_lanes(words, name, group, number, salt):  # type: ignore[no-untyped-def]
    """Write the two scramble seeds of points `group` to `group` + 7, to rows CHOICE and LOBE.

    words : block, uint32; name (m,) int64, number, salt : see `open_rays`
    """
    for lane in range(min(BLOCK_WIDTH, len(name) - group)):
        words[KEY * _L + lane] = name[group + lane]
    for lane in range(BLOCK_WIDTH):
        x, y, _, _ = mix4(words[KEY * _L + lane], _w(0xFFFFFFFE), _w(number), _w(salt))
        words[CHOICE * _L + lane], words[LOBE * _L + lane] = x, y


@inner
def number_lanes(words, first, second, shared):  # type: ignore[no-untyped-def]
    """Write a pair of random numbers in [1, 2) for each lane, to rows U_DIRECTION and W_DIRECTION.

    The numbers are scrambled while they are bit-reversed. Bits that the mask `shared` selects are copied from
    (first, second). The other bits are scrambled with the lane's seeds.

    words : block, uint32; first, second : uint32, a bit-reversed Sobol point
    shared : uint32, see `open_rays`
    """
    one, bits, own = _w(0x3F800000), _w(9), _w(~shared)
    for lane in range(BLOCK_WIDTH):
        x = scramble_reversed(first, words[CHOICE * _L + lane])
        y = scramble_reversed(second, words[LOBE * _L + lane])
        x = reverse_bits(_w((x & own) | (first & shared)))
        y = reverse_bits(_w((y & own) | (second & shared)))
        words[U_DIRECTION * _L + lane], words[W_DIRECTION * _L + lane] = (
            _w((x >> bits) | one),
            _w((y >> bits) | one),
        )


@inner
def copy_points(s, position, normal, face_normal, group, k):  # type: ignore[no-untyped-def]
    """Copy position k and its normals, of points `group` to `group` + 7, into the lanes.

    s : block, float32; position, normal, face_normal : (m, n_positions, 3) float64, see `open_rays`
    """
    for lane in range(min(BLOCK_WIDTH, len(position) - group)):
        for a in range(3):
            s[(ORG_X + a) * _L + lane] = position[group + lane, k, a]
            s[(SHADED + a) * _L + lane] = normal[group + lane, k, a]
            s[(NORMAL + a) * _L + lane] = face_normal[group + lane, k, a]


@inner
def extent(s, lanes):  # type: ignore[no-untyped-def]
    """Return the largest extent, metres, along any axis, of the ray origins of the first `lanes` lanes.

    s : block, float32
    """
    most = _ZERO
    for a in range(3):
        low = high = s[(ORG_X + a) * _L]
        for lane in range(1, lanes):
            low, high = smaller(low, s[(ORG_X + a) * _L + lane]), larger(high, s[(ORG_X + a) * _L + lane])
        most = larger(most, high - low)
    return most


@inner
def point_lanes(s, max_distance):  # type: ignore[no-untyped-def]
    """Write a ray of cosine-weighted direction and length `max_distance` to each lane.

    `ALIVE` becomes 1, or 0 if the direction points below the triangle. `count_lanes` treats the ray as
    occluded then.

    s : block, float32
    """
    for lane in range(BLOCK_WIDTH):
        a, b, c = cosine_direction(s[U_DIRECTION * _L + lane] - _ONE, s[W_DIRECTION * _L + lane] - _ONE)
        dx = a * s[TANGENT * _L + lane] + b * s[BITANGENT * _L + lane] + c * s[SHADED * _L + lane]
        dy = (
            a * s[(TANGENT + 1) * _L + lane]
            + b * s[(BITANGENT + 1) * _L + lane]
            + c * s[(SHADED + 1) * _L + lane]
        )
        dz = (
            a * s[(TANGENT + 2) * _L + lane]
            + b * s[(BITANGENT + 2) * _L + lane]
            + c * s[(SHADED + 2) * _L + lane]
        )
        above = (
            dx * s[NORMAL * _L + lane] + dy * s[(NORMAL + 1) * _L + lane] + dz * s[(NORMAL + 2) * _L + lane]
        )
        s[DIR_X * _L + lane], s[DIR_Y * _L + lane], s[DIR_Z * _L + lane] = dx, dy, dz
        s[TFAR * _L + lane] = max_distance
        s[ALIVE * _L + lane] = _ONE if above > _ZERO else _ZERO


@inner
def count_lanes(s):  # type: ignore[no-untyped-def]
    """Add 1 to `VALUE` of each lane whose ray has no hit and points above the triangle.

    s : block, float32
    """
    for lane in range(BLOCK_WIDTH):
        s[VALUE * _L + lane] += s[ALIVE * _L + lane] if s[TFAR * _L + lane] >= _ZERO else _ZERO


@kernel
def open_rays(  # type: ignore[no-untyped-def]
    position,
    normal,
    face_normal,
    name,
    memory,
    arguments,
    sobol_points,
    shared,
    max_distance,
    alike,
    sizes,
    number,
    salt,
    out,
):
    """Cast n cosine-weighted rays from each of m points, and add the number without a hit to `out`.

    position, normal, face_normal : (m, n_positions, 3) float64, n_positions positions of each point, with
        shading and geometric normals. Sample s of pass p starts at position (p n + s) modulo n_positions.
        Tracing is fastest if consecutive points are close together
    name : (m,) int64, numbers of the points, on which their random numbers depend
    memory : `PathMemory`
    arguments : (2, 5) int64, from `packets.arguments_of`; row 0 for incoherent, row 1 for coherent packets
    sobol_points : (n, 2) uint32, bit-reversed Sobol points of the n samples of a pass
    shared : uint32, mask that selects the bits of bit-reversed random numbers that are the same for all
        points
    max_distance : float32, metres, length of the rays
    alike : float32, metres, from `alike_within`
    sizes : (2,) float32, metres, `Surfaces.min_offset_scale` and `.default_size`
    number : number of the pass; salt : `seed_salt` of the seed; out : (m, 1) float64, output
    """
    scene, occluded = memory.scene, memory.occluded
    on, s, words = memory.on, memory.s, memory.words
    samples, n_positions = len(sobol_points), position.shape[1]
    for group in range(0, len(position), BLOCK_WIDTH):
        lanes = min(BLOCK_WIDTH, len(position) - group)
        seed_lanes(words, name, group, number, salt)
        for lane in range(BLOCK_WIDTH):
            on[lane] = -1 if lane < lanes else 0
            s[VALUE * BLOCK_WIDTH + lane] = _ZERO
        for sample in range(samples):
            k = (number * samples + sample) % n_positions
            if sample == 0 or n_positions > 1:
                copy_points(s, position, normal, face_normal, group, k)
                start_vertices(s, 0, sizes[0], sizes[1])
            if sample == 0:
                packet_arguments = arguments[1] if extent(s, lanes) < alike else arguments[0]
            number_lanes(words, sobol_points[sample, 0], sobol_points[sample, 1], shared)
            point_lanes(s, max_distance)
            call_embree_with(occluded, on, scene, s, packet_arguments)
            count_lanes(s)
        for lane in range(lanes):
            out[group + lane, 0] += s[VALUE * BLOCK_WIDTH + lane]
