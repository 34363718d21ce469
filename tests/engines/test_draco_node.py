"""Compares decoded Draco meshes with those of npm's draco3dgltf, on many random meshes."""

from __future__ import annotations

import base64
import json
import subprocess
from pathlib import Path

import pytest

from baker.io.draco.decoder import DracoDecoder

HERE = Path(__file__).parent
pytestmark = pytest.mark.engines


def test_random_meshes_are_equal_bit_by_bit():
    command = ["node", HERE / "draco_streams.mjs", HERE / "node_modules", "200", "1", "40"]
    streams = json.loads(subprocess.run(command, check=True, stdout=subprocess.PIPE).stdout)
    seen = set()
    with DracoDecoder() as decoder:
        for case in streams:
            mesh = decoder.decode(base64.b64decode(case["stream"]), 1 << 20)
            assert mesh.faces.tobytes() == base64.b64decode(case["faces"])
            for attribute in case["attributes"]:
                value = mesh.attributes[attribute["id"]]
                assert (value.dtype.name, value.shape[1]) == (attribute["dtype"], attribute["width"])
                assert value.tobytes() == base64.b64decode(attribute["data"])
                seen.add(value.dtype.name)
    assert seen == {"int8", "uint8", "int16", "uint16", "uint32", "float32"}
