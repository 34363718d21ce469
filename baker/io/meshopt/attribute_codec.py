# mypy: disable-error-code="no-untyped-def"
"""Decodes the meshopt mode ATTRIBUTES, versions 0 and 1.

Elements are stored in blocks of at most 8192 bytes. A block stores one plane for each byte of an element; a
plane stores the differences to the previous element in groups of 16.

Based on: Khronos Group, KHR_meshopt_compression, appendix A, mode 0.
"""

from __future__ import annotations

import numpy as np

from baker.io.meshopt.status import BAD_CODE, DONE, TOO_LONG, TOO_SHORT
from baker.trace.jit import inner, kernel, scratch, smaller

# Largest number of bytes and of elements in a block, and number of elements in a group.
BLOCK_BYTES, BLOCK_ELEMENTS, GROUP = 8192, 256, 16
_planes = scratch((BLOCK_BYTES,), np.uint8)
_previous = scratch((256,), np.uint8)


@inner
def _read_group(source, position, end, bits, plane, first):
    """Decode 16 differences of `bits` bits into `plane`; return the next position, or -1 if data is missing.

    A value with all bits set means that the difference follows as a byte.

    source : (N,) uint8, the stream; its planes are before the position `end`
    plane : (8192,) uint8, out: 16 differences from index `first` on
    """
    if bits == 0:
        for k in range(GROUP):
            plane[first + k] = 0
        return position
    body = position + 2 * bits
    if body > end:
        return -1
    if bits == 8:
        for k in range(GROUP):
            plane[first + k] = source[position + k]
        return body
    escape = (1 << bits) - 1
    per_byte = 8 // bits
    for k in range(GROUP):
        packed = np.int64(source[position + k // per_byte])
        # One bit: the first value is in the lowest bit. Two and four bits: it is in the highest bits.
        rank = k % per_byte
        shift = rank if bits == 1 else 8 - bits - rank * bits
        value = (packed >> shift) & escape
        if value == escape:
            if body >= end:
                return -1
            value = np.int64(source[body])
            body += 1
        plane[first + k] = value
    return body


@inner
def _read_plane(source, position, end, mode, count, plane, first):
    """Decode the differences of one byte of `count` elements; return the next position, or -1.

    source : (N,) uint8, the stream; its planes are before the position `end`
    mode : -1 version 0; 0 to 3 control mode of version 1
    plane : (8192,) uint8, out: the differences from index `first` on
    """
    if mode == 2:
        for k in range(count):
            plane[first + k] = 0
        return position
    if mode == 3:
        if position + count > end:
            return -1
        for k in range(count):
            plane[first + k] = source[position + k]
        return position + count
    groups = (count + GROUP - 1) // GROUP
    header = position
    position += (groups + 3) // 4
    if position > end:
        return -1
    for group in range(groups):
        code = (np.int64(source[header + group // 4]) >> (2 * (group % 4))) & 3
        # Bits: version 0 has 0 2 4 8, control mode 0 has 0 1 2 4, and control mode 1 has 1 2 4 8.
        power = code - 1 if mode == 0 else code
        bits = 0 if code == 0 and mode != 1 else 1 << power
        position = _read_group(source, position, end, bits, plane, first + GROUP * group)
        if position < 0:
            return -1
    return position


@inner
def _add_bytes(plane, step, count, previous, byte, stride, out, base):
    """Channel mode 0: add zigzag-coded differences of one byte of each element.

    plane : (8192,) uint8, differences of the block; those of byte b of all elements begin at b x `step`
    previous : (256,) uint8, in and out: the last element before the block, and of the block
    out : (N,) uint8, out: decoded elements; the block begins at element `base`
    """
    value = np.int64(previous[byte])
    for k in range(count):
        code = np.int64(plane[byte * step + k])
        value = (value + ((code >> 1) ^ -(code & 1))) & 0xFF
        out[(base + k) * stride + byte] = value
    previous[byte] = value


@inner
def _add_words(plane, step, count, previous, byte, stride, out, base):
    """Channel mode 1: add zigzag-coded differences of a 16-bit number of each element.

    plane : (8192,) uint8, differences of the block; those of byte b of all elements begin at b x `step`
    previous : (256,) uint8, in and out: the last element before the block, and of the block
    out : (N,) uint8, out: decoded elements; the block begins at element `base`
    """
    value = np.int64(previous[byte]) | np.int64(previous[byte + 1]) << 8
    for k in range(count):
        code = np.int64(plane[byte * step + k]) | np.int64(plane[(byte + 1) * step + k]) << 8
        value = (value + ((code >> 1) ^ -(code & 1))) & 0xFFFF
        at = (base + k) * stride + byte
        out[at] = value & 0xFF
        out[at + 1] = value >> 8
    previous[byte] = value & 0xFF
    previous[byte + 1] = value >> 8


@inner
def _mix_words(plane, step, count, previous, byte, turn, stride, out, base):
    """Channel mode 2: exclusive or with rotated 32-bit numbers.

    plane : (8192,) uint8, differences of the block; those of byte b of all elements begin at b x `step`
    previous : (256,) uint8, in and out: the last element before the block, and of the block
    out : (N,) uint8, out: decoded elements; the block begins at element `base`
    """
    value = np.int64(0)
    for part in range(4):
        value |= np.int64(previous[byte + part]) << (8 * part)
    for k in range(count):
        code = np.int64(0)
        for part in range(4):
            code |= np.int64(plane[(byte + part) * step + k]) << (8 * part)
        value ^= ((code >> turn) | (code << (32 - turn))) & 0xFFFFFFFF
        for part in range(4):
            out[(base + k) * stride + byte + part] = (value >> (8 * part)) & 0xFF
    for part in range(4):
        previous[byte + part] = (value >> (8 * part)) & 0xFF


@kernel
def decode_attributes(source, count, stride, version, out):
    """Decode elements.

    Parameters
    ----------
    source : (N,) uint8
        The stream, with its header byte.
    count : int
        Number of elements, at least 1.
    stride : int
        Bytes of an element, a multiple of 4 up to 256.
    version : int
        0 or 1, from the header byte.
    out : (count x stride,) uint8
        The decoded elements.

    Returns
    -------
    int
        A value of `status`.
    """
    channels = stride // 4
    tail = stride + channels * version
    end = len(source) - (tail if tail > 32 - 8 * version else 32 - 8 * version)
    last = len(source) - tail
    previous, plane = _previous(), _planes()
    for byte in range(stride):
        previous[byte] = source[last + byte]
    for channel in range(channels * version):
        mode = source[last + stride + channel]
        if (mode & 15) > 2 or ((mode & 15) < 2 and mode > 15):
            return BAD_CODE
    step = smaller(BLOCK_ELEMENTS, BLOCK_BYTES // stride // GROUP * GROUP)
    position, base = 1, 0
    while base < count:
        size = smaller(step, count - base)
        control = position
        position += channels * version
        if position > end:
            return TOO_SHORT
        for byte in range(stride):
            mode = -1
            if version == 1:
                mode = (np.int64(source[control + byte // 4]) >> (2 * (byte % 4))) & 3
            position = _read_plane(source, position, end, mode, size, plane, byte * step)
            if position < 0:
                return TOO_SHORT
        for channel in range(channels):
            mode = np.int64(source[last + stride + channel]) if version == 1 else 0
            byte = 4 * channel
            if mode == 0:
                for part in range(4):
                    _add_bytes(plane, step, size, previous, byte + part, stride, out, base)
            elif mode == 1:
                _add_words(plane, step, size, previous, byte, stride, out, base)
                _add_words(plane, step, size, previous, byte + 2, stride, out, base)
            else:
                _mix_words(plane, step, size, previous, byte, mode >> 4, stride, out, base)
        base += size
    return DONE if position == end else TOO_LONG
