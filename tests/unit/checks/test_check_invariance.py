"""Moving, re-indexing or splitting a scene does not change the findings of `check`."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest
from flawed_scenes import BOX, BOX_TRIANGLE, CUBE, CUBE_TRIANGLE, FLIPPED, GRID, SQUARE
from gltf_builder import GltfBuilder, write

from baker.checks.run import check_scene
from baker.checks.settings import CheckSettings
from baker.core.settings import BakeSettings

# (position, triangle) of each part: two intersecting cubes, a cube that is inside out, a box with a hole, a
# grid with a flipped triangle, a sliver, a triangle without area, and a duplicate triangle.
SLIVER = np.float32([[0, 0, 0], [1, 0, 0], [1, 0.0004, 0]])
PARTS = [
    (CUBE, CUBE_TRIANGLE),
    (CUBE * 0.5 + np.float32([0.7, 0.3, 0.2]), CUBE_TRIANGLE),
    (CUBE + np.float32([5, 0, 0]), CUBE_TRIANGLE[:, ::-1]),
    (BOX + np.float32([9, 0, 0]), BOX_TRIANGLE[1:]),
    (GRID + np.float32([0, 5, 0]), FLIPPED),
    (SLIVER + np.float32([3, 3, 3]), [[0, 1, 2]]),
    (GRID[:3] + np.float32([0, -3, 0]), [[0, 1, 1]]),
    (CUBE[:3] + np.float32([0, 0, 4]), [[0, 1, 2], [2, 0, 1]]),
]
# Codes that are not compared. Their counts depend on how the file divides geometry into meshes and vertices,
# or they are reported only once per scene.
UNLIKE = {"cost", "duplicate-vertices", "missing-normals", "no-light", "uv.missing", "no-triangles"}


def whole():
    position, triangle, start = [], [], 0
    for place, corner in PARTS:
        position.append(place)
        triangle.append(np.asarray(corner) + start)
        start += len(place)
    return np.concatenate(position), np.concatenate(triangle)


def counts(tmp_path, meshes, **node):
    """Return {code: count} of the findings in a scene with one node for each (position, triangle)."""
    builder = GltfBuilder()
    builder.add("materials", {"pbrMetallicRoughness": {"baseColorFactor": [0.5, 0.5, 0.5, 1]}})
    for position, triangle in meshes:
        primitive = builder.primitive(np.float32(position), np.uint32(triangle), material=0)
        builder.node(mesh=builder.mesh(primitive), **node)
    report = check_scene(write(tmp_path / "scene.glb", builder), CheckSettings(), BakeSettings())
    found = Counter()
    for finding in report.findings:
        if finding.code not in UNLIKE:
            found[finding.code] += finding.found.count
    return found


@pytest.fixture(scope="module")
def plain(tmp_path_factory):
    found = counts(tmp_path_factory.mktemp("plain"), [whole()])
    expected = {
        "zero-area", "duplicate-faces", "sliver-faces", "open-edges", "flipped-neighbours", "inside-out",
        "self-intersection", "enclosed-faces",
    }  # fmt: skip
    assert set(found) == expected
    return found


def test_rotating_and_moving_the_node(tmp_path, plain):
    turned = {"rotation": [0.1825742, 0.3651484, 0.5477226, 0.7302967], "translation": [3, -8, 20]}
    assert counts(tmp_path, [whole()], **turned) == plain


def test_turning_the_vertices_themselves(tmp_path, plain):
    # Permuting the axes is exact. A rotation with rounding errors could turn other triangles into slivers.
    position, triangle = whole()
    assert counts(tmp_path, [(position[:, [1, 2, 0]], triangle)]) == plain


@pytest.mark.parametrize("factor", [0.125, 16.0])
def test_scaling(tmp_path, plain, factor):
    position, triangle = whole()
    assert counts(tmp_path, [(position * np.float32(factor), triangle)]) == plain


def test_each_corner_with_a_vertex_of_its_own(tmp_path, plain):
    position, triangle = whole()
    rows = np.asarray(triangle).reshape(-1)
    assert counts(tmp_path, [(position[rows], np.arange(len(rows)).reshape(-1, 3))]) == plain


def test_vertices_and_faces_in_another_order(tmp_path, plain):
    position, triangle = whole()
    random = np.random.default_rng(4)
    order = random.permutation(len(position))
    rank = np.argsort(order)
    shuffled = rank[np.asarray(triangle)][random.permutation(len(triangle))]
    assert counts(tmp_path, [(position[order], shuffled)]) == plain


def test_one_object_for_each_part(tmp_path, plain):
    # The two intersecting cubes stay one object, because intersections between objects are not reported.
    joined = np.concatenate([PARTS[0][0], PARTS[1][0]]), np.concatenate([CUBE_TRIANGLE, CUBE_TRIANGLE + 8])
    assert counts(tmp_path, [joined, *PARTS[2:]]) == plain


def test_primitives_instead_of_one(tmp_path, plain):
    builder = GltfBuilder()
    builder.add("materials", {"pbrMetallicRoughness": {"baseColorFactor": [0.5, 0.5, 0.5, 1]}})
    primitives = [builder.primitive(np.float32(p), np.uint32(t), material=0) for p, t in PARTS]
    builder.node(mesh=builder.mesh(*primitives))
    report = check_scene(write(tmp_path / "scene.glb", builder), CheckSettings(), BakeSettings())
    found = Counter()
    for finding in report.findings:
        if finding.code not in UNLIKE:
            found[finding.code] += finding.found.count
    assert found == plain


def test_uv_findings_do_not_depend_on_the_order_of_faces(tmp_path):
    position = np.concatenate([GRID[[0, 4, 24, 20]] + np.float32([k, 0, 0]) for k in range(4)])
    uv = np.concatenate([SQUARE * 0.4 + 0.15 * k for k in range(4)])
    triangle = np.concatenate([np.int64([[0, 1, 2], [0, 2, 3]]) + 4 * k for k in range(4)])
    percents = set()
    for seed in range(3):
        order = np.random.default_rng(seed).permutation(len(triangle))
        builder = GltfBuilder()
        part = builder.primitive(position, np.uint32(triangle[order]), TEXCOORD_1=np.float32(uv))
        builder.node(mesh=builder.mesh(part))
        report = check_scene(write(tmp_path / "uv.glb", builder), CheckSettings(), BakeSettings())
        overlap = [f for f in report.findings if f.code == "uv.overlap"]
        percents.add(round(overlap[0].found.percent, 6))
        assert overlap[0].found.pairs
    assert len(percents) == 1
    # Four squares of side 0.4 in uv, each shifted by 0.15 in u and v. Each overlaps the square before it in a
    # square of side 0.25.
    union = 0.16 + 3 * (0.16 - 0.0625)
    assert percents.pop() == pytest.approx(100 * (1 - union / 0.64), abs=0.5)
