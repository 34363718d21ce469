"""glTF primitives: modes, flat normals and left-out triangles, compared with slow reference functions."""

from __future__ import annotations

import io
import itertools

import numpy as np
import pytest
from gltf_builder import QUAD, QUAD_NORMAL, QUAD_TRIANGLE, GltfBuilder, mesh_glb, write
from PIL import Image

from baker.io.gltf.mesh import triangles_of
from baker.io.load import load_scene
from baker.topology.triangle_check import duplicates, zero_area


def codes(scene):
    return {warning.code: warning.message for warning in scene.warnings}


def load_primitives(tmp_path, builder, *primitives):
    builder.node(mesh=builder.mesh(*primitives, name="m"))
    return load_scene(write(tmp_path / "a.glb", builder))


def slow_triangles(corner, mode):
    n = len(corner)
    if mode == 4:
        return [list(corner[i : i + 3]) for i in range(0, n - n % 3, 3)]
    if mode == 5:
        return [[corner[i], corner[i + 1 + i % 2], corner[i + 2 - i % 2]] for i in range(n - 2)]
    return [[corner[i + 1], corner[i + 2], corner[0]] for i in range(n - 2)]


@pytest.mark.parametrize("mode", [4, 5, 6])
@pytest.mark.parametrize("count", [0, 1, 2, 3, 4, 5, 9, 10])
def test_modes_against_the_specification(mode, count):
    corner = np.random.default_rng(count).integers(0, 50, count)
    assert triangles_of(corner, mode).tolist() == slow_triangles(corner.tolist(), mode)


@pytest.mark.parametrize(("mode", "order"), [(4, [0, 1, 2, 0, 2, 3]), (5, [0, 1, 3, 2]), (6, [0, 1, 2, 3])])
@pytest.mark.parametrize("indexed", [True, False])
def test_a_square_in_every_mode_faces_the_same_way(tmp_path, mode, order, indexed):
    builder = GltfBuilder()
    position = QUAD if indexed else QUAD[order]
    primitive = builder.primitive(position, np.array(order, np.uint8) if indexed else None, mode=mode)
    mesh = load_primitives(tmp_path, builder, primitive).meshes[0]
    corner = mesh.position[mesh.triangle]
    cross = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    np.testing.assert_array_equal(cross, [[0, 0, 1], [0, 0, 1]])
    np.testing.assert_array_equal(mesh.normal, [[0, 0, 1]] * 6)


def test_missing_normals_become_flat_and_remember_their_rows(tmp_path):
    position = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], np.float32)
    triangle = np.array([[0, 2, 1], [0, 1, 3]])
    uv = np.arange(8, dtype=np.float32).reshape(4, 2)
    mesh = load_scene(write(tmp_path / "a.glb", mesh_glb(position, triangle, TEXCOORD_0=uv))).meshes[0]
    assert mesh.source_vertex.tolist() == [0, 2, 1, 0, 1, 3]
    assert mesh.triangle.tolist() == [[0, 1, 2], [3, 4, 5]]
    np.testing.assert_array_equal(mesh.normal, [[0, 0, -1]] * 3 + [[0, -1, 0]] * 3)
    np.testing.assert_array_equal(mesh.position, position[mesh.source_vertex])
    np.testing.assert_array_equal(mesh.texcoord[0], uv[mesh.source_vertex])
    assert mesh.texcoord[1] is None


def test_primitives_are_joined_with_their_own_materials_sets_and_rows(tmp_path):
    builder = GltfBuilder()
    builder.add("materials", {"name": "red", "pbrMetallicRoughness": {"baseColorFactor": [1, 0, 0, 1]}})
    colour = np.array([[10, 20, 30], [255, 255, 255], [0, 0, 0], [51, 102, 204]], np.uint8)
    uv = QUAD[:, :2].copy()
    first = builder.primitive(QUAD, QUAD_TRIANGLE, NORMAL=QUAD_NORMAL, material=0, TEXCOORD_1=uv)
    points = builder.primitive(QUAD, mode=0)
    second = builder.primitive(QUAD + np.float32(2), QUAD_TRIANGLE, NORMAL=QUAD_NORMAL)
    second["attributes"]["COLOR_0"] = builder.accessor(
        np.concatenate([colour, np.zeros((4, 1), np.uint8)], axis=1)[:, :3].copy(), normalized=True
    )
    scene = load_primitives(tmp_path, builder, first, points, second)
    mesh = scene.meshes[0]
    assert [m.name for m in scene.materials] == ["red", "default"]
    assert scene.materials[1].base_colour == (1, 1, 1, 1)
    assert mesh.material.tolist() == [0, 0, 1, 1]
    assert mesh.primitive.tolist() == [0, 0, 2, 2]
    assert mesh.vertex_primitive.tolist() == [0] * 4 + [2] * 4
    assert mesh.source_vertex.tolist() == [0, 1, 2, 3] * 2
    np.testing.assert_array_equal(mesh.texcoord[1], np.concatenate([QUAD[:, :2], np.zeros((4, 2))]))
    np.testing.assert_allclose(mesh.colour[4:, :3], colour / 255.0, rtol=1e-6)
    assert (mesh.colour[:4] == 1).all()
    assert (mesh.colour[:, 3] == 1).all()
    assert "1 primitive of points or lines" in codes(scene)["not-triangles"]


def test_bad_triangles_are_counted_by_kind_and_their_vertices_dropped(tmp_path):
    position = np.array(
        [[0, 0, 0], [1, 0, 0], [0, 1, 0], [np.nan, 0, 0], [2, 0, 0], [1, 1, 0], [np.inf, 1, 1], [9, 9, 9]],
        np.float32,
    )
    triangle = np.array(
        [[0, 1, 2], [0, 1, 3], [0, 1, 4], [1, 1, 2], [1, 2, 0], [1, 5, 2], [6, 0, 1], [2, 1, 0]]
    )
    normal = np.tile(np.array([0, 0, 2], np.float32), (8, 1))
    scene = load_scene(write(tmp_path / "a.glb", mesh_glb(position, triangle, NORMAL=normal)))
    mesh = scene.meshes[0]
    assert mesh.source_vertex.tolist() == [0, 1, 2, 5]
    assert mesh.source_vertex[mesh.triangle].tolist() == [[0, 1, 2], [1, 5, 2], [2, 1, 0]]
    assert np.isfinite(mesh.position).all()
    np.testing.assert_array_equal(mesh.normal, [[0, 0, 1]] * 4)
    found = codes(scene)
    assert found["bad-vertices"].startswith("2 triangles")
    assert found["zero-area"].startswith("2 triangles")
    assert found["duplicate-faces"].startswith("1 triangle ")
    assert {w.object for w in scene.warnings} == {"mesh_0"}


def test_a_warning_about_left_out_triangles_names_the_nodes_and_the_count(tmp_path):
    triangle = np.concatenate([QUAD_TRIANGLE, QUAD_TRIANGLE[:1], [[0, 0, 1]], [[1, 1, 2]]]).astype(np.uint32)
    builder = GltfBuilder()
    mesh = builder.mesh(builder.primitive(QUAD, triangle, NORMAL=QUAD_NORMAL), name="planks")
    builder.node(mesh=mesh, name="floor")
    builder.node(mesh=mesh, translation=[3, 0, 0])
    found = codes(load_scene(write(tmp_path / "a.glb", builder)))
    assert found["zero-area"] == "2 triangles without area are left out (mesh of 'floor' and 1 more)"
    assert found["duplicate-faces"].startswith("1 triangle with the corners of another is left out (mesh of")
    builder.json["nodes"][0]["name"] = "planks"
    del builder.json["nodes"][1]["mesh"]
    found = codes(load_scene(write(tmp_path / "b.glb", builder)))
    assert found["zero-area"] == "2 triangles without area are left out"


@pytest.mark.parametrize(
    ("same_material", "double_sided", "left"), [(True, True, 1), (True, False, 2), (False, True, 2)]
)
def test_a_back_face_goes_only_if_its_front_shows_both_sides(tmp_path, same_material, double_sided, left):
    builder = GltfBuilder()
    for _ in range(2):
        builder.add("materials", {"doubleSided": double_sided})
    front = builder.primitive(QUAD[:3], np.array([0, 1, 2], np.uint8), material=0)
    back = builder.primitive(QUAD[:3], np.array([1, 0, 2], np.uint8), material=0 if same_material else 1)
    assert load_primitives(tmp_path, builder, front, back).n_triangles == left


def slow_duplicates(position, triangle, material, double_sided):
    first, out = [], []  # first: (index, corners) of triangles without an earlier copy
    for t, row in enumerate(triangle):
        corners = [tuple(float(x) + 0.0 for x in position[v]) for v in row]
        turned = {tuple(corners[k:] + corners[:k]) for k in range(3)}
        flipped = {tuple(c[::-1]) for c in turned}
        same = any(other in turned for _, other in first)
        shown = double_sided[material[t]]
        back = shown and any(other in flipped and material[t] == material[s] for s, other in first)
        out.append(bool(same or back))
        if not same:
            first.append((t, tuple(corners)))
    return out


@pytest.mark.parametrize("seed", range(6))
def test_duplicates_agree_with_the_slow_twin(seed):
    rng = np.random.default_rng(seed)
    grid = np.array(list(itertools.product((-0.0, 0.0, 1.0), repeat=3)), np.float32)
    triangle = np.array([rng.choice(len(grid), 3, replace=False) for _ in range(400)])
    shuffled = triangle[rng.integers(0, 400, 200)]
    corner_order = rng.permuted(np.tile([0, 1, 2], (200, 1)), axis=1)
    triangle = np.concatenate([triangle, np.take_along_axis(shuffled, corner_order, 1)])
    triangle = triangle[~zero_area(grid, triangle)]
    material = rng.integers(0, 2, len(triangle)).astype(np.int32)
    double_sided = np.array([False, True])
    got = duplicates(grid, triangle, material, double_sided[material])
    assert got.any()
    assert not got.all()
    assert got.tolist() == slow_duplicates(grid, triangle, material, double_sided)


def test_zero_area_is_a_matter_of_shape_not_of_size():
    thin = np.array([[0, 0, 0], [1, 0, 0], [0.5, 1e-4, 0]])
    line = np.array([[0.1, 0.2, 0.3], [0.2, 0.4, 0.6], [0.3, 0.6, 0.9]])
    point = np.array([[0.3, 0.1, 0.2]] * 3)
    for scale in (1e-30, 1e-6, 1.0, 1e6, 1e15):
        position = np.concatenate([thin, line, point]).astype(np.float32) * np.float32(scale)
        assert zero_area(position, np.arange(9).reshape(3, 3)).tolist() == [False, True, True]


def test_strip_joints_are_left_out_without_a_word(tmp_path):
    builder = GltfBuilder()
    position = np.concatenate([QUAD, QUAD + np.float32(3)])
    strip = np.array([0, 1, 3, 2, 2, 4, 4, 5, 7, 6], np.uint8)
    scene = load_primitives(tmp_path, builder, builder.primitive(position, strip, mode=5))
    assert scene.n_triangles == 4
    assert scene.warnings == ()


def test_normals_without_length_are_made_from_the_faces(tmp_path):
    normal = QUAD_NORMAL.copy()
    normal[1], normal[3] = (0, 0, 0), (np.nan, 0, 1)
    scene = load_scene(write(tmp_path / "a.glb", mesh_glb(QUAD, QUAD_TRIANGLE, NORMAL=normal)))
    np.testing.assert_array_equal(scene.meshes[0].normal, QUAD_NORMAL)
    assert codes(scene)["bad-normals"].startswith("2 vertex normals")


def test_a_texture_whose_coordinates_are_missing_reads_zeros(tmp_path):
    builder = GltfBuilder()
    png = io.BytesIO()
    Image.new("RGB", (2, 2)).save(png, "PNG")
    texture = builder.image(png.getvalue())
    builder.add("materials", {"name": "x", "emissiveTexture": {"index": texture, "texCoord": 2}})
    primitive = builder.primitive(QUAD, QUAD_TRIANGLE, NORMAL=QUAD_NORMAL, material=0)
    scene = load_primitives(tmp_path, builder, primitive)
    assert scene.meshes[0].texcoord[:2] == (None, None)
    np.testing.assert_array_equal(scene.meshes[0].texcoord[2], np.zeros((4, 2)))
    assert "TEXCOORD_2, which primitive 0 lacks" in codes(scene)["missing-texcoord"]


def test_morph_targets_and_spare_indices_are_reported(tmp_path):
    builder = GltfBuilder()
    primitive = builder.primitive(QUAD, np.array([0, 1, 2, 0, 2, 3, 1], np.uint8), NORMAL=QUAD_NORMAL)
    primitive["targets"] = [{"POSITION": builder.accessor(QUAD)}]
    scene = load_primitives(tmp_path, builder, primitive)
    assert scene.n_triangles == 2
    assert set(codes(scene)) == {"morphed", "odd-indices"}


@pytest.mark.parametrize("normalized", [False, True])
def test_integer_colours_that_are_not_marked_are_told(tmp_path, normalized):
    builder = GltfBuilder()
    part = builder.primitive(QUAD, QUAD_TRIANGLE, NORMAL=QUAD_NORMAL, COLOR_0=np.full((4, 4), 51, np.uint8))
    builder.json["accessors"][part["attributes"]["COLOR_0"]]["normalized"] = normalized
    scene = load_primitives(tmp_path, builder, part)
    np.testing.assert_allclose(scene.meshes[0].colour, 0.2, rtol=1e-6)
    assert [w.code for w in scene.warnings] == ([] if normalized else ["integer-colours"])
