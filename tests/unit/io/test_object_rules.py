"""Settings of objects come from patterns of names and paths, from extras in the file, and from names."""

from __future__ import annotations

import numpy as np
import pytest
from gltf_builder import QUAD, QUAD_TRIANGLE, GltfBuilder, write

import baker
from baker.core.errors import InputError, SettingsError
from baker.core.settings import make_settings
from baker.io.bake.read_bake import read_bake
from baker.io.load import load_for_bake
from baker.io.name_rules import unseen_kind


@pytest.fixture
def level(tmp_path):
    """Return the file of `builder`."""
    return write(tmp_path / "level.glb", builder())


def builder(extras=None):
    """Return a document with the nodes Floor, House and Shed.

    House has the children Wall, UCX_Wall and Bulb, which is a light. Shed has another child Wall.
    """
    b = GltfBuilder()
    b.json["extensions"] = {"KHR_lights_punctual": {"lights": [{"type": "point"}]}}

    def part(name, height):
        mesh = b.mesh(b.primitive(QUAD + np.float32([0, 0, height]), QUAD_TRIANGLE), name=f"{name} mesh")
        return b.node(mesh=mesh, name=name)

    part("Floor", 0)
    inside = [part("Wall", 1), part("UCX_Wall", 2)]
    bulb = b.node(name="Bulb", extensions={"KHR_lights_punctual": {"light": 0}})
    b.node(name="House", children=[*inside, bulb])
    b.node(name="Shed", children=[part("Wall", 3)])
    for node in b.json["nodes"]:
        if node["name"] in (extras or {}):
            node["extras"] = {"baker": extras[node["name"]]}
    for mesh in b.json["meshes"]:
        if mesh["name"] in (extras or {}):
            mesh["extras"] = {"baker": extras[mesh["name"]]}
    return b


def chosen(path, *, lenient=False, **patterns):
    scene = load_for_bake(path, make_settings({"name_rules": False, **patterns}), lenient=lenient)
    assert len({i.mesh for i in scene.instances}) == len(scene.meshes)
    heights = [float(scene.meshes[i.mesh].position[0, 2]) for i in scene.instances]
    return heights, len(scene.lights), [w.object for w in scene.warnings if w.code == "no-match"]


@pytest.mark.parametrize(
    ("patterns", "heights", "lights"),
    [
        ({}, [0, 1, 2, 3], 1),
        ({"exclude": "UCX_*"}, [0, 1, 3], 1),
        ({"exclude": "Wall"}, [0, 2], 1),
        ({"exclude": "House/Wall"}, [0, 2, 3], 1),
        ({"exclude": "House"}, [0, 3], 0),
        ({"exclude": "Bulb"}, [0, 1, 2, 3], 0),
        ({"exclude": ["UCX_*", "Shed"]}, [0, 1], 1),
        ({"include": "House"}, [1, 2], 1),
        ({"include": "*/Wall"}, [1, 3], 1),
        ({"include": "House/*,Floor", "exclude": "UCX_*"}, [0, 1], 1),
        ({"object": "House exclude=true"}, [0, 3], 0),
        ({"object": ["House exclude=true", "Wall exclude=false"]}, [0, 1, 3], 0),
        ({"name_rules": True}, [0, 1, 3], 1),
        ({"name_rules": True, "object": "UCX_* exclude=false"}, [0, 1, 2, 3], 1),
    ],
)
def test_patterns_choose_objects_and_lights(level, patterns, heights, lights):
    assert chosen(level, **patterns) == (heights, lights, [])
    assert chosen(level, lenient=True, **patterns) == (heights, lights, [])


def test_a_pattern_that_matches_nothing_is_named(level):
    assert chosen(level, exclude="wall") == ([0, 1, 2, 3], 1, ["wall"])


def test_nothing_left_is_refused(level):
    with pytest.raises(InputError, match="no object is left to bake"):
        chosen(level, exclude="*")


def test_a_pattern_of_include_that_matches_nothing_is_refused(level):
    with pytest.raises(InputError, match=r"'Hose' matches no object .*; did you mean 'House'"):
        chosen(level, include="Floor,Hose")


def test_the_checker_sees_only_what_is_left(level):
    source = load_for_bake(level, make_settings({"exclude": "House"}), lenient=True).source_scene
    assert [m.name for m in source.meshes] == ["Floor mesh", "Wall mesh"]
    assert [(i.name, i.mesh) for i in source.instances] == [("Floor", 0), ("Wall", 1)]


def test_objects_of_other_formats_are_chosen_by_name(tmp_path):
    path = tmp_path / "a.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\no one\nf 1 2 3\no two\nf 1 2 4\n")
    scene = load_for_bake(path, make_settings({"exclude": "one"}))
    assert [i.name for i in scene.instances] == ["two"]


def settings_of(path, **settings):
    """Return {name of mesh: (settings that are given, reasons)} of all objects, left out ones included."""
    scene = load_for_bake(path, make_settings(settings))
    return {
        (i.name, i.node): (i.settings.given(), dict(i.reasons)) for i in (*scene.instances, *scene.left_out)
    }


def test_later_sources_override_earlier_ones_by_key(tmp_path):
    extras = {
        "House": {"cast": False, "density": 3, "samples": 2},
        "Wall mesh": {"density": "4x"},
        "Wall": "density=5 group=walls",
        "UCX_Wall": {"exclude": False, "check": {"ignore": True}},
    }
    path = write(tmp_path / "a.glb", builder(extras))
    found = settings_of(path, object=["*Wall density=6", "House/Wall density=7 cast=true"])
    assert found["Floor", 0] == ({}, {})
    assert found["UCX_Wall", 2][0] == {"cast": False, "density": "6", "samples": 2.0}
    given, reasons = found["Wall", 1]
    assert given == {"density": "7", "samples": 2.0, "group": "walls"}
    assert reasons == {
        "cast": "object 'House/Wall'",
        "density": "object 'House/Wall'",
        "samples": "extras.baker of node 'House'",
        "group": "extras.baker of node 'Wall'",
    }
    assert settings_of(path)["Wall", 1][0]["density"] == "5"


@pytest.mark.parametrize(
    ("extras", "message"),
    [
        ({"casts": False}, "no object key 'casts'; did you mean 'cast'"),
        ({"density": 0}, "'density' is neither"),
        ("density", "'density' is not of the form key=value"),
        ([1], "neither an object nor a text"),
        ({"uv": "pack"}, "'uv' should be 'auto', 'keep' or 'unwrap'"),
    ],
)
def test_wrong_extras_name_file_and_node(extras, message, tmp_path):
    path = write(tmp_path / "a.glb", builder({"House": extras}))
    with pytest.raises(InputError, match=message) as caught:
        settings_of(path)
    assert (caught.value.file, caught.value.object) == (str(path), "node 'House'")


@pytest.mark.parametrize(
    ("rule", "message"),
    [
        ("Wall", "sets nothing"),
        ("cast=false", "starts with a pattern"),
        ("Wall cost=1", "no object key 'cost'; did you mean 'cast'"),
        ("Wall cast=2", "valid boolean"),
        ("Wall density=-1x", "neither texels per metre"),
        ("Wall samples=99", "less than or equal to 16"),
        ("Wall a cast=no", "'a' is not of the form"),
        ("Wall cast=no cast=yes", "given twice"),
        ({"cast": False}, "needs the key 'match'"),
        (7, "list of rules|valid tuple"),
        ("Wall cast='no", "quote without end"),
    ],
)
def test_wrong_rules_are_sentences(rule, message):
    with pytest.raises(SettingsError, match=message):
        make_settings({"object": rule})


def test_rules_are_texts_or_tables():
    tables = [{"match": "a b/*", "density": 40, "cast": False}, {"match": "c", "group": "two words"}]
    found = make_settings({"object": tables}).object
    assert found == ("'a b/*' density=40 cast=false", "c 'group=two words'")
    assert make_settings({"object": list(found)}).object == found


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        ("UCX_Wall", "collision hull"),
        ("ubx_wall_01", "collision hull"),
        ("Wall-col", "collision hull"),
        ("Wall-colonly.001", "collision hull"),
        ("Wall_collision", "collision hull"),
        ("collider", "collision hull"),
        ("Rock_LOD1", "lower level of detail"),
        ("Rock_lod12.003", "lower level of detail"),
        ("Rock_LOD0", None),
        ("Rock_LOD", None),
        ("Protocol", None),
        ("Wall-column", None),
        ("collisions", None),
        ("UCXWall", None),
    ],
)
def test_names_of_objects_that_no_player_sees(name, kind):
    assert unseen_kind(name) == kind


def test_objects_left_out_by_name_are_named(level):
    scene = load_for_bake(level, make_settings({}))
    note = next(w for w in scene.warnings if w.code == "left-out-by-name")
    assert "'UCX_Wall' is left out" in note.message
    assert "`name_rules=False`" in note.message
    assert [i.name for i in scene.left_out] == ["UCX_Wall"]


def test_left_out_objects_of_other_formats_stay_in_the_written_scene(tmp_path):
    path = tmp_path / "a.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\no one\nf 1 2 3\no two\nf 1 2 4\no three\nf 1 3 4\n")
    rules = {"exclude": "one", "object": "three receive=false double_sided=true"}
    baker.bake(path, out=tmp_path / "out", channels="ao", samples=1, resolution=16, **rules)
    written = baker.load(tmp_path / "out" / "scene.glb")
    assert [i.name for i in written.instances] == ["one", "two", "three"]
    assert [m.texcoord[1] is not None for m in written.meshes] == [False, True, False]
    assert not any(m.double_sided for m in written.materials)
    stored = read_bake(tmp_path / "out")
    assert [i.name for i in stored.scene.instances] == ["two", "three"]
    assert [layout.receives for layout in stored.atlas.layouts] == [True, False]
    assert [stored.scene.materials[m.material[0]].double_sided for m in stored.scene.meshes] == [False, True]


def test_a_file_of_nothing_but_a_lower_level_of_detail_is_baked(tmp_path):
    b = GltfBuilder()
    b.node(mesh=b.mesh(b.primitive(QUAD, QUAD_TRIANGLE)), name="Rock_LOD2")
    scene = load_for_bake(write(tmp_path / "a.glb", b), make_settings({}))
    assert [i.name for i in scene.instances] == ["Rock_LOD2"]
    assert scene.warnings == ()
