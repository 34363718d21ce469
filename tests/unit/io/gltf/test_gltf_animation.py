"""Animations pose nodes, joints and morph targets at a time, by the formulas of the glTF specification."""

from __future__ import annotations

import math

import numpy as np
import pytest
from gltf_builder import QUAD, QUAD_NORMAL, QUAD_TRIANGLE, GltfBuilder, quad_builder, write
from test_gltf_pose import skinned, world

from baker.core.errors import InputError, SettingsError
from baker.core.read_options import ReadOptions
from baker.io.load import load_scene

HALF = math.sqrt(0.5)
# Unit quaternions: no turn, and a quarter turn about z.
STRAIGHT, QUARTER = [0, 0, 0, 1.0], [0, 0, HALF, HALF]


def animate(builder, node, path, times, values, mode="LINEAR", name="walk", **target):
    """Add an animation with one channel; `values` has one row for each key or tangent."""
    sampler = {
        "input": builder.accessor(np.float32(times)),
        "output": builder.accessor(np.float32(values)),
        "interpolation": mode,
    }
    channel = {"sampler": 0, "target": {"node": node, "path": path, **target}}
    return builder.add("animations", {"name": name, "samplers": [sampler], "channels": [channel]})


def load(tmp_path, builder, **options):
    return load_scene(write(tmp_path / "a.glb", builder), options=ReadOptions(**options))


def place(tmp_path, builder, time):
    return load(tmp_path, builder, time=time).instances[0].world_from_object[:3, 3]


@pytest.mark.parametrize(
    ("mode", "at"),
    [
        ("STEP", {0: 2, 1: 2, 1.5: 2, 2.99: 2, 3: 6, 9: 6}),
        ("LINEAR", {0: 2, 1: 2, 1.5: 3, 2: 4, 3: 6, 9: 6}),
    ],
)
def test_steps_and_lines_between_keys(tmp_path, mode, at):
    builder = quad_builder()
    animate(builder, 0, "translation", [1, 3], [[2, 0, 0], [6, 0, 0]], mode)
    for time, x in at.items():
        np.testing.assert_allclose(place(tmp_path, builder, time), [x, 0, 0], atol=1e-6)
    np.testing.assert_array_equal(load(tmp_path, builder).instances[0].world_from_object, np.eye(4))


def test_splines_follow_their_tangents(tmp_path):
    # y is the cubic with the values 1 and 0 and the slopes 3 and -1 at its ends, which are two seconds apart.
    rows = [[0, 0, 0], [0, 1, 0], [0, 3, 0], [0, -1, 0], [0, 0, 0], [0, 0, 0]]
    builder = quad_builder()
    animate(builder, 0, "translation", [1, 3], rows, "CUBICSPLINE")
    for time in (1.0, 1.5, 2.0, 2.75, 3.0):
        t = time - 1
        # Solve y = a + b t + c t^2 + d t^3 for these values and slopes.
        a, b = 1, 3
        c, d = np.linalg.solve([[4, 8], [4, 12]], [0 - a - 2 * b, -1 - b])
        np.testing.assert_allclose(
            place(tmp_path, builder, time), [0, a + b * t + c * t**2 + d * t**3, 0], atol=1e-6
        )


@pytest.mark.parametrize("sign", [1, -1])
def test_rotations_take_the_shorter_arc_at_a_constant_rate(tmp_path, sign):
    builder = quad_builder()
    animate(builder, 0, "rotation", [0, 1], [STRAIGHT, [sign * v for v in QUARTER]])
    for share in (0.0, 0.25, 0.6, 1.0):
        matrix = load(tmp_path, builder, time=share).instances[0].world_from_object
        angle = share * math.pi / 2
        np.testing.assert_allclose(matrix[:2, 0], [math.cos(angle), math.sin(angle)], atol=1e-6)


def test_splines_of_rotations_are_normalised(tmp_path):
    rows = [[0] * 4, STRAIGHT, [0] * 4, [0] * 4, QUARTER, [0] * 4]
    builder = quad_builder()
    animate(builder, 0, "rotation", [0, 1], rows, "CUBICSPLINE")
    matrix = load(tmp_path, builder, time=0.5).instances[0].world_from_object
    # Without tangents, the middle is the mean of the two quaternions: an eighth of a turn.
    np.testing.assert_allclose(matrix[:2, 0], [HALF, HALF], atol=1e-6)


def test_integers_that_are_normalized_turn_nodes(tmp_path):
    builder = quad_builder()
    number = animate(builder, 0, "rotation", [0], [STRAIGHT])
    values = np.int16([[0, 0, round(HALF * 32767), round(HALF * 32767)]])
    builder.json["animations"][number]["samplers"][0]["output"] = builder.accessor(values, normalized=True)
    matrix = load(tmp_path, builder, time=0).instances[0].world_from_object
    np.testing.assert_allclose(matrix[:2, 0], [0, 1], atol=1e-4)


def test_joints_move_a_skinned_mesh(tmp_path):
    builder = skinned(None, [{}, {"children": []}], joint=[[1, 0, 0, 0]] * 4, translation=[99, 0, 0])
    animate(builder, 2, "translation", [0, 2], [[0, 0, 0], [0, 0, 8]])
    scene = load(tmp_path, builder, time=0.5)
    np.testing.assert_allclose(world(scene), QUAD + np.float32([0, 0, 2]), atol=1e-6)


def targets(**mesh):
    """Return a builder with a square that has two targets: 1 m along z with a tilted normal, 2 m along x."""
    b = GltfBuilder()
    up, right = np.zeros((4, 3), np.float32), np.zeros((4, 3), np.float32)
    up[:, 2], right[:, 0] = 1, 2
    tilt = np.float32([[1, 0, 0]] * 4)
    moves = [{"POSITION": b.accessor(up), "NORMAL": b.accessor(tilt)}, {"POSITION": b.accessor(right)}]
    part = b.primitive(QUAD, QUAD_TRIANGLE, NORMAL=QUAD_NORMAL, targets=moves)
    b.node(mesh=b.mesh(part, **mesh), name="a")
    return b


def test_weights_of_the_node_precede_those_of_the_mesh(tmp_path):
    builder = targets(weights=[0, 0.5])
    builder.node(mesh=0, name="b", weights=[1, 0.25])
    scene = load(tmp_path, builder)
    np.testing.assert_allclose(world(scene, 0), QUAD + np.float32([1, 0, 0]), atol=1e-6)
    np.testing.assert_allclose(world(scene, 1), QUAD + np.float32([0.5, 0, 1]), atol=1e-6)
    np.testing.assert_allclose(scene.meshes[0].normal, QUAD_NORMAL, atol=1e-6)
    np.testing.assert_allclose(scene.meshes[1].normal, [[HALF, 0, HALF]] * 4, atol=1e-6)
    assert {w.code for w in scene.warnings} == {"morphed"}
    np.testing.assert_allclose(world(load(tmp_path, targets())), QUAD)


def test_an_animation_sets_weights(tmp_path):
    builder = targets(weights=[5, 5])
    animate(builder, 0, "weights", [0, 1], [0, 0, 1, 0.5])
    scene = load(tmp_path, builder, time=0.5)
    np.testing.assert_allclose(world(scene), QUAD + np.float32([0.5, 0, 0.5]), atol=1e-6)


def test_a_wrong_number_of_weights_is_refused(tmp_path):
    with pytest.raises(InputError, match="2 morph targets and 3 weights"):
        load(tmp_path, targets(weights=[1, 2, 3]))


def test_animations_are_chosen_by_name_or_number(tmp_path):
    builder = quad_builder()
    animate(builder, 0, "translation", [0], [[1, 0, 0]], name="walk")
    animate(builder, 0, "translation", [0], [[2, 0, 0]], name="run")
    for asked, x in ((None, 1), ("run", 2), ("1", 2), ("walk", 1)):
        scene = load(tmp_path, builder, animation=asked, time=0)
        assert scene.instances[0].world_from_object[0, 3] == x
    assert load(tmp_path, builder, animation="run").instances[0].world_from_object[0, 3] == 2
    with pytest.raises(SettingsError, match="no animation 'rnu'; did you mean 'run'"):
        load(tmp_path, builder, animation="rnu")
    with pytest.raises(SettingsError, match="the file has no animations"):
        load(tmp_path, quad_builder(), time=1)


def test_pointers_are_named_and_not_read(tmp_path):
    builder = quad_builder()
    pointer = {"KHR_animation_pointer": {"pointer": "/nodes/0/extensions/KHR_node_visibility/visible"}}
    animate(builder, 0, "pointer", [0], [[0, 0, 0]], extensions=pointer)
    del builder.json["animations"][0]["channels"][0]["target"]["node"]
    builder.json["extensionsUsed"] = builder.json["extensionsRequired"] = ["KHR_animation_pointer"]
    for options in ({}, {"time": 0.0}):
        scene = load(tmp_path, builder, **options)
        assert [w.code for w in scene.warnings] == ["animation-pointer"]
        assert "KHR_node_visibility" in scene.warnings[0].message
        assert len(scene.instances) == 1


@pytest.mark.parametrize(
    ("times", "values", "mode", "words"),
    [
        ([1, 1], [[0, 0, 0]] * 2, "LINEAR", "do not increase"),
        ([0, 1], [[0, 0, 0]] * 3, "LINEAR", "3 values for 2 keys"),
        ([0, 1], [[0, 0, 0]] * 2, "CUBICSPLINE", "2 values for 2 keys"),
        ([0, 1], [[0, 0, 0]] * 2, "SMOOTH", "none of LINEAR"),
        ([0, 1], [[0, 0, math.inf]] * 2, "LINEAR", "not finite"),
    ],
)
def test_broken_animations_are_refused_only_if_asked_for(tmp_path, times, values, mode, words):
    builder = quad_builder()
    animate(builder, 0, "translation", times, values, mode)
    load(tmp_path, builder)
    with pytest.raises(InputError, match=words):
        load(tmp_path, builder, time=0.5)
