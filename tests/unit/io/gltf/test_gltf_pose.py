"""Skinned meshes and `EXT_mesh_gpu_instancing` get correct world positions; hidden nodes are left out."""

from __future__ import annotations

import json

import numpy as np
import pytest
from glb_reader import Glb
from gltf_builder import QUAD, QUAD_NORMAL, QUAD_TRIANGLE, GltfBuilder, quad_builder, write
from io_scenes import make_atlas, split_layout

from baker.core.errors import InputError
from baker.io.gltf.write_baked import make_glb
from baker.io.load import load_scene


def skinned(bind, joints, weights=None, joint=None, **node):
    """Return a builder with a skinned square at node 0.

    `bind` has the inverse bind matrices, `joints` the members of each joint's node, and `node` more members
    of node 0. `weights` and `joint` are (4, 4): the joint weights and joint indices of the four vertices.
    """
    b = GltfBuilder()
    joint = np.zeros((4, 4), np.uint8) if joint is None else np.uint8(joint)
    weights = np.float32([[1, 0, 0, 0]] * 4) if weights is None else np.float32(weights)
    part = b.primitive(QUAD, QUAD_TRIANGLE, NORMAL=QUAD_NORMAL, JOINTS_0=joint, WEIGHTS_0=weights)
    b.node(mesh=b.mesh(part, name="cloth"), skin=0, name="figure", **node)
    names = [b.node(**members) for members in joints]
    skin = {"joints": names}
    if bind is not None:
        flat = np.float32([np.asarray(m).T.ravel() for m in bind])
        accessor = {"type": "MAT4", "componentType": 5126, "bufferView": b.view(flat.tobytes())}
        skin["inverseBindMatrices"] = b.add("accessors", {**accessor, "count": len(flat)})
    b.add("skins", skin)
    return b


def world(scene, index=0):
    instance = scene.instances[index]
    matrix = instance.world_from_object
    return scene.meshes[instance.mesh].position @ matrix[:3, :3].T + matrix[:3, 3]


def move(x, y, z):
    matrix = np.eye(4)
    matrix[:3, 3] = x, y, z
    return matrix


def test_the_joint_places_the_mesh_and_its_node_does_not(tmp_path):
    builder = skinned([move(0, 0, -1)], [{"translation": [5, 0, 0]}], translation=[99, 0, 0], scale=[9] * 3)
    scene = load_scene(write(tmp_path / "a.glb", builder))
    np.testing.assert_allclose(world(scene), QUAD + np.array([5, 0, -1]), atol=1e-6)


def test_scales_of_joint_and_bind_pose_cancel(tmp_path):
    bind, joint = np.diag([100.0, 100, 100, 1]), {"scale": [0.01, 0.01, 0.01]}
    scene = load_scene(write(tmp_path / "a.glb", skinned([bind], [joint], scale=[0.01] * 3)))
    np.testing.assert_allclose(world(scene), QUAD, atol=1e-6)
    np.testing.assert_allclose(scene.meshes[0].normal, QUAD_NORMAL, atol=1e-6)


def test_weights_blend_matrices_and_are_normalised(tmp_path):
    weights = [[1, 0, 0, 0], [0, 2, 0, 0], [0.5, 0.5, 0, 0], [0, 0, 0, 0]]
    joint = [[0, 1, 9, 9]] * 4  # a joint index with weight 0 may be invalid
    builder = skinned(None, [{}, {"translation": [0, 0, 4]}], weights, joint)
    expected = QUAD + np.float32([[0, 0, 0], [0, 0, 4], [0, 0, 2], [0, 0, 0]])
    scene = load_scene(write(tmp_path / "a.glb", builder))
    np.testing.assert_allclose(world(scene), expected, atol=1e-6)


def test_normals_turn_with_the_joint_and_keep_their_side(tmp_path):
    half = np.sqrt(0.5)
    builder = skinned(None, [{"rotation": [half, 0, 0, half], "scale": [1, 3, 1]}])
    scene = load_scene(write(tmp_path / "a.glb", builder))
    # A quarter turn about x: +z becomes -y, and y becomes z.
    np.testing.assert_allclose(world(scene), QUAD[:, [0, 2, 1]] * [1, 1, 3], atol=1e-6)
    np.testing.assert_allclose(scene.meshes[0].normal, [[0, -1, 0]] * 4, atol=1e-6)


def test_joints_below_other_nodes_and_out_of_the_scene(tmp_path):
    builder = skinned(None, [{"translation": [1, 0, 0], "children": [2]}, {"translation": [0, 1, 0]}])
    builder.json["skins"][0]["joints"] = [2]
    builder.json["scenes"] = [{"nodes": [0]}]
    scene = load_scene(write(tmp_path / "a.glb", builder))
    np.testing.assert_allclose(world(scene), QUAD + np.array([1, 1, 0]), atol=1e-6)


def test_a_figure_far_away_keeps_its_digits(tmp_path):
    builder = skinned(None, [{"translation": [1e5, 0, 0]}])
    scene = load_scene(write(tmp_path / "a.glb", builder))
    np.testing.assert_allclose(world(scene) - [1e5, 0, 0], QUAD, atol=1e-6)


def test_the_file_keeps_its_skin(tmp_path):
    builder = skinned([move(0, 0, -1)], [{"translation": [5, 0, 0]}])
    scene = load_scene(write(tmp_path / "a.glb", builder))
    data = make_glb(scene, make_atlas(split_layout(scene, 0))).data
    after = Glb(data)
    primitive = after.json["meshes"][0]["primitives"][0]
    stored = after.corners(primitive, "POSITION").reshape(-1, 3)
    np.testing.assert_array_equal(np.unique(stored, axis=0), np.unique(QUAD, axis=0))
    again = load_scene(write(tmp_path / "out.glb", data))
    assert np.ptp(world(again), axis=0).tolist() == [1, 1, 0]
    assert world(again).mean(axis=0)[0] == pytest.approx(5.5)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda d: d["nodes"][0].update(skin=4), r"nodes\[0\].skin.*1 skins"),
        (lambda d: d["skins"][0].update(joints=[]), "no joints"),
        (lambda d: d["skins"][0].update(joints=[44]), r"joints\[0\].*out of range"),
        (lambda d: d["skins"][0].update(inverseBindMatrices=0), "MAT4"),
        (lambda d: d["accessors"][5].update(count=0), "inverseBindMatrices.*0 elements"),
        (lambda d: d["meshes"][0]["primitives"][0]["attributes"].pop("WEIGHTS_0"), "WEIGHTS_0"),
        (lambda d: d["accessors"][2].update(bufferView=99), "bufferView.*out of range"),
    ],
)
def test_a_broken_skin_of_a_mesh_that_is_shown_is_refused(tmp_path, change, words):
    builder = skinned([np.eye(4)], [{}])
    assert builder.json["skins"][0]["inverseBindMatrices"] == 5
    change(builder.json)
    with pytest.raises(InputError, match=words):
        load_scene(write(tmp_path / "a.glb", builder))


INSTANCING = "EXT_mesh_gpu_instancing"


def instanced(**attributes):
    b = quad_builder()
    named = {key: b.accessor(np.float32(value)) for key, value in attributes.items()}
    b.json["nodes"][0] |= {"translation": [0, 0, 1], "scale": [2, 1, 1]}
    b.json["nodes"][0]["extensions"] = {INSTANCING: {"attributes": named}}
    b.json["extensionsUsed"] = b.json["extensionsRequired"] = [INSTANCING]
    return b


def test_instances_of_one_node_become_nodes(tmp_path):
    half = np.sqrt(0.5)
    builder = instanced(
        TRANSLATION=[[0, 0, 0], [5, 0, 0], [0, 5, 0]],
        ROTATION=[[0, 0, 0, 1], [0, 0, 0, 1], [0, 0, half, half]],
        SCALE=[[1, 1, 1], [1, -1, 1], [1, 1, 1]],
    )
    path = write(tmp_path / "a.glb", builder)
    scene = load_scene(path)
    assert [(i.name, i.node) for i in scene.instances] == [("place_0", 1), ("place_1", 2), ("place_2", 3)]
    assert [w.code for w in scene.warnings] == []
    np.testing.assert_allclose(world(scene, 0), QUAD * [2, 1, 1] + [0, 0, 1], atol=1e-6)
    mirrored = (QUAD * [1, -1, 1] + [5, 0, 0]) * [2, 1, 1] + [0, 0, 1]
    np.testing.assert_allclose(world(scene, 1), mirrored, atol=1e-6)
    turned = np.stack([-QUAD[:, 1], QUAD[:, 0], QUAD[:, 2]], axis=1) + np.array([0, 5, 0])
    np.testing.assert_allclose(world(scene, 2), turned * [2, 1, 1] + [0, 0, 1], atol=1e-6)
    data = make_glb(scene, make_atlas(*(split_layout(scene, k) for k in range(3)))).data
    after = Glb(data).json
    assert INSTANCING not in json.dumps(after)
    assert "mesh" not in after["nodes"][0]
    assert after["nodes"][0]["children"] == [1, 2, 3]
    assert len({after["nodes"][k]["mesh"] for k in (1, 2, 3)}) == 3
    again = load_scene(write(tmp_path / "out.glb", data))
    assert [i.node for i in again.instances] == [1, 2, 3]


@pytest.mark.parametrize(
    ("attributes", "words"),
    [
        ({"TRANSLATION": [[0, 0]]}, "VEC3"),
        ({"TRANSLATION": [[0, 0, 0]], "SCALE": [[1, 1, 1]] * 2}, "different numbers of rows"),
        ({"TRANSLATION": [[np.nan, 0, 0]]}, "not finite"),
    ],
)
def test_broken_instances_are_refused_where_they_are_shown(tmp_path, attributes, words):
    builder = instanced(**attributes)
    with pytest.raises(InputError, match=words):
        load_scene(write(tmp_path / "a.glb", builder))
    plain = builder.primitive(QUAD + np.float32([0, 0, 9]), QUAD_TRIANGLE)
    builder.node(mesh=builder.mesh(plain), name="other")
    builder.json["scenes"] = [{"nodes": [1]}]
    assert [i.name for i in load_scene(write(tmp_path / "a.glb", builder)).instances] == ["other"]


@pytest.mark.parametrize("required", [False, True])
def test_hidden_nodes_are_left_out_with_what_is_below_them(tmp_path, required):
    b = quad_builder()
    hidden = {"KHR_node_visibility": {"visible": False}}
    b.json["extensions"] = {"KHR_lights_punctual": {"lights": [{"type": "point"}]}}
    light = b.node(extensions={"KHR_lights_punctual": {"light": 0}, **hidden})
    inner = b.node(mesh=0, name="inner", extensions={"KHR_node_visibility": {"visible": True}})
    outer = b.node(children=[inner], extensions=hidden)
    b.json["scenes"] = [{"nodes": [0, light, outer]}]
    b.json["extensionsUsed"] = ["KHR_node_visibility"]
    if required:
        b.json["extensionsRequired"] = ["KHR_node_visibility"]
    scene = load_scene(write(tmp_path / "a.glb", b))
    assert [i.name for i in scene.instances] == ["place"]
    assert scene.lights == ()
    assert scene.warnings == ()
    after = Glb(make_glb(scene, make_atlas(split_layout(scene, 0))).data).json
    assert after["nodes"][1:] == b.json["nodes"][1:]
