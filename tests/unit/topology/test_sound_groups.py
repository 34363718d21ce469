"""Groups without defects are found together, and each defect makes its own group unsound."""

from __future__ import annotations

import numpy as np
import pytest

from baker.core.scene import Material
from baker.core.source_mesh import SourcePrimitive
from baker.io.mesh import build
from baker.io.mesh.build import build_mesh, sound_meshes

SQUARE = np.float32([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
TRIANGLE = np.int64([[0, 1, 2], [0, 2, 3]])


def primitive(position=SQUARE, triangle=TRIANGLE, **more):
    return SourcePrimitive(0, 0, np.float32(position), np.int64(triangle), **more)


DEFECTS = {
    "index": primitive(triangle=[[0, 1, 2], [0, 2, 4]]),
    "negative index": primitive(triangle=[[0, 1, 2], [0, 2, -1]]),
    "no number": primitive(SQUARE * [1, np.nan, 1]),
    "huge": primitive(SQUARE * 1e30),
    "no area": primitive(triangle=[[0, 1, 2], [0, 1, 1]]),
    "duplicate": primitive(triangle=[[0, 1, 2], [1, 2, 0]]),
    "duplicate by position": primitive(np.concatenate([SQUARE, SQUARE]), [[0, 1, 2], [4, 5, 6]]),
    "opposite winding": primitive(triangle=[[0, 1, 2], [0, 2, 1]]),
    "strip": primitive(stitched=True),
}


@pytest.mark.parametrize("defect", DEFECTS)
@pytest.mark.parametrize("batch", [1, 10, 1 << 17])
def test_a_defect_is_found_among_equal_sound_meshes(monkeypatch, defect, batch):
    monkeypatch.setattr(build, "_BATCH", batch)
    meshes = [
        [primitive()],
        [primitive(), primitive(SQUARE + np.float32(1))],
        [],
        [DEFECTS[defect]],
        [primitive()],
    ]
    found = sound_meshes(meshes)
    assert not found[3]
    if batch == 1:
        assert found[:2] == [True, True]
        assert found[4]


def test_sound_meshes_are_built_as_others():
    meshes = [[primitive(SQUARE + np.float32(k))] for k in range(5)]
    assert sound_meshes(meshes) == [True] * 5
    assert sound_meshes([]) == []
    for (one,) in meshes:
        fast, _ = build_mesh("a", [one], [Material()], sound=True)
        slow, _ = build_mesh("a", [one], [Material()])
        for name in ("position", "normal", "triangle", "material", "source_vertex"):
            np.testing.assert_array_equal(getattr(fast, name), getattr(slow, name))
