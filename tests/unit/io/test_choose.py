"""The settings `include` and `exclude` choose objects and lights by the name or path of their nodes."""

from __future__ import annotations

import numpy as np
import pytest
from gltf_builder import QUAD, QUAD_TRIANGLE, GltfBuilder, write

from baker.core.errors import InputError
from baker.core.settings import make_settings
from baker.io.load import load_for_bake


@pytest.fixture
def level(tmp_path):
    """Return a file with the nodes Floor, House and Shed.

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
    return write(tmp_path / "level.glb", b)


def chosen(path, *, lenient=False, **patterns):
    scene = load_for_bake(path, make_settings(patterns), lenient=lenient)
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
    ],
)
def test_patterns_choose_objects_and_lights(level, patterns, heights, lights):
    assert chosen(level, **patterns) == (heights, lights, [])
    assert chosen(level, lenient=True, **patterns) == (heights, lights, [])


def test_a_pattern_that_matches_nothing_is_named(level):
    assert chosen(level, exclude="wall") == ([0, 1, 2, 3], 1, ["wall"])


def test_nothing_left_is_refused(level):
    with pytest.raises(InputError, match="leave no object"):
        chosen(level, include="Roof")


def test_the_checker_sees_only_what_is_left(level):
    source = load_for_bake(level, make_settings({"exclude": "House"}), lenient=True).source_scene
    assert [m.name for m in source.meshes] == ["Floor mesh", "Wall mesh"]
    assert [(i.name, i.mesh) for i in source.instances] == [("Floor", 0), ("Wall", 1)]


def test_objects_of_other_formats_are_chosen_by_name(tmp_path):
    path = tmp_path / "a.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\no one\nf 1 2 3\no two\nf 1 2 4\n")
    scene = load_for_bake(path, make_settings({"exclude": "one"}))
    assert [i.name for i in scene.instances] == ["two"]
