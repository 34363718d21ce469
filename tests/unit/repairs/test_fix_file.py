"""`fix_file` preserves other data and the appearance, and a second fix changes nothing."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from glb_reader import Glb
from gltf_builder import GltfBuilder, write
from repair_scenes import PICTURE, away_from, box, drawn, random_builder, soup

from baker.core.errors import InputError, SettingsError
from baker.core.settings import make_settings
from baker.io.load import load_scene
from baker.repairs.fix_file import fix_file
from baker.repairs.settings import RepairSettings
from baker.repairs.write import check_fixed, write_fixed
from baker.uv.unwrap import unwrap_scene

SEEDS = range(24)
QUICK = RepairSettings(resolution=128)


def fix_builder(builder: GltfBuilder, folder: Path):
    """Return the document before the fix, the document after it, and the result of `fix_file`."""
    path = write(folder / "scene.glb", builder)
    fixed = fix_file(path, QUICK)
    return Glb(path), Glb(fixed.data), fixed


def primitives(glb: Glb):
    return [
        (m, k, primitive)
        for m, mesh in enumerate(glb.json.get("meshes", []))
        for k, primitive in enumerate(mesh["primitives"])
    ]


def resolved(glb: Glb, primitive) -> dict:
    """Return a primitive in which accessor indices are replaced by component type and content."""
    read = lambda index: (glb.json["accessors"][index]["componentType"], glb.accessor(index).tobytes())  # noqa: E731
    out = {**primitive, "attributes": {k: read(v) for k, v in primitive["attributes"].items()}}
    if "indices" in primitive:
        out["indices"] = read(primitive["indices"])
    if "targets" in primitive:
        out["targets"] = [{k: read(v) for k, v in t.items()} for t in primitive["targets"]]
    return out


@pytest.mark.parametrize("seed", SEEDS)
def test_what_is_not_fixed_survives(seed, tmp_path):
    before, after, fixed = fix_builder(random_builder(seed), tmp_path)
    old, new = before.json, after.json
    for key in old.keys() | new.keys():
        if key not in ("accessors", "bufferViews", "buffers", "meshes"):
            assert new[key] == old[key], key
    touched = {fix.object.split()[-1] for fix in fixed.fixed}
    for (m, _, a), (_, _, b) in zip(primitives(before), primitives(after), strict=True):
        assert {k: v for k, v in old["meshes"][m].items() if k != "primitives"} == {
            k: v for k, v in new["meshes"][m].items() if k != "primitives"
        }
        keep = lambda p: {k: v for k, v in p.items() if k not in ("attributes", "indices", "targets")}  # noqa: E731
        assert keep(a) == keep(b)
        kept = str(m) not in touched or a.get("targets") or "JOINTS_0" in a["attributes"] or "extensions" in a
        if kept or a.get("mode", 4) != 4:
            assert resolved(before, a) == resolved(after, b)
        for name, index in b["attributes"].items():
            if name in a["attributes"] and name not in ("NORMAL", "TEXCOORD_1"):
                one, two = old["accessors"][a["attributes"][name]], new["accessors"][index]
                assert (one["componentType"], one["type"]) == (two["componentType"], two["type"])
    for index in (old["extensions"]["ACME_tag"]["accessor"], *old["animations"][0]["samplers"][0].values()):
        assert np.array_equal(before.accessor(index), after.accessor(index))
    assert after.view(new["images"][0]["bufferView"]) == PICTURE


@pytest.mark.parametrize("seed", SEEDS)
def test_fixes_keep_the_attributes_of_faces(seed, tmp_path):
    """Each face with area keeps its attributes, except those that were reported as fixed."""
    before, after, fixed = fix_builder(random_builder(seed), tmp_path)
    turned = {
        fix.object.split()[-1]: fix.change.before for fix in fixed.fixed if fix.change.change == "winding"
    }
    made = {
        (fix.object.split()[-1], {"lightmap-uv": "TEXCOORD_1"}.get(fix.change.change, "NORMAL"))
        for fix in fixed.fixed
        if fix.change.change in ("lightmap-uv", "missing-normals", "bad-normals", "winding")
    }
    for (m, _, a), (_, _, b) in zip(primitives(before), primitives(after), strict=True):
        if a.get("mode", 4) != 4:
            continue
        new = {name for number, name in made if number == str(m)}
        # If normals are flipped, the handedness of tangents changes, too.
        new |= {"TANGENT"} if str(m) in turned else set()
        # A duplicate face may be removed even if its TEXCOORD_1 differs.
        new |= {"TEXCOORD_1"}
        one, two = drawn(before, a, new), drawn(after, b, new)
        gone, came = one - two, two - one
        assert len(gone) == len(came) <= turned.get(str(m), 0)
        back = lambda face: min((f[i:] + f[:i]) for f in [face[::-1]] for i in range(3))  # noqa: E731
        assert {back(face) for face in gone} == {back(back(face)) for face in came}


@pytest.mark.parametrize("seed", SEEDS)
def test_a_second_time_changes_nothing(seed, tmp_path):
    _, _, fixed = fix_builder(random_builder(seed), tmp_path)
    again = write_glb(tmp_path / "again.glb", fixed.data)
    second = fix_file(again, QUICK)
    assert second.fixed == ()
    assert second.data == fixed.data
    assert [left.reason for left in second.left_alone] == [left.reason for left in fixed.left_alone]


def test_random_files_have_every_defect(tmp_path):
    found, reasons = set(), set()
    for seed in SEEDS:
        _, _, fixed = fix_builder(random_builder(seed), tmp_path)
        found |= {fix.change.change for fix in fixed.fixed}
        reasons |= {left.reason.rpartition(": ")[2] for left in fixed.left_alone}
    assert found == {
        "zero-area-faces", "duplicate-faces", "duplicate-vertices", "winding", "missing-normals",
        "bad-normals", "lightmap-uv",
    }  # fmt: skip
    assert {"it is skinned", "it has morph targets", "its extension ACME_tag is not understood"} <= reasons


def write_glb(path: Path, data: bytes) -> Path:
    path.write_bytes(data)
    return path


def box_builder(*, uv1=None, texcoord=0, **members) -> GltfBuilder:
    """Return a document of a box with split vertices, whose texture reads the uv set `texcoord`."""
    b = GltfBuilder()
    position, triangle = box()
    flat, own = soup(position, triangle)
    image = b.image(PICTURE)
    b.add("materials", {"pbrMetallicRoughness": {"baseColorTexture": {"index": image, "texCoord": texcoord}}})
    corner = flat.reshape(-1, 3, 3).astype(np.float64)
    front = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    normal = np.repeat(front / np.linalg.norm(front, axis=1, keepdims=True), 3, axis=0).astype(np.float32)
    if uv1 is not None:
        members |= {"TEXCOORD_0": flat[:, :2].copy(), "TEXCOORD_1": uv1}
    b.node(
        mesh=b.mesh(b.primitive(flat, own.astype(np.uint16), NORMAL=normal, material=0, **members)),
        name="crate",
    )
    return b


def test_lightmap_uv_that_overlap_are_replaced(tmp_path):
    _, after, fixed = fix_builder(
        box_builder(uv1=np.tile(np.float32([[0, 0], [1, 0], [0, 1]]), (12, 1))), tmp_path
    )
    assert [fix.change.change for fix in fixed.fixed] == ["duplicate-vertices", "lightmap-uv"]
    assert "TEXCOORD_1 overlaps itself" in fixed.fixed[1].change.counted
    primitive = after.json["meshes"][0]["primitives"][0]
    uv = after.corners(primitive, "TEXCOORD_1").astype(np.float64)
    assert uv.min() >= 0
    assert uv.max() <= 1
    # The twelve triangles are halves of unit squares. In uv they have equal areas and fill most of the page.
    e1, e2 = uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]
    area = 0.5 * np.abs(e1[:, 0] * e2[:, 1] - e1[:, 1] * e2[:, 0])
    assert np.ptp(area) < 0.02 * area.mean()
    assert 0.4 < area.sum() < 1
    scene = load_scene(write_glb(tmp_path / "fixed.glb", fixed.data))
    atlas = unwrap_scene(scene, make_settings({"resolution": 128, "uv": "keep"}))
    assert atlas.layouts[0].kept


def test_lightmap_uv_that_a_texture_reads_stay(tmp_path):
    uv = np.tile(np.float32([[0, 0], [1, 0], [0, 1]]), (12, 1))
    before, after, fixed = fix_builder(box_builder(uv1=uv, texcoord=1), tmp_path)
    assert "lightmap-uv" not in {fix.change.change for fix in fixed.fixed}
    assert "a texture of its material reads them" in fixed.left_alone[0].reason
    a, b = (glb.json["meshes"][0]["primitives"][0] for glb in (before, after))
    assert drawn(before, a) == drawn(after, b)


def test_a_clean_glb_comes_out_byte_for_byte(tmp_path):
    b = GltfBuilder()
    position, triangle = box()
    b.node(
        mesh=b.mesh(b.primitive(position, triangle.astype(np.uint16), NORMAL=away_from(position, (0.5,) * 3)))
    )
    path = write(tmp_path / "clean.glb", b)
    fixed = fix_file(path, QUICK)
    assert fixed.data == path.read_bytes()
    assert fixed.fixed == fixed.left_alone == ()


def test_files_beside_the_scene_move_into_it(tmp_path):
    b = GltfBuilder()
    position, triangle = box()
    (tmp_path / "a picture.png").write_bytes(PICTURE)
    b.add("images", {"uri": "a%20picture.png"})
    b.add("textures", {"source": 0})
    b.add("materials", {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}})
    normal = away_from(position, (0.5,) * 3)
    primitive = b.primitive(
        position, triangle.astype(np.uint16), NORMAL=normal, TEXCOORD_0=position[:, :2].copy()
    )
    b.node(mesh=b.mesh({**primitive, "material": 0}))
    for name in ("scene.glb", "scene.gltf"):
        fixed = fix_file(write(tmp_path / name, b), QUICK)
        assert fixed.fixed == ()
        after = Glb(fixed.data)
        assert after.view(after.json["images"][0]["bufferView"]) == PICTURE
        assert drawn(after, after.json["meshes"][0]["primitives"][0])


def test_tangents_of_turned_faces_keep_their_bitangent(tmp_path):
    b = GltfBuilder()
    flat, own = soup(*box())
    corner = flat.reshape(-1, 3, 3).astype(np.float64)
    wrong = own.copy()
    wrong[:2] = wrong[:2, ::-1]
    front = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    front[:2] *= -1
    normal = np.repeat(front / np.linalg.norm(front, axis=1, keepdims=True), 3, axis=0).astype(np.float32)
    tangent = np.concatenate([normal[:, [1, 2, 0]], np.ones((36, 1), np.float32)], axis=1)
    b.node(mesh=b.mesh(b.primitive(flat, wrong.astype(np.uint16), NORMAL=normal, TANGENT=tangent)))
    before, after, fixed = fix_builder(b, tmp_path)
    assert [f.change.change for f in fixed.fixed if f.change.change == "winding"] == ["winding"]

    def bitangents(glb):
        primitive = glb.json["meshes"][0]["primitives"][0]
        place, n, t = (glb.corners(primitive, name) for name in ("POSITION", "NORMAL", "TANGENT"))
        made = np.cross(n, t[..., :3]) * t[..., 3:]
        return {p.tobytes(): b.tolist() for p, b in zip(place.mean(axis=1), made.mean(axis=1), strict=True)}

    one, two = bitangents(before), bitangents(after)
    assert len(one) == 12
    assert one.keys() == two.keys()
    for key in one:
        assert two[key] == pytest.approx(one[key], abs=1e-6)


def test_attributes_that_are_too_short_and_indices_that_lead_nowhere_are_named(tmp_path):
    b = box_builder(TANGENT=np.tile(np.float32([1, 0, 0, 1]), (35, 1)))
    position, triangle = box()
    wild = np.concatenate([triangle, [[0, 1, 8]]]).astype(np.uint32)
    b.node(mesh=b.mesh(b.primitive(position, wild)), name="wild")
    before, after, fixed = fix_builder(b, tmp_path)
    assert fixed.fixed == ()
    assert [left.reason.partition(": ")[2] for left in fixed.left_alone] == [
        "its attribute TANGENT has fewer elements than POSITION; export it again",
        "1 of its faces name vertices that do not exist; export it again",
    ]
    assert after.json["meshes"] == before.json["meshes"]


def _hostile(change):
    """Return a box whose primitive has a custom attribute, after a change of its JSON."""
    b = box_builder(_WEIGHT=np.zeros(36, np.float32))
    change(b.json, b.json["meshes"][0]["primitives"][0])
    return b


@pytest.mark.parametrize(
    "change",
    [
        lambda json, primitive: json["accessors"].__setitem__(primitive["attributes"]["_WEIGHT"], "a"),
        lambda json, primitive: json["accessors"][primitive["attributes"]["_WEIGHT"]].pop("count"),
        lambda json, primitive: json["accessors"][primitive["attributes"]["_WEIGHT"]].update(bufferView=99),
        lambda json, primitive: json["accessors"][primitive["attributes"]["_WEIGHT"]].update(extensions=[1]),
        lambda json, primitive: primitive["attributes"].update(_WEIGHT=99),
        lambda json, primitive: primitive["attributes"].update(_WEIGHT=-1),
        lambda json, primitive: primitive["attributes"].update(_WEIGHT="0"),
    ],
)
def test_malformed_members_that_a_bake_does_not_read_are_named(change, tmp_path):
    before, after, fixed = fix_builder(_hostile(change), tmp_path)
    assert [left.reason.partition(": ")[2] for left in fixed.left_alone] == [
        "its member _WEIGHT is malformed"
    ]
    assert after.json["meshes"] == before.json["meshes"]


@pytest.mark.parametrize("normals", [True, False])
@pytest.mark.parametrize("inside", ["nothing", "lamp", "skin"])
def test_a_body_inside_out_is_turned_and_a_room_is_not(inside, normals, tmp_path):
    b = GltfBuilder()
    position, triangle = box()
    members = {"NORMAL": -away_from(position, (0.5,) * 3)} if normals else {}
    if inside == "skin":
        members["JOINTS_0"] = np.zeros((8, 4), np.uint8)
        members["WEIGHTS_0"] = np.tile(np.float32([1, 0, 0, 0]), (8, 1))
    b.node(mesh=b.mesh(b.primitive(position, triangle[:, ::-1].astype(np.uint16), **members)), name="crate")
    if inside == "lamp":
        b.json["extensions"] = {"KHR_lights_punctual": {"lights": [{"type": "point"}]}}
        b.json["extensionsUsed"] = ["KHR_lights_punctual"]
        b.node(translation=[0.5, 0.5, 0.5], extensions={"KHR_lights_punctual": {"light": 0}})
    _, after, fixed = fix_builder(b, tmp_path)
    done = {fix.change.change: (fix.change.before, fix.change.after) for fix in fixed.fixed}
    primitive = after.json["meshes"][0]["primitives"][0]
    place = after.corners(primitive, "POSITION").astype(np.float64)
    front = np.cross(place[:, 1] - place[:, 0], place[:, 2] - place[:, 0])
    outwards = np.einsum("tx,tx->t", front, place.mean(axis=1) - 0.5) > 0
    if inside == "nothing":
        assert done["inside-out"] == (12, 0)
        assert outwards.all()
        assert (np.einsum("tkx,tx->tk", after.corners(primitive, "NORMAL"), front) > 0).all()
    else:
        assert "inside-out" not in done
        assert not outwards.any()
    if inside == "skin":
        assert "12 faces are inside out, but it is skinned" in {left.reason for left in fixed.left_alone}


@pytest.mark.parametrize("shape", ["zero scale", "shared"])
def test_a_mesh_is_fixed_once_for_all_its_nodes(shape, tmp_path):
    b = box_builder()
    b.node(mesh=0, name="second", scale=[0, 1, 1] if shape == "zero scale" else [2, 1, 1])
    _, after, fixed = fix_builder(b, tmp_path)
    assert [(fix.object, fix.node) for fix in fixed.fixed] == [("crate", 0)]
    assert [node["mesh"] for node in after.json["nodes"]] == [0, 0]


def test_nothing_is_written_over(tmp_path):
    scene, other = tmp_path / "scene.glb", tmp_path / "other.glb"
    scene.write_bytes(b"1")
    other.write_bytes(b"2")
    check_fixed(tmp_path / "new" / "fixed.glb", scene)
    check_fixed(other, scene, force=True)
    for out, force in ((other, False), (scene, True), (tmp_path / "fixed.obj", False), (tmp_path, False)):
        with pytest.raises(SettingsError):
            check_fixed(out, scene, force=force)
    (tmp_path / "link.glb").symlink_to(scene)
    with pytest.raises(SettingsError, match="the input"):
        check_fixed(tmp_path / "link.glb", scene, force=True)


def test_a_file_is_written_whole_and_nothing_else(tmp_path):
    data = box_builder().glb()
    scene = write(tmp_path / "scene.glb", data)
    write_fixed(tmp_path / "a" / "fixed.glb", data, scene)
    assert [p.name for p in (tmp_path / "a").iterdir()] == ["fixed.glb"]
    assert (tmp_path / "a" / "fixed.glb").read_bytes() == data


def test_json_is_plain(tmp_path):
    _, _, fixed = fix_builder(random_builder(3), tmp_path)
    told = json.loads(json.dumps(fixed.to_dict()))
    assert all(
        set(fix) == {"object", "node", "change", "counted", "before", "after"} for fix in told["fixed"]
    )
    assert all(set(left) == {"object", "node", "reason"} for left in told["left_alone"])


@pytest.mark.parametrize("data", [b"", b"glTF", b"{}", b'{"asset":{"version":"1.0"}}'])
def test_what_is_no_scene_is_refused(data, tmp_path):
    with pytest.raises(InputError):
        fix_file(write_glb(tmp_path / "bad.gltf", data), QUICK)
