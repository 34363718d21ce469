"""Streams that npm's meshoptimizer encoded are decoded, and broken streams are refused."""

from __future__ import annotations

import base64
import json
from pathlib import Path

import numpy as np
import pytest
from meshopt_writer import pack_indices

from baker.io.meshopt.stream import Layout, StreamError, decode_stream

# The output of `node tests/engines/meshopt_streams.mjs NODE_MODULES 60 1 30`.
STREAMS = json.loads(Path(__file__).with_name("streams.json").read_text("utf-8"))


def stream(case):
    layout = Layout(case["mode"], case["filter"], case["count"], case["stride"])
    encoded, decoded = (
        np.frombuffer(base64.b64decode(case[key]), np.uint8) for key in ("encoded", "decoded")
    )
    return encoded, layout, decoded


def test_streams_are_decoded_bit_by_bit():
    seen = set()
    for case in STREAMS:
        encoded, layout, decoded = stream(case)
        assert np.array_equal(decode_stream(encoded, layout), decoded), layout
        seen.add((layout.mode, layout.filter, encoded[0] & 1))
    filters = ("NONE", "OCTAHEDRAL", "QUATERNION", "EXPONENTIAL", "COLOR")
    assert {("ATTRIBUTES", name, version) for name in filters for version in (0, 1)} <= seen
    assert {("TRIANGLES", "NONE", 1), ("INDICES", "NONE", 1)} <= seen


def test_streams_of_another_length_are_refused():
    for case in STREAMS:
        encoded, layout, _ = stream(case)
        for end in {0, 1, len(encoded) // 2, len(encoded) - 1}:
            with pytest.raises(StreamError):
                decode_stream(encoded[:end], layout)
        # The first byte twice: the stream is one byte longer, but its head is valid.
        longer = np.concatenate([encoded[:1], encoded[:1], encoded[1:]])
        assert not is_equal_to(longer, layout, encoded)


def is_equal_to(changed, layout, encoded):
    try:
        return np.array_equal(decode_stream(changed, layout), decode_stream(encoded, layout))
    except StreamError:
        return False


def test_changed_bytes_never_read_outside_the_stream():
    rng = np.random.default_rng(0)
    refused = 0
    for case in STREAMS * 8:
        encoded, layout, _ = stream(case)
        changed = encoded.copy()
        for at in rng.integers(len(changed), size=3):
            changed[at] = rng.integers(256)
        try:
            assert len(decode_stream(changed, layout)) == layout.elements * layout.stride
        except StreamError:
            refused += 1
    assert refused > len(STREAMS)


@pytest.mark.parametrize("mode", ["ATTRIBUTES", "TRIANGLES", "INDICES"])
def test_huge_counts_are_refused_before_memory_is_allocated(mode):
    head = {"ATTRIBUTES": 0xA1, "TRIANGLES": 0xE1, "INDICES": 0xD1}[mode]
    data = np.zeros(1000, np.uint8)
    data[0] = head
    with pytest.raises(StreamError, match="cut off"):
        decode_stream(data, Layout(mode, "NONE", 3 << 40, 4))


@pytest.mark.parametrize(
    ("layout", "words"),
    [
        (Layout("POINTS", "NONE", 3, 4), "'POINTS' is no mode"),
        (Layout("ATTRIBUTES", "BLUR", 3, 4), "'BLUR' is no filter"),
        (Layout("ATTRIBUTES", "NONE", 3, 6), "multiple of 4"),
        (Layout("ATTRIBUTES", "NONE", 3, 260), "multiple of 4"),
        (Layout("ATTRIBUTES", "QUATERNION", 3, 4), "QUATERNION does not exist"),
        (Layout("INDICES", "COLOR", 3, 4), "has no filter"),
        (Layout("INDICES", "NONE", 3, 8), "must be 2 or 4"),
        (Layout("TRIANGLES", "NONE", 4, 4), "whole number of triangles"),
        (Layout("TRIANGLES", "NONE", 3, 4), "no stream of the mode TRIANGLES"),
    ],
)
def test_impossible_layouts_are_named(layout, words):
    with pytest.raises(StreamError, match=words):
        decode_stream(np.frombuffer(pack_indices(bytes(12), 4), np.uint8), layout)


def test_the_table_of_vertex_pairs_is_checked():
    """Code 15, an index that is stored in the data, is forbidden in the table by the specification."""
    valid = np.frombuffer(b"\xe1\xf0" + bytes(16), np.uint8)
    assert decode_stream(valid, Layout("TRIANGLES", "NONE", 3, 2)).view("<u2").tolist() == [0, 1, 2]
    changed = np.frombuffer(b"\xe1\xf0\xf0" + bytes(15), np.uint8)
    with pytest.raises(StreamError, match="unknown code"):
        decode_stream(changed, Layout("TRIANGLES", "NONE", 3, 2))
