"""Instances of a mesh: one geometry in scene.glb, and for each instance its own light in the pages."""

from __future__ import annotations

import math

import numpy as np
import pytest
from gltf_builder import GltfBuilder, write
from instance_scenes import WrittenBake, add_light, box_arrays, boxes, irradiance

import baker
from baker.io.bake.read_bake import read_bake

# Members of the nodes: plain, mirrored, three times as large, turned, stretched, and below a moved parent.
NODES = [
    {"translation": [-4, 0, 0]},
    {"translation": [-2, 0, 0], "scale": [-1, 1, 1]},
    {"translation": [0, 0, -6], "scale": [3, 3, 3]},
    {"translation": [2, 0, 0], "rotation": [0, math.sin(0.35), 0, math.cos(0.35)]},
    {"translation": [4, 0, 1], "scale": [1, 1.5, 1]},
    {"translation": [1, 0, 0], "scale": [0.5, -0.5, 0.5]},
]
QUICK = {"samples": 4, "bounces": 0, "denoise": False}
# Largest error of a lookup, relative to E or to 1 lx: a texel stores a mean over its area.
MISS = 5e-3


def bake(folder, builder, **settings):
    """Bake a scene into `folder` and return what was written and the result."""
    folder.mkdir(parents=True, exist_ok=True)
    given = {"channels": ["irradiance"], "resolution": 128, **QUICK, **settings}
    result = baker.bake(write(folder / "scene.glb", builder), out=folder / "out", **given)
    return WrittenBake(folder / "out"), result


def is_lit_right(written, node, n=24):
    """Return whether lookups at surface points of a node give the closed form of the irradiance."""
    points = zip(*written.samples(node, n, seed=node), strict=True)
    pairs = [(irradiance(p, normal), written.value(node, uv)[0]) for p, normal, uv in points]
    return all(abs(found - wanted) <= MISS * max(wanted, 1.0) for wanted, found in pairs)


def nested(builder):
    """Put the last box below a turned, moved and enlarged node."""
    last = len(NODES) - 1
    parent = builder.node(
        children=[last], translation=[2, 0, 3], rotation=[0, 1, 0, 0], scale=[1.6, 1.6, 1.6], name="parent"
    )
    light = parent - 1
    builder.json["scenes"] = [{"nodes": [*range(last), light, parent]}]
    return builder


@pytest.fixture(scope="module")
def plain(tmp_path_factory):
    return bake(tmp_path_factory.mktemp("instances"), nested(boxes(NODES)), resolution=256)


@pytest.mark.parametrize("node", range(len(NODES)))
def test_each_instance_has_its_own_light(plain, node):
    assert is_lit_right(plain[0], node)


def test_the_lookup_of_another_instance_would_be_wrong(plain):
    written, _ = plain
    rows = dict(written.rows)
    written.rows[0] = {**rows[0], "uv_offset": rows[3]["uv_offset"]}
    try:
        assert not is_lit_right(written, 0)
    finally:
        written.rows.update(rows)


def test_the_file_has_the_geometry_once(plain, tmp_path):
    written, _ = plain
    document = written.glb.json
    assert [written.rows[node]["mesh"] for node in range(len(NODES))] == [0] * len(NODES)
    assert len(document["meshes"]) == 1
    assert [document["nodes"][node]["mesh"] for node in range(len(NODES))] == [0] * len(NODES)
    # Positions, normals, lightmap uv (also as TEXCOORD_0) and indices; one vertex for each corner of a face.
    assert len(written.glb.binary) == 24 * (12 + 12 + 8) + 36 * 2
    separate, _ = bake(tmp_path, nested(boxes(NODES)), instances="unique")
    assert len({row["mesh"] for row in separate.rows.values()}) == len(NODES)
    assert all(row["uv_scale"] == [1, 1] and row["uv_offset"] == [0, 0] for row in separate.rows.values())
    assert is_lit_right(separate, 2)


def test_larger_instances_get_more_texels(plain):
    written, _ = plain
    scale = [written.rows[node]["uv_scale"][0] for node in range(len(NODES))]
    assert scale[2] / scale[0] == pytest.approx(3.0, rel=1e-6)
    assert scale[5] / scale[0] == pytest.approx(0.8, rel=1e-2)
    assert scale[1] == scale[3] == scale[0]
    density = {row["density"] for row in written.rows.values()}
    assert len(density) == 1


def test_a_bake_that_is_read_has_the_uv_of_the_bake(plain):
    written, result = plain
    stored = read_bake(written.out)
    for mine, theirs in zip(result.atlas.layouts, stored.atlas.layouts, strict=True):
        assert (mine.instance, mine.page) == (theirs.instance, theirs.page)
        assert np.array_equal(mine.uv[mine.triangle], theirs.uv[theirs.triangle])


def test_ao_has_a_place_for_each_instance_in_the_core_file(tmp_path):
    grey = {"pbrMetallicRoughness": {"baseColorFactor": [0.5, 0.5, 0.5, 1]}}
    written, _ = bake(tmp_path, boxes(NODES[:3], material=grey), channels=["irradiance", "ao"])
    document = written.glb.json
    assert "KHR_texture_transform" in document["extensionsUsed"]
    assert len({row["mesh"] for row in written.rows.values()}) == 3
    assert len({str(written.primitives(node)[0]["attributes"]) for node in range(3)}) == 1
    for node, row in written.rows.items():
        texture = document["materials"][written.primitives(node)[0]["material"]]["occlusionTexture"]
        assert texture["texCoord"] == 1
        place = texture["extensions"]["KHR_texture_transform"]
        assert (place["scale"], place["offset"]) == (row["uv_scale"], row["uv_offset"])


def test_variants_of_shared_meshes_keep_their_materials(tmp_path):
    builder = boxes(NODES[:2], material={"name": "day"})
    night = builder.add("materials", {"name": "night"})
    mapping = {"variants": [0], "material": night}
    primitive = builder.json["meshes"][0]["primitives"][0]
    primitive["extensions"] = {"KHR_materials_variants": {"mappings": [mapping]}}
    builder.json["extensions"]["KHR_materials_variants"] = {"variants": [{"name": "night"}]}
    builder.json["extensionsUsed"].append("KHR_materials_variants")
    written, _ = bake(tmp_path, builder, channels=["irradiance", "ao"])
    for node, row in written.rows.items():
        (one,) = written.primitives(node)
        other = one["extensions"]["KHR_materials_variants"]["mappings"][0]
        materials = [written.glb.json["materials"][holder["material"]] for holder in (one, other)]
        assert [material["name"] for material in materials] == ["day", "night"]
        places = [m["occlusionTexture"]["extensions"]["KHR_texture_transform"] for m in materials]
        assert all(place["offset"] == row["uv_offset"] for place in places)
        assert is_lit_right(written, node)


def test_a_hundred_instances_on_several_pages(tmp_path):
    nodes = [{"translation": [1.5 * (k % 10) - 7, 0, 1.5 * (k // 10) - 7]} for k in range(100)]
    written, result = bake(tmp_path, boxes(nodes), density=12)
    assert result.atlas.n_pages > 1
    assert {row["page"] for row in written.rows.values()} == set(range(result.atlas.n_pages))
    assert {tuple(row["uv_scale"]) for row in written.rows.values()} == {tuple(written.rows[0]["uv_scale"])}
    top = [node for node in written.rows if _top_is_right(written, node)]
    assert len(top) == 100


def _top_is_right(written, node):
    """Return whether lookups on the upper face, which no other box shades, are right."""
    point, normal, uv = written.samples(node, 40, seed=node)
    up = normal[:, 1] > 0.9
    pairs = [
        (irradiance(p, n), written.value(node, q)[0])
        for p, n, q in zip(point[up], normal[up], uv[up], strict=True)
    ]
    return bool(pairs) and all(abs(found - wanted) <= MISS * wanted for wanted, found in pairs)


def test_instances_of_the_extension_are_baked(tmp_path):
    builder = GltfBuilder()
    position, normal, triangle = box_arrays()
    mesh = builder.mesh(builder.primitive(position, triangle, NORMAL=normal))
    attributes = {
        "TRANSLATION": builder.accessor(np.float32([[-3, 0, 0], [0, 0, 1], [3, 0, 0]])),
        "SCALE": builder.accessor(np.float32([[1, 1, 1], [2, 2, 2], [-1, 1, 1]])),
    }
    builder.node(mesh=mesh, name="crowd", extensions={"EXT_mesh_gpu_instancing": {"attributes": attributes}})
    add_light(builder)
    builder.json["extensionsUsed"].append("EXT_mesh_gpu_instancing")
    written, _ = bake(tmp_path, builder)
    assert len(written.rows) == 3
    assert len({row["mesh"] for row in written.rows.values()}) == 1
    assert all(is_lit_right(written, node) for node in written.rows)


def test_a_valid_texcoord_1_stays_as_it_is(tmp_path):
    position, normal, triangle = box_arrays()
    face = np.float32([[0, 0], [1, 0], [1, 1], [0, 1]])
    uv = np.concatenate([(face * 0.8 + 0.1 + [k % 3, k // 3]) / [3, 2] for k in range(6)]).astype(np.float32)
    builder = GltfBuilder()
    mesh = builder.mesh(builder.primitive(position, triangle, NORMAL=normal, TEXCOORD_0=uv, TEXCOORD_1=uv))
    for members in NODES[:3]:
        builder.node(mesh=mesh, **members)
    add_light(builder)
    written, _ = bake(tmp_path, builder)
    assert written.glb.binary[: len(builder.blob)] == builder.blob
    assert {row["uv"] for row in written.rows.values()} == {"kept"}
    assert len({row["mesh"] for row in written.rows.values()}) == 1
    assert all(is_lit_right(written, node) for node in written.rows)
