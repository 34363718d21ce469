# mypy: disable-error-code="no-untyped-def"
"""Decodes the meshopt modes TRIANGLES and INDICES.

All numbers are unsigned with 32 bits and wrap around. Entries of the queues that were not written yet are
2^32 - 1, as in the decoder of meshoptimizer; the importer refuses this index later.

Based on: Khronos Group, KHR_meshopt_compression, appendix A, modes 1 and 2.
"""

from __future__ import annotations

import numpy as np

from baker.io.meshopt.status import BAD_CODE, DONE, TOO_LONG, TOO_SHORT
from baker.trace.jit import inner, kernel, scratch

_MASK = 0xFFFFFFFF
# Values of the four low bits of a code. From _BEFORE_LAST on, the third vertex is free: it is stored relative
# to the last free vertex. For _FREE, the data contains the difference; for the two smaller values, the
# difference is -1 and 1.
_BEFORE_LAST, _FREE = 13, 15
# The 16 latest edges and vertices.
_edge_queue = scratch((16, 2), np.int64)
_vertex_queue = scratch((16,), np.int64)
# Position in the data, next new vertex, last free vertex, number of pushed edges and of pushed vertices.
_state = scratch((5,), np.int64)
_POSITION, _NEXT, _LAST, _EDGES, _VERTICES = range(5)


@inner
def _read_number(source, end, state):
    """Return a number of one to five bytes with seven bits each, or -1 if data is missing.

    source : (N,) uint8, the stream; its data is before the position `end`
    state : (5,) int64, in and out; see `_state`
    """
    number = np.int64(0)
    for k in range(5):
        if state[_POSITION] >= end:
            return np.int64(-1)
        byte = np.int64(source[state[_POSITION]])
        state[_POSITION] += 1
        number |= (byte & 127) << (7 * k)
        if byte < 128:
            break
    return number & _MASK


@inner
def _unfold(code):
    """Return the signed number of a zigzag code."""
    return (code >> 1) ^ -(code & 1)


@inner
def _read_free(source, end, state):
    """Read a vertex that is stored relative to the last free one; return -1 if data is missing.

    source : (N,) uint8, the stream; its data is before the position `end`
    state : (5,) int64, in and out; see `_state`
    """
    code = _read_number(source, end, state)
    if code < 0:
        return np.int64(-1)
    state[_LAST] = (state[_LAST] + _unfold(code)) & _MASK
    return state[_LAST]


@inner
def _new_vertex(state):
    """Return the next vertex that no triangle has used.

    state : (5,) int64, in and out; see `_state`
    """
    vertex = state[_NEXT]
    state[_NEXT] = (vertex + 1) & _MASK
    return vertex


@inner
def _push_vertex(queue, state, vertex):
    """Append a vertex to the latest ones.

    queue : (16,) int64, in and out: the latest vertices
    state : (5,) int64, in and out; see `_state`
    """
    queue[state[_VERTICES] & 15] = vertex
    state[_VERTICES] += 1


@inner
def _push_edge(queue, state, a, b):
    """Append an edge to the latest ones.

    queue : (16, 2) int64, in and out: the latest edges
    state : (5,) int64, in and out; see `_state`
    """
    queue[state[_EDGES] & 15, 0] = a
    queue[state[_EDGES] & 15, 1] = b
    state[_EDGES] += 1


@inner
def _third_vertex(source, end, state, vertices, code):
    """Return the vertex that completes a known edge, or -1 if data is missing.

    source : (N,) uint8, the stream; its data is before the position `end`
    state : (5,) int64, in and out; see `_state`
    vertices : (16,) int64, in and out: the latest vertices
    """
    if 0 < code < _BEFORE_LAST:
        return vertices[(state[_VERTICES] - 1 - code) & 15]
    if code == 0:
        c = _new_vertex(state)
    elif code < _FREE:
        c = state[_LAST] = (state[_LAST] + 2 * code - 2 * _BEFORE_LAST - 1) & _MASK
    else:
        c = _read_free(source, end, state)
    _push_vertex(vertices, state, c)
    return c


@inner
def _corner(source, end, state, vertices, pushed, code):
    """Return a corner of a triangle without a known edge, or -1 if data is missing.

    source : (N,) uint8, the stream; its data is before the position `end`
    state : (5,) int64, in and out; see `_state`
    vertices : (16,) int64, the latest vertices
    pushed : number of vertices in the queue before the triangle
    """
    if code == 0:
        return _new_vertex(state)
    if code < _FREE:
        return vertices[(pushed - code) & 15]
    return _read_free(source, end, state)


@kernel
def decode_triangles(source, out):
    """Decode the indices of triangles.

    Parameters
    ----------
    source : (N,) uint8
        The stream, with its header byte; at least 17 + T bytes.
    out : (3 T,) uint16 or uint32
        The decoded indices.

    Returns
    -------
    int
        A value of `status`.
    """
    n_triangles, end = len(out) // 3, len(source) - 16
    edges, vertices, state = _edge_queue(), _vertex_queue(), _state()
    for k in range(16):
        edges[k, 0] = edges[k, 1] = vertices[k] = _MASK
    state[_POSITION] = 1 + n_triangles
    for t in range(n_triangles):
        code = np.int64(source[1 + t])
        if code < 0xF0:
            edge = (state[_EDGES] - 1 - (code >> 4)) & 15
            a, b = edges[edge, 0], edges[edge, 1]
            c = _third_vertex(source, end, state, vertices, code & 15)
            if c < 0:
                return TOO_SHORT
        else:
            first = np.int64(0)
            if code < 0xFE:
                pair = np.int64(source[end + (code & 15)])
                if pair >> 4 == _FREE or pair & 15 == _FREE:
                    return BAD_CODE
            else:
                if state[_POSITION] >= end:
                    return TOO_SHORT
                pair = np.int64(source[state[_POSITION]])
                state[_POSITION] += 1
                if pair == 0:
                    state[_NEXT] = 0
                if code == 0xFF:
                    first = np.int64(_FREE)
            y, z = pair >> 4, pair & 15
            pushed = state[_VERTICES]
            a = _corner(source, end, state, vertices, pushed, first)
            b = _corner(source, end, state, vertices, pushed, y)
            c = _corner(source, end, state, vertices, pushed, z)
            if a < 0 or b < 0 or c < 0:
                return TOO_SHORT
            _push_vertex(vertices, state, a)
            if y == 0 or y == _FREE:
                _push_vertex(vertices, state, b)
            if z == 0 or z == _FREE:
                _push_vertex(vertices, state, c)
            _push_edge(edges, state, b, a)
        _push_edge(edges, state, c, b)
        _push_edge(edges, state, a, c)
        out[3 * t], out[3 * t + 1], out[3 * t + 2] = a, b, c
    return DONE if state[_POSITION] == end else TOO_LONG


@kernel
def decode_indices(source, out):
    """Decode any sequence of indices.

    Parameters
    ----------
    source : (N,) uint8
        The stream, with its header byte.
    out : (M,) uint16 or uint32
        The decoded indices.

    Returns
    -------
    int
        A value of `status`.
    """
    end, state = len(source) - 4, _state()
    state[_POSITION] = 1
    # Each index is relative to the latest one of two sequences.
    even = odd = np.int64(0)
    for k in range(len(out)):
        code = _read_number(source, end, state)
        if code < 0:
            return TOO_SHORT
        delta = _unfold(code >> 1)
        if code & 1:
            odd = (odd + delta) & _MASK
            out[k] = odd
        else:
            even = (even + delta) & _MASK
            out[k] = even
    return DONE if state[_POSITION] == end else TOO_LONG
