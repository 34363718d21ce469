"""Files with meshopt-compressed views give the same scene and `scene.glb` as uncompressed files."""

from __future__ import annotations

import copy

import numpy as np
import pytest
from glb_reader import Glb
from gltf_builder import QUAD, QUAD_NORMAL, QUAD_TRIANGLE, GltfBuilder
from io_scenes import make_atlas, split_layout, write
from meshopt_writer import compress

from baker.core.errors import InputError
from baker.io.gltf.write_baked import make_glb
from baker.io.load import load_scene
from baker.repairs.read_back import check_readable

NAMES = ["EXT_meshopt_compression", "KHR_meshopt_compression"]
PICTURE = b"\x89PNG not decoded IEND"


def builder():
    made = GltfBuilder()
    uv = np.ascontiguousarray(QUAD[:, :2])
    primitive = made.primitive(QUAD, QUAD_TRIANGLE, NORMAL=QUAD_NORMAL, TEXCOORD_0=uv, _TAG=uv)
    made.node(mesh=made.mesh(primitive))
    made.image(PICTURE)
    made.json["images"][0]["extras"] = {"kept": True}
    return made


@pytest.mark.parametrize("name", NAMES)
def test_compressed_views_hold_the_same_mesh(tmp_path, name):
    plain = load_scene(write(tmp_path / "plain.glb", builder()))
    packed = load_scene(write(tmp_path / "packed.glb", compress(builder(), name)))
    assert not packed.warnings
    for a, b in zip(plain.meshes, packed.meshes, strict=True):
        assert np.array_equal(a.position, b.position)
        assert np.array_equal(a.normal, b.normal)
        assert np.array_equal(a.triangle, b.triangle)
        assert np.array_equal(a.texcoord[0], b.texcoord[0])


@pytest.mark.parametrize("name", NAMES)
def test_scene_glb_is_that_of_the_uncompressed_file(tmp_path, name):
    files = []
    for made in (builder(), compress(builder(), name)):
        scene = load_scene(write(tmp_path / "a.glb", made))
        files.append(Glb(make_glb(scene, make_atlas(split_layout(scene, 0))).data))
    plain, packed = files
    assert packed.json.keys() == plain.json.keys()
    assert "extensionsUsed" not in packed.json
    assert "meshopt" not in str(packed.json)
    assert packed.json["images"][0]["extras"] == {"kept": True}
    assert packed.view(packed.json["images"][0]["bufferView"]) == PICTURE
    assert len(packed.json["buffers"]) == 1
    assert packed.json["buffers"][0]["byteLength"] == plain.json["buffers"][0]["byteLength"]
    (a,), (b,) = (file.json["meshes"][0]["primitives"] for file in files)
    assert a["attributes"].keys() == b["attributes"].keys()
    for attribute in a["attributes"]:
        assert np.array_equal(plain.corners(a, attribute), packed.corners(b, attribute)), attribute


def test_a_fallback_is_used_and_its_compressed_copy_is_dropped(tmp_path):
    uncompressed = builder()
    fallback = uncompressed.blob
    packed = compress(builder(), uri="plain.bin")
    packed.json["buffers"][1]["byteLength"] = len(fallback)
    views = [view for view in packed.json["bufferViews"] if "extensions" in view]
    offsets = [view["byteOffset"] for view in uncompressed.json["bufferViews"]]
    for view, offset in zip(views, offsets, strict=False):
        view["byteOffset"] = offset
        view["extensions"]["EXT_meshopt_compression"]["mode"] = "NEVER READ"
    (tmp_path / "plain.bin").write_bytes(fallback)
    scene = load_scene(write(tmp_path / "a.glb", packed))
    assert scene.n_triangles == 2
    assert len(scene.source.buffers[0]) < len(PICTURE) + 4
    (tmp_path / "plain.bin").unlink()
    with pytest.raises(InputError, match="NEVER READ"):
        load_scene(tmp_path / "a.glb")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"count": 5}, "5 elements of 12 bytes are not the 48 bytes"),
        ({"byteOffset": 1 << 40}, "lie outside its buffer"),
        ({"buffer": 9}, "out of range"),
        ({"mode": "TRIANGLES"}, "byteStride is 12"),
        ({"filter": "BLUR"}, "'BLUR' is no filter"),
        ({"byteLength": 40}, "cut off"),
        ({"buffer": 1}, "neither a uri"),
        ({"count": None}, "expected an integer"),
    ],
)
def test_broken_streams_are_named(tmp_path, change, words):
    packed = compress(builder())
    packed.json["bufferViews"][0]["extensions"]["EXT_meshopt_compression"].update(change)
    with pytest.raises(InputError, match=words) as caught:
        load_scene(write(tmp_path / "a.glb", packed))
    assert caught.value.object.startswith(("bufferViews[0]", "buffers[1]"))


def test_a_broken_stream_that_is_not_needed_is_a_warning(tmp_path):
    packed = compress(builder())
    number = packed.json["meshes"][0]["primitives"][0]["attributes"]["_TAG"]
    view = packed.json["bufferViews"][packed.json["accessors"][number]["bufferView"]]
    view["extensions"]["EXT_meshopt_compression"]["mode"] = "BROKEN"
    before = copy.deepcopy(view)
    scene = load_scene(write(tmp_path / "a.glb", packed))
    assert {warning.code for warning in scene.warnings} == {"broken-attribute", "missing-file"}
    after = Glb(make_glb(scene, make_atlas(split_layout(scene, 0))).data)
    assert "_TAG" not in after.json["meshes"][0]["primitives"][0]["attributes"]
    assert after.json["extensionsUsed"] == ["EXT_meshopt_compression"]
    assert before["extensions"].keys() == {"EXT_meshopt_compression"}


def test_fixed_files_are_compared_with_the_decoded_scene(tmp_path):
    scene = write(tmp_path / "a.glb", compress(builder()))
    check_readable(tmp_path / "b.glb", builder().glb(), scene, allow_outside=False)


@pytest.mark.parametrize("reference", [{}, [0], "0", None, -1])
def test_malformed_references_to_buffers_do_not_stop_the_decoder(tmp_path, reference):
    packed = compress(builder())
    packed.json["bufferViews"][-1]["buffer"] = reference
    for view in packed.json["bufferViews"][:-1]:
        view["buffer"] = reference
    assert load_scene(write(tmp_path / "a.glb", packed)).n_triangles == 2
