"""Compressed versions of a scene load as the original, up to the rounding that the compressor applied."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import baker

ROOT = Path(__file__).parents[2]
ORIGINAL = ROOT / "assets" / "cornell.glb"
# gltfpack rounds positions to 14 bits of a mesh's size, and Draco to 14 bits as well; half a step of 2 m.
STEP = 2.0 / (1 << 14)


def corners(scene):
    """Return the sorted world-space corners of all triangles."""
    found = []
    for instance in scene.instances:
        mesh = scene.meshes[instance.mesh]
        matrix = instance.world_from_object
        found.append((mesh.position @ matrix[:3, :3].T + matrix[:3, 3])[mesh.triangle].reshape(-1, 3))
    every = np.concatenate(found)
    return every[np.lexsort(np.round(every, 2).T)]


@pytest.mark.parametrize("kind", ["ext", "khr", "edgebreaker", "sequential"])
def test_a_compressed_scene_is_the_original(kind):
    before, after = baker.load(ORIGINAL), baker.load(ROOT / "tests" / "compressed" / f"cornell.{kind}.glb")
    assert not after.warnings
    assert np.abs(corners(before) - corners(after)).max() < 1.5 * STEP
    assert {light.name for light in after.lights} == {light.name for light in before.lights}
    for a, b in zip(*(sorted(s.materials, key=lambda m: m.name) for s in (before, after)), strict=True):
        assert a.name == b.name
        # gltfpack writes three digits.
        assert np.allclose((*a.base_colour, *a.emission), (*b.base_colour, *b.emission), rtol=1e-3)
    assert not {name for name in after.source.json.get("extensionsUsed", []) if "compression" in name}
