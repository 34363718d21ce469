"""Compares the decoder of meshopt streams with that of npm's meshoptimizer, on many random streams."""

from __future__ import annotations

import base64
import json
import subprocess
from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from baker.io.meshopt.stream import Layout, decode_stream

HERE = Path(__file__).parent
pytestmark = pytest.mark.engines


@pytest.mark.parametrize("seed", [1, 2])
def test_random_streams_are_equal_bit_by_bit(seed):
    command = ["node", HERE / "meshopt_streams.mjs", HERE / "node_modules", "600", str(seed), "3000"]
    streams = json.loads(subprocess.run(command, check=True, stdout=subprocess.PIPE).stdout)
    seen = Counter()
    for case in streams:
        layout = Layout(case["mode"], case["filter"], case["count"], case["stride"])
        encoded, decoded = (
            np.frombuffer(base64.b64decode(case[k]), np.uint8) for k in ("encoded", "decoded")
        )
        assert np.array_equal(decode_stream(encoded, layout), decoded), layout
        seen[layout.mode, layout.filter, int(encoded[0])] += 1
    # Two versions of ATTRIBUTES with five filters each, and two modes of indices.
    assert len(seen) == 12
    assert min(seen.values()) >= 5
