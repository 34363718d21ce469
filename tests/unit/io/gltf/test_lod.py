"""Only the first level of detail of MSFT_lod is baked; the others stay in scene.glb."""

from __future__ import annotations

import pytest
from glb_reader import Glb
from gltf_builder import QUAD, QUAD_TRIANGLE, GltfBuilder
from io_scenes import make_atlas, split_layout, write

from baker.io.gltf.write_baked import make_glb
from baker.io.load import load_scene


def builder(*, ids, in_scene=True):
    made = GltfBuilder()
    mesh = made.mesh(made.primitive(QUAD, QUAD_TRIANGLE))
    low = made.mesh(made.primitive(QUAD, QUAD_TRIANGLE[:1]))
    made.node(name="rock", mesh=mesh, extensions={"MSFT_lod": {"ids": ids}})
    made.node(name="rock_low", mesh=low, children=[2])
    made.node(name="moss_low", mesh=low)
    made.json["scenes"] = [{"nodes": [0, 1] if in_scene else [0]}]
    made.json["extensionsUsed"] = made.json["extensionsRequired"] = ["MSFT_lod"]
    return made


@pytest.mark.parametrize("in_scene", [True, False])
def test_lower_levels_and_nodes_below_them_are_left_out(tmp_path, in_scene):
    scene = load_scene(write(tmp_path / "a.glb", builder(ids=[1], in_scene=in_scene)))
    assert [instance.name for instance in scene.instances] == ["rock"]
    (warning,) = scene.warnings
    assert (warning.code, warning.object) == ("lower-levels", "rock")
    after = Glb(make_glb(scene, make_atlas(split_layout(scene, 0))).data)
    assert [node["name"] for node in after.json["nodes"]] == ["rock", "rock_low", "moss_low"]
    assert after.json["nodes"][0]["extensions"] == {"MSFT_lod": {"ids": [1]}}
    assert "TEXCOORD_1" not in after.json["meshes"][1]["primitives"][0]["attributes"]


@pytest.mark.parametrize("ids", [[], [9], ["a"], None])
def test_broken_levels_change_nothing(tmp_path, ids):
    scene = load_scene(write(tmp_path / "a.glb", builder(ids=ids)))
    assert len(scene.instances) == 3
    assert not scene.warnings
