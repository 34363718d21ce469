"""The shortcuts that checks take in scenes of many objects agree with simple implementations."""

from __future__ import annotations

import numpy as np
import pytest

from baker.checks.context import CheckContext
from baker.checks.rules.light_sources import albedos
from baker.checks.sorted_points import SortedPoints
from baker.core.material_flags import flag_of_faces
from baker.core.scene import Material
from baker.core.settings import BakeSettings
from baker.io.load import load_scene


@pytest.mark.parametrize("seed", range(5))
def test_points_in_a_box_are_those_of_a_test_of_all_points(seed):
    random = np.random.default_rng(seed)
    points = random.normal(size=(200, 3)) * random.permutation([1.0, 5.0, 20.0])
    owner = random.integers(0, 10, 200)
    low, high = np.sort(random.normal(size=(2, 3)) * 8.0, axis=0)
    expected = points[((points >= low) & (points <= high)).all(axis=1) & (owner != 3)]
    found = SortedPoints(points, owner).within(low, high, 3)
    assert sorted(map(tuple, found)) == sorted(map(tuple, expected))


def test_no_points():
    none = SortedPoints(np.zeros((0, 3)), np.zeros(0, np.int64))
    assert none.within(np.full(3, -np.inf), np.full(3, np.inf), 0).shape == (0, 3)


def test_flags_are_read_only_from_materials_that_occur():
    materials = [Material(name=str(k), double_sided=k == 2) for k in range(4)]
    read = []

    def flag(material):
        read.append(material.name)
        return material.double_sided

    assert flag_of_faces(materials, np.array([2, 0, 2], np.int32), flag).tolist() == [True, False, True]
    assert read == ["0", "2"]
    assert flag_of_faces(materials, np.zeros(0, np.int32), flag).tolist() == []


def test_vertex_colours_count_for_the_albedo_of_their_own_material(tmp_path):
    (tmp_path / "two.mtl").write_text("newmtl a\nKd 0.9 0.9 0.9\nnewmtl b\nKd 0.8 0.8 0.8\n")
    corners = "v 0 0 0 0.5 0.5 0.5\nv 1 0 0 0.5 0.5 0.5\nv 1 0 1 0.5 0.5 0.5\n"
    text = f"mtllib two.mtl\n{corners}{corners.replace('0.5', '1')}"
    (tmp_path / "two.obj").write_text(f"{text}o p\nusemtl a\nf 1 3 2\no q\nusemtl b\nf 4 6 5\n")
    context = CheckContext(load_scene(tmp_path / "two.obj", lenient=True), BakeSettings())
    assert albedos(context)[:2] == pytest.approx([0.9 * 0.2140411, 0.8], rel=1e-4)
    assert context.mesh_with == {0: 0, 1: 1}
    assert context.node_named == {"p": 0, "q": 1}
