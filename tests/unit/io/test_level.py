"""Level files place scene files, and override lights and materials."""

from __future__ import annotations

import numpy as np
import pytest
from gltf_builder import QUAD, QUAD_TRIANGLE, GltfBuilder, write

import baker
from baker.core.errors import InputError
from baker.core.settings import make_settings
from baker.io.bake.read_bake import read_bake
from baker.io.load import load_for_bake, load_scene
from baker.io.scene_files import scene_files


@pytest.fixture
def folder(tmp_path):
    """Return a folder with house.glb: a group with a square and a hull, and a light."""
    b = GltfBuilder()
    b.json["extensions"] = {"KHR_lights_punctual": {"lights": [{"type": "spot", "intensity": 5, "spot": {}}]}}
    b.json["materials"] = [{"name": "Neon", "emissiveFactor": [0, 0, 1]}]
    wall = b.mesh(b.primitive(QUAD, QUAD_TRIANGLE, material=0), name="wall")
    hull = b.mesh(b.primitive(QUAD, QUAD_TRIANGLE), name="hull")
    inside = [
        b.node(name="Wall", mesh=wall, translation=[1, 0, 0], extras={"baker": {"samples": 2}}),
        b.node(name="UCX_Wall", mesh=hull),
    ]
    b.node(name="Group", children=inside)
    spot = {"KHR_lights_punctual": {"light": 0}}
    b.node(name="Bulb", translation=[0, 3, 0], extensions=spot)
    write(tmp_path / "house.glb", b)
    return tmp_path


def level(folder, text):
    path = folder / "town.level"
    path.write_text(text)
    return path


TWO = """
[[place]]
file = "house.glb"
name = "a"
[[place]]
file = "house.glb"
name = "b"
at = [10, 0, 0]
rotate = 90
scale = 2
"""


def test_places_move_objects_and_lights(folder):
    scene = load_scene(level(folder, TWO))
    names = ["a/Group/Wall", "a/Group/UCX_Wall", "b/Group/Wall", "b/Group/UCX_Wall"]
    assert [i.name for i in scene.instances] == names
    assert [light.name for light in scene.lights] == ["a/Bulb", "b/Bulb"]
    # Places of one file share its meshes. A turn of 90 degrees about +Y takes +X to -Z.
    assert [i.mesh for i in scene.instances] == [0, 1, 0, 1]
    matrix = scene.instances[2].world_from_object
    assert matrix[:3, 3] == pytest.approx([10, 0, -2], abs=1e-12)
    assert matrix[:3, 0] == pytest.approx([0, 0, -2], abs=1e-12)
    assert scene.lights[1].position == pytest.approx((10, 6, 0))
    assert scene.lights[1].direction == pytest.approx((-1, 0, 0))
    assert scene.lights[1].intensity == (5, 5, 5)
    turned = load_scene(level(folder, TWO.replace("90", "[90, 90, 0]"))).instances[2].world_from_object
    # About X first: +Y to +Z, which the turn about Y takes to +X.
    assert turned[:3, 1] == pytest.approx([2, 0, 0], abs=1e-12)


def test_overrides(folder):
    text = TWO + (
        "[[light]]\nmatch = 'b/*'\nintensity = 7\ncolour = [1, 0.5, 0]\n"
        "[[light]]\nmatch = 'a/Bulb'\noff = true\n"
        "[[material]]\nmatch = 'Ne*'\nemission = 3\nbase_colour = [0.1, 0.2, 0.3]\ndouble_sided = true\n"
        "[[material]]\nmatch = 'x'\n"
    )
    scene = load_scene(level(folder, text))
    assert [light.intensity for light in scene.lights] == [(0, 0, 0), (7, 3.5, 0)]
    neon = next(m for m in scene.materials if m.name == "Neon")
    assert (neon.emission, neon.base_colour, neon.double_sided) == ((3, 3, 3), (0.1, 0.2, 0.3, 1), True)
    assert [w.object for w in scene.warnings if w.code == "no-match"] == ["x"]


def test_a_level_is_baked_and_read_again(folder):
    path = level(folder, TWO)
    rules = {"object": "b/Group/Wall receive=false"}
    baker.bake(path, out=folder / "out", channels="ao", samples=1, resolution=16, **rules)
    stored = read_bake(folder / "out")
    assert [i.name for i in stored.scene.instances] == ["a/Group/Wall", "b/Group/Wall"]
    assert [i.settings.given() for i in stored.scene.instances] == [
        {"samples": 2.0},
        {"receive": False, "samples": 2.0},
    ]
    assert [i.name for i in stored.scene.left_out] == ["a/Group/UCX_Wall", "b/Group/UCX_Wall"]
    first = load_for_bake(path, make_settings({}))
    assert np.array_equal(stored.scene.instances[1].world_from_object, first.instances[1].world_from_object)


def test_the_hash_covers_all_files(folder):
    path = level(folder, TWO)
    before = load_scene(path).sha256
    assert scene_files(path) == [path, *[folder / "house.glb"] * 2]
    text = (folder / "house.glb").read_bytes()
    (folder / "house.glb").write_bytes(text.replace(b"UCX_Wall", b"UCX_Will"))
    changed = load_scene(path).sha256
    path.write_text(TWO + "# note\n")
    assert len({before, changed, load_scene(path).sha256}) == 3


def test_check_sees_the_objects_of_a_level(folder):
    found = baker.check(level(folder, TWO)).to_dict()["findings"]
    assert not any(finding["severity"] == "error" for finding in found)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "places nothing"),
        ("[[place]]\nfile = 'none.glb'\n", "does not exist"),
        ("[[place]]\nname = 'a'\n", "needs the key 'file'"),
        ("[[place]]\nfile = 'house.glb'\nturn = 3\n", "no key 'turn'"),
        ("[[place]]\nfile = 'house.glb'\nat = [1, 2]\n", "'at' is not 3 numbers"),
        ("[[place]]\nfile = 'house.glb'\nscale = 0\n", "'scale' is 0"),
        ("[[place]]\nfile = 'a.level'\n", "cannot place another level"),
        (TWO.replace("'b'", "'a'").replace('"b"', '"a"'), "two places have the same name"),
        (TWO + "[[light]]\nintensity = 1\n", "needs the key 'match'"),
        (TWO + "[[light]]\nmatch = 'a*'\nintensity = -1\n", "'intensity' is negative"),
        (TWO + "[lights]\n", "no table 'lights'; did you mean 'light'"),
        ("place = 3\n", "must be a list of tables"),
        ("[[place]\n", "not valid TOML"),
    ],
)
def test_wrong_levels_are_sentences(folder, text, message):
    path = level(folder, text)
    with pytest.raises(InputError, match=message):
        load_scene(path)
