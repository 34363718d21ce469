"""The glTF importer reads nodes, instances, lights and scenes, with correct warnings and errors."""

from __future__ import annotations

import hashlib
import math

import numpy as np
import pytest
from gltf_builder import QUAD, QUAD_NORMAL, QUAD_TRIANGLE, quad_builder, write

from baker.core.errors import InputError, SettingsError
from baker.core.read_options import ReadOptions
from baker.io.load import IMPORTERS, load_scene


def load(tmp_path, builder, **options):
    return load_scene(write(tmp_path / "room.v2.glb", builder), **options)


def codes(scene):
    return [warning.code for warning in scene.warnings]


def turn(axis, angle):
    """Return the (3, 3) rotation about a unit axis by Rodrigues' formula, independent of quaternions."""
    k = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    return np.eye(3) + math.sin(angle) * k + (1 - math.cos(angle)) * k @ k


def test_matrix_and_trs_multiply_down_the_tree(tmp_path):
    builder = quad_builder()
    axis, angle = np.array([2.0, 3.0, 6.0]) / 7.0, 1.1
    matrix = np.array([[0, -1, 0, 5], [1, 0, 0, 6], [0, 0, 2, 7], [0, 0, 0, 1.0]])
    builder.node(
        translation=[1, 2, 3],
        rotation=[*(axis * math.sin(angle / 2)), math.cos(angle / 2)],
        scale=[1, -2, 3],
        children=[0],
    )
    builder.node(matrix=matrix.T.reshape(-1).tolist(), children=[1])
    trs = np.eye(4)
    trs[:3, :3] = turn(axis, angle) @ np.diag([1, -2, 3])
    trs[:3, 3] = (1, 2, 3)
    instance = load(tmp_path, builder).instances[0]
    np.testing.assert_allclose(instance.world_from_object, matrix @ trs, atol=1e-14)
    assert (instance.node, instance.name, instance.mesh) == (0, "place", 0)


def test_a_mirrored_instance_keeps_the_mesh_as_the_file_has_it(tmp_path):
    builder = quad_builder()
    builder.node(mesh=0, scale=[-1, 1, 1])
    scene = load(tmp_path, builder)
    assert len(scene.meshes) == 1
    assert [i.mesh for i in scene.instances] == [0, 0]
    assert scene.instances[1].name == "square"
    np.testing.assert_array_equal(scene.meshes[0].triangle, QUAD_TRIANGLE)
    np.testing.assert_array_equal(scene.meshes[0].normal, QUAD_NORMAL)
    assert np.linalg.det(scene.instances[1].world_from_object) == -1
    assert scene.n_triangles == 4


@pytest.mark.parametrize("scale", [[0, 1, 1], [0, 0, 0], [1, 1, 1e-12]])
def test_flat_instances_are_left_out_with_a_warning(tmp_path, scale):
    builder = quad_builder()
    builder.node(mesh=0, scale=scale, name="flat")
    scene = load(tmp_path, builder)
    assert [i.node for i in scene.instances] == [0]
    assert [(w.code, w.object) for w in scene.warnings] == [("flat-instance", "flat")]
    builder.json["nodes"] = [{"mesh": 0, "scale": scale}]
    with pytest.raises(InputError, match="nothing to bake"):
        load(tmp_path, builder)


def test_scenes_are_chosen_by_default_or_by_number(tmp_path):
    builder = quad_builder()
    builder.mesh(builder.primitive(QUAD + np.float32(9), QUAD_TRIANGLE))
    builder.node(mesh=1, name="other")
    builder.json["scenes"] = [{"nodes": [0]}, {"nodes": [1], "name": "second"}]
    scene = load(tmp_path, builder)
    assert [i.name for i in scene.instances] == ["place"]
    assert codes(scene) == ["several-scenes"]
    builder.json["scene"] = 1
    scene = load(tmp_path, builder)
    assert [(i.name, i.mesh) for i in scene.instances] == [("other", 0)]
    assert len(scene.meshes) == 1
    for asked, name in (("0", "place"), ("1", "other"), ("second", "other")):
        scene = load(tmp_path, builder, options=ReadOptions(scene_name=asked))
        assert [i.name for i in scene.instances] == [name]
        assert codes(scene) == []
        assert scene.source.json["scene"] == (name == "other")
    for asked, hint in (("2", "known are 0, second"), ("sceond", "did you mean 'second'")):
        with pytest.raises(SettingsError, match=f"no scene '{asked}'.*{hint}"):
            load(tmp_path, builder, options=ReadOptions(scene_name=asked))
    # The name of a scene precedes a number.
    builder.json["scenes"][0]["name"] = "1"
    assert load(tmp_path, builder, options=ReadOptions(scene_name="1")).instances[0].name == "place"


def test_a_file_without_scenes_shows_all_its_roots(tmp_path):
    builder = quad_builder()
    builder.node(children=[0], translation=[1, 0, 0])
    builder.json["scenes"] = []
    scene = load(tmp_path, builder)
    assert [(i.node, i.world_from_object[0, 3]) for i in scene.instances] == [(0, 1)]


def test_lights_stand_and_shine_where_their_nodes_do(tmp_path):
    builder = quad_builder()
    lights = [
        {"type": "point", "color": [1, 0.5, 0], "intensity": 8, "name": "bulb"},
        {"type": "spot", "intensity": 2, "spot": {"innerConeAngle": 0.2, "outerConeAngle": 0.4}},
        {"type": "directional"},
        {"type": "spot"},
    ]
    builder.json["extensions"] = {"KHR_lights_punctual": {"lights": lights}}
    half = math.sqrt(0.5)
    for k in range(4):
        place = {"extensions": {"KHR_lights_punctual": {"light": k}}, "translation": [k, 1, 2]}
        # A rotation by -90 degrees about x turns the light's axis -z to -y. The scale must not change the
        # length of the direction.
        builder.node(**place, rotation=[-half, 0, 0, half], scale=[2, 2, 5])
    bulb, spot, sun, plain = load(tmp_path, builder).lights
    assert [light.kind for light in (bulb, spot, sun, plain)] == ["point", "spot", "directional", "spot"]
    assert bulb.intensity == (8, 4, 0)
    assert bulb.position == (0, 1, 2)
    assert (bulb.name, bulb.node) == ("bulb", 1)
    assert (spot.inner_cone, spot.outer_cone) == (0.2, 0.4)
    assert (plain.inner_cone, plain.outer_cone) == (0, math.pi / 4)
    assert sun.intensity == (1, 1, 1)
    for light in (spot, sun, plain):
        np.testing.assert_allclose(light.direction, (0, -1, 0), atol=1e-15)


def lit(light, *chain):
    """Return a builder with nested nodes and a light on the innermost one.

    `chain` has the members of each node, the outermost first.
    """
    builder = quad_builder()
    builder.json["extensions"] = {"KHR_lights_punctual": {"lights": [light]}}
    nodes = [{**members} for members in chain]
    nodes[-1]["extensions"] = {"KHR_lights_punctual": {"light": 0}}
    first = len(builder.json["nodes"])
    for k, node in enumerate(nodes[:-1]):
        node["children"] = [first + k + 1]
    builder.json["nodes"] += nodes
    return builder


TURN = {"rotation": [-math.sqrt(0.5), 0, 0, math.sqrt(0.5)], "name": "lamp"}
# The rotation of TURN rounded to single precision, as exporters write it.
TURN_32 = {"rotation": [float(np.float32(v)) for v in TURN["rotation"]], "name": "lamp"}
SQUEEZE = [
    [{"scale": [1, 0, 1]}, TURN],
    [{"scale": [1, 0, 1]}, TURN_32],
    [{"scale": [3e5, 0, 2e5]}, {"scale": [7, 7, 7]}, TURN_32],
    [{"scale": [1e-7, 0, 1e-7]}, TURN_32],
    [{"scale": [1, 1e-8, 1]}, TURN],
    [{"scale": [0, 0, 0]}, TURN],
    [{"scale": [-1, 0, 1], "rotation": [0, 0.6, 0, 0.8]}, TURN],
    [{"name": "lamp", "matrix": [1, 0, 0, 0, 0, 0, 1, 0, 0, 6e-8, 0, 0, 0, 3, 0, 1]}],
]


@pytest.mark.parametrize("chain", SQUEEZE)
@pytest.mark.parametrize("kind", ["spot", "directional"])
def test_a_light_without_a_direction_is_named_and_left_out(tmp_path, chain, kind):
    scene = load(tmp_path, lit({"type": kind}, *chain))
    assert scene.lights == ()
    assert [(w.code, w.object) for w in scene.warnings] == [("flat-light", "lamp")]
    assert kind in scene.warnings[0].message
    assert len(load(tmp_path, lit({"type": "point"}, *chain)).lights) == 1


@pytest.mark.parametrize(
    ("chain", "direction"),
    [
        ([{"scale": [1e-5] * 3}, TURN], (0, -1, 0)),
        ([{"scale": [1e-200] * 3}, TURN], (0, -1, 0)),
        ([{"scale": [1e200] * 3}, TURN], (0, -1, 0)),
        ([{"scale": [1, 1e-4, 1]}, TURN], (0, -1, 0)),
        ([{"scale": [1, -1, 1]}, TURN], (0, 1, 0)),
        ([{"scale": [0, 1, 0]}, TURN], (0, -1, 0)),
        ([{"scale": [1, 1, 0], "name": "lamp"}], None),
        # The shear x += 1000 z turns the light's axis -Z almost to -X.
        ([{"name": "l", "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 1000, 0, 1, 0, 0, 0, 0, 1]}], (-1000, 0, -1)),
    ],
)
def test_scaled_mirrored_and_sheared_lights_shine_along_their_axis(tmp_path, chain, direction):
    lights = load(tmp_path, lit({"type": "spot"}, *chain)).lights
    if direction is None:
        assert lights == ()
        return
    np.testing.assert_allclose(
        lights[0].direction, np.array(direction) / np.linalg.norm(direction), atol=1e-11
    )


@pytest.mark.parametrize(
    ("value", "text"), [(math.nan, "NaN"), (math.inf, "Infinity"), (1e300, "not finite")]
)
def test_a_light_under_a_matrix_that_is_not_finite_is_bad_input(tmp_path, value, text):
    matrix = np.eye(4).reshape(-1).tolist()
    matrix[10] = value
    with pytest.raises(InputError, match=text):
        load(tmp_path, lit({"type": "spot"}, {"matrix": matrix}, {"matrix": matrix}))


def test_the_range_of_a_light_is_read(tmp_path):
    assert load(tmp_path, lit({"type": "point", "range": 2.5}, TURN)).lights[0].range == 2.5
    assert load(tmp_path, lit({"type": "spot"}, TURN)).lights[0].range == math.inf
    # The range of a directional light is ignored.
    assert load(tmp_path, lit({"type": "directional", "range": 1}, TURN)).lights[0].range == math.inf
    assert load(tmp_path, lit({"type": "point", "range": 2.5}, TURN)).warnings == ()


@pytest.mark.parametrize("value", [0, -1, "far", None, True])
def test_a_range_that_is_not_above_zero_is_refused(tmp_path, value):
    with pytest.raises(InputError, match=r"lights\[0\]\.range"):
        load(tmp_path, lit({"type": "point", "range": value}, TURN))


def test_skinned_meshes_are_taken_as_they_are_bound(tmp_path):
    builder = quad_builder()
    builder.json["nodes"][0]["skin"] = 0
    builder.json["skins"] = [{"joints": [0]}]
    scene = load(tmp_path, builder)
    assert [(w.code, w.object) for w in scene.warnings] == [("skinned", "place")]
    np.testing.assert_array_equal(scene.meshes[0].position, QUAD)


def test_extensions_that_nobody_needs_are_ignored_and_named(tmp_path):
    builder = quad_builder()
    builder.json["extensionsUsed"] = ["KHR_materials_clearcoat", "ACME_y", "ACME_x"]
    builder.json["extensionsRequired"] = ["KHR_materials_clearcoat"]
    scene = load(tmp_path, builder)
    assert [(w.code, w.object) for w in scene.warnings] == [
        ("extension-ignored", "ACME_y"),
        ("extension-ignored", "ACME_x"),
    ]


def test_the_hash_covers_every_outside_file(tmp_path):
    builder = quad_builder()
    path = write(tmp_path / "a.glb", builder)
    assert load_scene(path).sha256 == hashlib.sha256(path.read_bytes()).hexdigest()
    png = bytes.fromhex("00")
    (tmp_path / "b.bin").write_bytes(builder.blob)
    (tmp_path / "unused.png").write_bytes(png)
    builder.json["buffers"] = [{"byteLength": len(builder.blob), "uri": "b.bin"}]
    builder.json["images"] = [{"uri": "unused.png"}]
    path = write(tmp_path / "a.gltf", builder)
    expected = hashlib.sha256(path.read_bytes() + builder.blob + png).hexdigest()
    assert load_scene(path).sha256 == expected


def test_the_source_document_is_kept_for_the_writer(tmp_path):
    builder = quad_builder()
    builder.json["extras"] = {"kept": [1, 2]}
    scene = load(tmp_path, builder)
    assert scene.source.json["extras"] == {"kept": [1, 2]}
    assert scene.source.buffers == (builder.blob,)
    assert scene.source.folder == tmp_path
    assert scene.name == "room"


def test_up_and_scale_are_checked_and_not_applied_to_gltf(tmp_path):
    scene = load(tmp_path, quad_builder(), up="z", scale=3.0)
    np.testing.assert_array_equal(scene.instances[0].world_from_object, np.eye(4))
    assert codes(scene) == ["up-and-scale-ignored"]
    for options in ({"up": "x"}, {"scale": 0.0}, {"scale": math.nan}):
        with pytest.raises(SettingsError):
            load(tmp_path, quad_builder(), **options)


def test_every_known_suffix_has_an_importer():
    assert IMPORTERS.names() == [".glb", ".gltf", ".obj", ".off", ".ply", ".stl"]
