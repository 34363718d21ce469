"""The GLB of `make_glb` has the uv and AO of the bake. All other data equal those of the source file."""

from __future__ import annotations

import copy
import json
from pathlib import Path

import numpy as np
import pytest
from glb_reader import Glb
from gltf_builder import QUAD, QUAD_NORMAL, QUAD_TRIANGLE, GltfBuilder, write
from io_scenes import PICTURE, kept_layout, make_atlas, rich_builder, split_layout

from baker.core.errors import InputError
from baker.core.scene import Scene
from baker.io.gltf.write_baked import make_glb
from baker.io.load import load_scene
from baker.io.png import encode_png

PNG = {page: encode_png(np.full((16, 16), 100 + page, np.uint8)) for page in range(3)}


def triangle_set(corners: dict[str, np.ndarray]) -> set[tuple[bytes, ...]]:
    """Return a set with one tuple per triangle: the bytes of each attribute at the three corners."""
    names = sorted(corners)
    count = len(corners[names[0]])
    return {tuple(corners[name][t].tobytes() for name in names) for t in range(count)}


@pytest.fixture
def rich(tmp_path: Path) -> tuple[Glb, Glb, Scene]:
    """Return the document of `rich_builder`, the document that `make_glb` writes for it, and the scene."""
    path = write(tmp_path / "rich.glb", rich_builder())
    scene = load_scene(path)
    assert [i.node for i in scene.instances] == [0, 1, 5]
    atlas = make_atlas(split_layout(scene, 0), split_layout(scene, 1, page=1), split_layout(scene, 2, page=1))
    (tmp_path / "out.glb").write_bytes(make_glb(scene, atlas, PNG).data)
    return Glb(path), Glb(tmp_path / "out.glb"), scene


def test_triangles_keep_every_attribute_and_order_of_corners(rich: tuple[Glb, Glb, Scene]) -> None:
    before, after, _ = rich
    source = before.json["meshes"][0]["primitives"][0]
    names = list(source["attributes"])
    assert {"JOINTS_0", "WEIGHTS_0", "_HEAT", "COLOR_0", "NORMAL"} < set(names)
    wanted = triangle_set({n: before.corners(source, n) for n in names})
    for node in (0, 1):
        found = after.json["meshes"][after.json["nodes"][node]["mesh"]]["primitives"][0]
        assert triangle_set({n: after.corners(found, n) for n in names}) == wanted
        for name in names:
            old = before.json["accessors"][source["attributes"][name]]
            new = after.json["accessors"][found["attributes"][name]]
            for key in ("componentType", "type", "normalized", "name"):
                assert new.get(key) == old.get(key), f"{name}: {key}"


def test_sparse_morph_target_follows_the_vertices(rich: tuple[Glb, Glb, Scene]) -> None:
    before, after, _ = rich
    source = before.json["meshes"][0]["primitives"][0]
    found = after.json["meshes"][after.json["nodes"][0]["mesh"]]["primitives"][0]
    pair = {"base": before.corners(source, "POSITION"), "moved": before.corners(source, "POSITION", target=0)}
    assert pair["moved"].max() == 5.0
    assert triangle_set(pair) == triangle_set(
        {"base": after.corners(found, "POSITION"), "moved": after.corners(found, "POSITION", target=0)}
    )


def test_strip_becomes_triangles_with_its_winding(rich: tuple[Glb, Glb, Scene]) -> None:
    _, after, _ = rich
    found = after.json["meshes"][after.json["nodes"][0]["mesh"]]["primitives"][1]
    assert found.get("mode", 4) == 4
    corner = after.corners(found, "POSITION").astype(np.float64)
    cross = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    assert cross[:, 2].tolist() == [1.0, 1.0], "two triangles of area 1/2 that face +z"


def test_texcoord_1_is_the_layout(rich: tuple[Glb, Glb, Scene]) -> None:
    """The triangle corners in the file have exactly the positions and uv of the layout."""
    _, after, scene = rich
    atlas = [split_layout(scene, 0), split_layout(scene, 1), split_layout(scene, 2)]
    for layout, instance in zip(atlas, scene.instances, strict=True):
        mesh = scene.meshes[instance.mesh]
        wanted = triangle_set(
            {"position": mesh.position[layout.vertex][layout.triangle], "uv": layout.uv[layout.triangle]}
        )
        found = set()
        for primitive in after.json["meshes"][after.json["nodes"][instance.node]["mesh"]]["primitives"]:
            if primitive.get("mode", 4) == 4:
                corner = {"position": after.corners(primitive, "POSITION")}
                found |= triangle_set({**corner, "uv": after.corners(primitive, "TEXCOORD_1")})
        assert found == wanted


def test_everything_else_is_as_it_was(rich: tuple[Glb, Glb, Scene]) -> None:
    before, after, _ = rich
    old, new = before.json, after.json
    for key in ("scenes", "scene", "animations", "skins", "cameras", "extensions", "extensionsUsed"):
        assert new[key] == old[key], key
    for key in ("images", "textures", "samplers", "materials"):
        changed = [{k: v for k, v in item.items() if k != "occlusionTexture"} for item in new[key]]
        assert changed[: len(old[key])] == old[key], key
    for index, (a, b) in enumerate(zip(old["nodes"], new["nodes"], strict=True)):
        assert {**a, "mesh": None} == {**b, "mesh": None}, index
    assert new["asset"]["copyright"] == "someone"
    assert new["asset"]["extras"]["level"] == 3
    assert set(new["asset"]["extras"]["baker"]) == {"version"}
    sampler = new["animations"][0]["samplers"][0]
    for index in (sampler["input"], sampler["output"], new["skins"][0]["inverseBindMatrices"]):
        assert np.array_equal(after.accessor(index), before.accessor(index))
    assert after.view(new["images"][0]["bufferView"]) == PICTURE
    for node in (0, 1):
        mesh = new["meshes"][new["nodes"][node]["mesh"]]
        assert {k: v for k, v in mesh.items() if k != "primitives"} == {
            k: v for k, v in old["meshes"][0].items() if k != "primitives"
        }
        assert mesh["primitives"][0]["extras"] == {"part": "front"}


def test_each_instance_has_its_own_mesh_and_the_unbaked_node_the_old_one(
    rich: tuple[Glb, Glb, Scene],
) -> None:
    before, after, _ = rich
    meshes = [after.json["nodes"][node]["mesh"] for node in (0, 1, 4, 5)]
    assert len(set(meshes)) == 4
    assert meshes[2:] == [0, 1], "node 4, in another scene, keeps mesh 0; node 5 keeps mesh 1"
    unbaked = after.json["meshes"][0]["primitives"]
    for a, b in zip(before.json["meshes"][0]["primitives"], unbaked, strict=True):
        assert a == b
        for name, index in b["attributes"].items():
            assert np.array_equal(after.accessor(index), before.accessor(a["attributes"][name]))


def test_the_first_of_many_instances_keeps_the_mesh_and_equal_data_is_stored_once(tmp_path: Path) -> None:
    builder, path = plain(tmp_path)
    builder.node(mesh=0, translation=[2, 0, 0])
    builder.node(mesh=0, translation=[4, 0, 0])
    scene = load_scene(write(path, builder))
    glb = make_glb(scene, make_atlas(*(split_layout(scene, i) for i in range(3))))
    after = Glb(glb.data)
    assert [node["mesh"] for node in after.json["nodes"]] == [0, 1, 2] == list(glb.instance_mesh)
    attributes = [mesh["primitives"][0]["attributes"] for mesh in after.json["meshes"]]
    assert len({a["POSITION"] for a in attributes}) == 1
    assert len({a["TEXCOORD_1"] for a in attributes}) == 3


def test_ao_is_the_occlusion_texture_of_the_page(rich: tuple[Glb, Glb, Scene]) -> None:
    _, after, scene = rich
    document = after.json
    for instance, page in zip(scene.instances, (0, 1, 1), strict=True):
        for primitive in document["meshes"][document["nodes"][instance.node]["mesh"]]["primitives"]:
            occlusion = document["materials"][primitive["material"]].get("occlusionTexture")
            if primitive.get("mode", 4) != 4:
                assert occlusion is None, "lines have no lightmap uv"
                continue
            assert (occlusion["texCoord"], occlusion["strength"]) == (1, 1)
            texture = document["textures"][occlusion["index"]]
            assert document["samplers"][texture["sampler"]] == {
                "magFilter": 9729, "minFilter": 9729, "wrapS": 33071, "wrapT": 33071,
            }  # fmt: skip
            image = document["images"][texture["source"]]
            assert image["mimeType"] == "image/png"
            assert after.view(image["bufferView"]) == PNG[page]
    names = [m.get("name") for m in document["materials"]]
    assert names.count("grey") == 3, "the original material for lines, and a copy for each of the two pages"


def test_the_same_bytes_twice_and_the_input_untouched(tmp_path: Path) -> None:
    scene = load_scene(write(tmp_path / "rich.glb", rich_builder()))
    assert scene.source is not None
    untouched = copy.deepcopy(scene.source.json)
    atlas = make_atlas(*(split_layout(scene, i) for i in range(3)))
    assert make_glb(scene, atlas, PNG).data == make_glb(scene, atlas, PNG).data
    assert scene.source.json == untouched


def plain(tmp_path: Path, **extra: object) -> tuple[GltfBuilder, Path]:
    builder = GltfBuilder()
    primitive = builder.primitive(QUAD, QUAD_TRIANGLE, NORMAL=QUAD_NORMAL, **extra)
    builder.json["accessors"][0] |= {"min": [0, 0, 0], "max": [1, 1, 0]}
    builder.node(mesh=builder.mesh(primitive))
    return builder, tmp_path / "plain.glb"


def test_replaced_data_leaves_the_file(tmp_path: Path) -> None:
    builder, path = plain(tmp_path)
    scene = load_scene(write(path, builder))
    after = Glb(make_glb(scene, make_atlas(split_layout(scene, 0))).data)
    # Six vertices of 12 (position) + 12 (normal) + 8 (uv) bytes, and six 16-bit indices.
    assert len(after.binary) == 6 * 32 + 12
    assert len(after.json["accessors"]) == 4
    assert len(after.json["bufferViews"]) == 4
    assert "materials" not in after.json
    assert "occlusionTexture" not in json.dumps(after.json)


def test_data_that_an_unknown_extension_may_name_stays(tmp_path: Path) -> None:
    builder, path = plain(tmp_path)
    builder.json["extensionsUsed"] = ["ACME_points"]
    builder.json["extensions"] = {"ACME_points": {"accessor": 0, "view": 1}}
    scene = load_scene(write(path, builder))
    before, after = Glb(path), Glb(make_glb(scene, make_atlas(split_layout(scene, 0))).data)
    assert np.array_equal(after.accessor(0), before.accessor(0))
    assert after.view(1) == before.view(1)


def test_a_valid_texcoord_1_stays_byte_for_byte(tmp_path: Path) -> None:
    builder, path = plain(tmp_path, TEXCOORD_0=QUAD[:, :2].copy(), TEXCOORD_1=QUAD[:, :2] * np.float32(0.5))
    scene = load_scene(write(path, builder))
    before, after = Glb(path), Glb(make_glb(scene, make_atlas(kept_layout(scene, 0)), PNG).data)
    assert after.binary.startswith(before.binary)
    old, new = before.json["meshes"][0]["primitives"][0], after.json["meshes"][0]["primitives"][0]
    assert {**new, "material": None} == {**old, "material": None}
    assert after.json["accessors"] == before.json["accessors"]
    assert after.json["materials"] == [{"occlusionTexture": {"index": 0, "texCoord": 1, "strength": 1.0}}]


def test_a_texture_on_the_old_texcoord_1_moves_along(tmp_path: Path) -> None:
    old_uv = np.float32([[0.1, 0.2], [0.3, 0.4], [0.5, 0.6], [0.7, 0.8]])
    builder, path = plain(tmp_path, TEXCOORD_0=QUAD[:, :2].copy(), TEXCOORD_1=old_uv)
    texture = builder.image(encode_png(np.full((2, 2, 3), 200, np.uint8)))
    transform = {"KHR_texture_transform": {"texCoord": 1, "scale": [2, 2]}}
    builder.add(
        "materials",
        {
            "pbrMetallicRoughness": {"baseColorTexture": {"index": texture, "texCoord": 1}},
            "emissiveTexture": {"index": texture, "extensions": transform},
            "normalTexture": {"index": texture},
            "occlusionTexture": {"index": texture, "texCoord": 1, "strength": 0.5},
        },
    )
    builder.json["extensionsUsed"] = ["KHR_texture_transform"]
    builder.json["meshes"][0]["primitives"][0]["material"] = 0
    scene = load_scene(write(path, builder))
    after = Glb(make_glb(scene, make_atlas(split_layout(scene, 0)), PNG).data)
    primitive = after.json["meshes"][0]["primitives"][0]
    moved = triangle_set({n: after.corners(primitive, n) for n in ("TEXCOORD_0", "TEXCOORD_2")})
    assert moved == triangle_set(
        {"TEXCOORD_0": QUAD[QUAD_TRIANGLE][:, :, :2].copy(), "TEXCOORD_2": old_uv[QUAD_TRIANGLE]}
    )
    material = after.json["materials"][primitive["material"]]
    assert material["pbrMetallicRoughness"]["baseColorTexture"]["texCoord"] == 2
    assert material["emissiveTexture"]["extensions"]["KHR_texture_transform"]["texCoord"] == 2
    assert "texCoord" not in material["normalTexture"]
    assert material["occlusionTexture"] == {"index": 1, "texCoord": 1, "strength": 1.0}
    assert len(after.json["materials"]) == 1


def test_without_ao_the_old_occlusion_stays_and_moves_along(tmp_path: Path) -> None:
    builder, path = plain(tmp_path, TEXCOORD_0=QUAD[:, :2].copy(), TEXCOORD_1=QUAD[:, :2].copy())
    texture = builder.image(encode_png(np.full((2, 2, 3), 200, np.uint8)))
    builder.add("materials", {"occlusionTexture": {"index": texture, "texCoord": 1}})
    builder.json["meshes"][0]["primitives"][0]["material"] = 0
    scene = load_scene(write(path, builder))
    after = Glb(make_glb(scene, make_atlas(split_layout(scene, 0))).data)
    assert after.json["materials"] == [{"occlusionTexture": {"index": texture, "texCoord": 2}}]
    assert "TEXCOORD_2" in after.json["meshes"][0]["primitives"][0]["attributes"]


def test_a_primitive_without_uv_gets_sets_without_a_gap(tmp_path: Path) -> None:
    builder, path = plain(tmp_path)
    scene = load_scene(write(path, builder))
    after = Glb(make_glb(scene, make_atlas(split_layout(scene, 0))).data)
    attributes = after.json["meshes"][0]["primitives"][0]["attributes"]
    assert attributes["TEXCOORD_0"] == attributes["TEXCOORD_1"]


def test_variants_get_the_ao_too(tmp_path: Path) -> None:
    builder, path = plain(tmp_path)
    for name in ("day", "night"):
        builder.add("materials", {"name": name})
    variants = {"mappings": [{"material": 1, "variants": [0]}]}
    builder.json["meshes"][0]["primitives"][0] |= {
        "material": 0, "extensions": {"KHR_materials_variants": variants},
    }  # fmt: skip
    builder.json["extensions"] = {"KHR_materials_variants": {"variants": [{"name": "night"}]}}
    builder.json["extensionsUsed"] = ["KHR_materials_variants"]
    scene = load_scene(write(path, builder))
    after = Glb(make_glb(scene, make_atlas(split_layout(scene, 0)), PNG).data)
    assert [m["occlusionTexture"]["texCoord"] for m in after.json["materials"]] == [1, 1]


def test_buffers_and_images_beside_the_file_come_into_it(tmp_path: Path) -> None:
    builder, _ = plain(tmp_path, TEXCOORD_0=QUAD[:, :2].copy())
    picture = encode_png(np.full((2, 2, 3), 90, np.uint8))
    builder.add("images", {"uri": "my%20paint.png"})
    builder.add("textures", {"source": 0})
    builder.add("materials", {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}})
    builder.json["meshes"][0]["primitives"][0]["material"] = 0
    document = builder.document()
    document["buffers"] = [{"byteLength": len(builder.blob), "uri": "level.bin", "name": "data"}]
    (tmp_path / "level.bin").write_bytes(builder.blob)
    (tmp_path / "my paint.png").write_bytes(picture)
    (tmp_path / "level.gltf").write_text(json.dumps(document))
    scene = load_scene(tmp_path / "level.gltf")
    after = Glb(make_glb(scene, make_atlas(split_layout(scene, 0)), PNG).data)
    assert "uri" not in json.dumps(after.json)
    assert after.json["images"][0]["mimeType"] == "image/png"
    assert after.json["images"][0]["name"] == "my paint"
    assert after.view(after.json["images"][0]["bufferView"]) == picture
    (tmp_path / "my paint.png").unlink()
    with pytest.raises(InputError, match=r"my%20paint\.png"):
        make_glb(scene, make_atlas(split_layout(scene, 0)))


def test_the_output_is_a_scene_again_with_the_same_uv(tmp_path: Path) -> None:
    scene = load_scene(write(tmp_path / "rich.glb", rich_builder()))
    layouts = [split_layout(scene, i) for i in range(3)]
    (tmp_path / "out.glb").write_bytes(make_glb(scene, make_atlas(*layouts), PNG).data)
    again = load_scene(tmp_path / "out.glb")
    assert [i.node for i in again.instances] == [i.node for i in scene.instances]
    for layout, instance in zip(layouts, again.instances, strict=True):
        uv = again.meshes[instance.mesh].texcoord[1]
        assert uv is not None
        assert {row.tobytes() for row in uv} == {row.tobytes() for row in layout.uv}


def test_compressed_copies_beside_plain_data_go(tmp_path: Path) -> None:
    builder, path = plain(tmp_path)
    builder.json["extensionsUsed"] = ["KHR_draco_mesh_compression"]
    draco = {"bufferView": builder.view(b"draco..."), "attributes": {"POSITION": 0}}
    primitive = builder.json["meshes"][0]["primitives"][0]
    primitive["extensions"] = {"KHR_draco_mesh_compression": draco}
    scene = load_scene(write(path, builder))
    after = Glb(make_glb(scene, make_atlas(split_layout(scene, 0))).data)
    assert "extensionsUsed" not in after.json
    assert "extensions" not in after.json["meshes"][0]["primitives"][0]
    assert after.corners(after.json["meshes"][0]["primitives"][0], "POSITION").shape == (2, 3, 3)
