"""Decodes meshes that npm's draco3dgltf encoded (`tests/engines/draco_streams.mjs`), and broken ones."""

from __future__ import annotations

import base64
import json
from pathlib import Path

import numpy as np
import pytest

from baker.io.draco import decoder as draco
from baker.io.draco.decoder import DracoDecoder, DracoError

# Printed by `node draco_streams.mjs NODE_MODULES 12 3 5`.
STREAMS = json.loads(Path(__file__).with_name("streams.json").read_text("utf-8"))


@pytest.fixture(scope="module")
def decoder():
    with DracoDecoder() as made:
        yield made


def test_meshes_are_decoded_bit_by_bit(decoder):
    for case in STREAMS:
        mesh = decoder.decode(base64.b64decode(case["stream"]), 1 << 16)
        assert mesh.faces.tobytes() == base64.b64decode(case["faces"])
        assert len(mesh.attributes) == len(case["attributes"])
        for attribute in case["attributes"]:
            value = mesh.attributes[attribute["id"]]
            assert (value.dtype.name, value.shape[1]) == (attribute["dtype"], attribute["width"])
            assert value.tobytes() == base64.b64decode(attribute["data"])


def test_broken_meshes_end_with_a_reason(decoder):
    rng = np.random.default_rng(0)
    reasons = set()
    for case in STREAMS * 4:
        data = bytearray(base64.b64decode(case["stream"]))
        for at in rng.integers(len(data), size=4):
            data[at] = rng.integers(256)
        try:
            decoder.decode(bytes(data), 1 << 16)
        except DracoError as error:
            reasons.add(str(error))
    assert "the data is no Draco mesh" in reasons
    assert decoder.decode(base64.b64decode(STREAMS[0]["stream"]), 1 << 16).faces.shape == (8, 3)


def test_a_decoder_that_ends_is_started_again(decoder, monkeypatch):
    """Without memory or time the child process ends, and the next mesh is decoded by a new one."""
    monkeypatch.setattr(draco, "_WALL", 0.0)
    data = base64.b64decode(STREAMS[0]["stream"]) * 500000
    with pytest.raises(DracoError, match="the decoder ended"):
        decoder.decode(data, 1 << 16)
    monkeypatch.undo()
    assert len(decoder.decode(base64.b64decode(STREAMS[0]["stream"]), 1 << 16).faces) == 8


def test_a_missing_package_is_named(decoder, monkeypatch):
    monkeypatch.setattr(draco.importlib.util, "find_spec", lambda name: None)
    with pytest.raises(DracoError, match="pip install DracoPy"):
        decoder.decode(base64.b64decode(STREAMS[0]["stream"]), 1 << 16)
