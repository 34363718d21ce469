"""`fix_file` repairs shapes and reports remaining defects and the distance between old and new surface."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
from glb_reader import Glb
from gltf_builder import GltfBuilder, write
from repair_scenes import PICTURE, away_from, box, drawn, torus, volume

from baker.checks.run import check_scene
from baker.checks.settings import CheckSettings
from baker.core.errors import ResourceError
from baker.core.settings import BakeSettings
from baker.repairs import meshlab
from baker.repairs.fix_file import fix_file
from baker.repairs.settings import RepairSettings
from baker.repairs.welded_mesh import WeldedMesh, distance
from baker.repairs.winding import count_edges

REPAIR = RepairSettings(resolution=128, repair=True)


def builder(position, triangle, **members) -> GltfBuilder:
    b = GltfBuilder()
    position = position.astype(np.float32)
    b.node(name="thing", mesh=b.mesh(b.primitive(position, triangle.astype(np.uint32), **members)))
    return b


def repaired(b, folder, settings=REPAIR):
    path = write(folder / "scene.glb", b)
    fixed = fix_file(path, settings)
    glb = Glb(fixed.data)
    return fixed, glb, glb.json["meshes"][0]["primitives"][0]


def told(fixed):
    return {fix.change.change: (fix.change.before, fix.change.after) for fix in fixed.fixed}


def places(glb, primitive):
    """Return the distinct positions (V, 3) of a primitive and its faces (T, 3) as indices of positions."""
    corner = glb.corners(primitive, "POSITION")
    place, number = np.unique(corner.reshape(-1, 3), axis=0, return_inverse=True)
    return place, number.reshape(-1, 3)


def test_small_holes_are_closed_with_the_vertices_of_their_rims(tmp_path):
    position, triangle = torus(60, 40)
    normal = away_from(position, (0, 0, 0.01))
    hole = np.ones(len(triangle), bool)
    hole[[5, 6, 1000]] = False
    uv = position[:, :2].copy()
    b = builder(position, triangle[hole], NORMAL=normal, TEXCOORD_0=uv)
    fixed, glb, primitive = repaired(b, tmp_path)
    assert told(fixed) == {"holes": (9, 0), "patches": (4797, 4800)}
    place, face = places(glb, primitive)
    assert (count_edges(face) == 2).all()
    # The patch of a quad may have the other diagonal, which changes the volume slightly.
    assert volume(place, face) == pytest.approx(volume(position, triangle), rel=1e-3)
    # The old faces do not change, and the vertices of patches have the uv of the rim.
    before = Glb(write(tmp_path / "before.glb", b))
    old = drawn(before, before.json["meshes"][0]["primitives"][0])
    new = drawn(glb, primitive)
    assert old < new
    assert len(new - old) == 3
    known = {position[k].tobytes(): uv[k].tobytes() for k in range(len(position))}
    for p, t in zip(
        glb.accessor(primitive["attributes"]["POSITION"]),
        glb.accessor(primitive["attributes"]["TEXCOORD_0"]),
        strict=True,
    ):
        assert known[p.tobytes()] == t.tobytes()
    # The reported distance is the largest distance of the new surface from the old one. It is found in the
    # patch of two faces.
    moved = {fix.change.distance for fix in fixed.fixed}
    assert len(moved) == 1
    assert 0.01 < moved.pop() < 0.1


def test_large_openings_stay_open(tmp_path):
    position, triangle = box()
    fixed, _, _ = repaired(builder(position, triangle[:-2], NORMAL=away_from(position, (0.5,) * 3)), tmp_path)
    assert told(fixed) == {}
    assert fixed.left_alone == ()


def test_a_flat_shaded_rim_gets_a_flat_patch(tmp_path):
    position, triangle = torus(60, 40)
    keep = np.arange(len(triangle)) != 7
    corner = position[triangle[keep]]
    front = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    normal = np.repeat(front / np.linalg.norm(front, axis=1, keepdims=True), 3, axis=0).astype(np.float32)
    flat = np.arange(3 * len(corner)).reshape(-1, 3)
    fixed, glb, primitive = repaired(builder(corner.reshape(-1, 3), flat, NORMAL=normal), tmp_path)
    assert told(fixed)["holes"] == (3, 0)
    made = glb.corners(primitive, "NORMAL").astype(np.float64)
    place = glb.corners(primitive, "POSITION").astype(np.float64)
    front = np.cross(place[:, 1] - place[:, 0], place[:, 2] - place[:, 0])
    front /= np.linalg.norm(front, axis=1, keepdims=True)
    assert (np.einsum("tkx,tx->tk", made, front) > 0.69).all()


def test_a_splinter_goes_and_a_wall_stays(tmp_path):
    position, triangle = torus(60, 40)
    normal = away_from(position, (0, 0, 0.01))
    splinter = np.concatenate([position, position[:1] + np.float32(0.004)])
    more = np.concatenate([triangle, [[0, 1, len(position)]]])
    b = builder(splinter, more, NORMAL=np.concatenate([normal, normal[:1]]))
    fixed, glb, primitive = repaired(b, tmp_path)
    assert told(fixed) == {"non-manifold-edges": (1, 0), "non-manifold-faces": (4801, 4800)}
    assert len(places(glb, primitive)[1]) == 4800
    # Only the splinter is removed. Its tip is 7 mm from a vertex of the torus, and less than that from the
    # torus's surface.
    assert 0.001 < fixed.fixed[0].change.distance < 0.007

    position, triangle = box()
    wall = np.concatenate([position, np.float32([[0.5, -3, 0.5]])])
    more = np.concatenate([triangle, [[0, 1, 8]]])
    fixed, _, _ = repaired(builder(wall, more, NORMAL=away_from(wall, (0.5,) * 3)), tmp_path)
    assert told(fixed) == {}
    assert "1 edges belong to more than two faces" in fixed.left_alone[0].reason


@pytest.mark.parametrize("with_normals", [True, False])
def test_a_soup_is_turned_outwards(with_normals, tmp_path):
    position, triangle = torus(20, 12)
    corner = position[triangle]
    middle = corner.mean(axis=1, keepdims=True)
    shrunk = ((corner - middle) * 0.95 + middle).reshape(-1, 3)
    flat = np.arange(len(shrunk)).reshape(-1, 3)
    flat[::3] = flat[::3, ::-1]
    ring = middle[:, 0] * [1, 0, 1]
    outward = middle[:, 0] - 2 * ring / np.linalg.norm(ring, axis=1, keepdims=True)
    members = {}
    if with_normals:
        members["NORMAL"] = np.repeat(
            outward / np.linalg.norm(outward, axis=1, keepdims=True), 3, axis=0
        ).astype(np.float32)
    fixed, glb, primitive = repaired(builder(shrunk, flat, **members), tmp_path)
    assert told(fixed)["orientation"] == (160, 0)
    place = glb.corners(primitive, "POSITION").astype(np.float64)
    front = np.cross(place[:, 1] - place[:, 0], place[:, 2] - place[:, 0])
    centre = place.mean(axis=1)
    ring = centre * [1, 0, 1]
    outward = centre - 2 * ring / np.linalg.norm(ring, axis=1, keepdims=True)
    assert (np.einsum("tx,tx->t", front, outward) > 0).all()
    assert (np.einsum("tkx,tx->tk", glb.corners(primitive, "NORMAL"), front) > 0).all()
    assert fixed.fixed[0].change.distance < 1e-6


def test_open_surfaces_are_wound_alike(tmp_path):
    position, triangle = box()
    triangle = triangle[:-2].copy()
    triangle[[0, 5]] = triangle[[0, 5]][:, ::-1]
    fixed, glb, primitive = repaired(builder(position, triangle), tmp_path)
    assert told(fixed)["orientation"] == (2, 0)
    place, face = places(glb, primitive)
    a, b = face.ravel(), np.roll(face, -1, axis=1).ravel()
    # No two faces have the same edge in the same direction.
    assert len(np.unique(a * len(place) + b)) == len(a)


def vault(n: int = 300):
    """Return an outward-facing half cylinder of radius 1 and length 1. Its 2 n triangles are slivers."""
    angle = np.arange(n + 1) * np.pi / n
    arc = np.stack([np.cos(angle), np.sin(angle), np.zeros(n + 1)], axis=1)
    position = np.concatenate([arc, arc + np.array([0, 0, 1])]).astype(np.float32)
    k = np.arange(n)
    one = np.stack([k, k + 1, k + n + 2], axis=1)
    return position, np.concatenate([one, np.stack([k, k + n + 2, k + n + 1], axis=1)])


def test_slivers_are_remeshed_with_their_colours_and_normals(tmp_path):
    position, triangle = vault()
    colour = np.concatenate([position / 2 + 0.5, np.ones((len(position), 1))], axis=1).astype(np.float32)
    normal = (position * [1, 1, 0]).astype(np.float32)
    b = builder(position, triangle, NORMAL=normal, COLOR_0=colour, TEXCOORD_0=position[:, :2].copy())
    fixed, glb, primitive = repaired(b, tmp_path)
    changes = {fix.change.change: fix.change for fix in fixed.fixed}
    assert (changes["slivers"].before, changes["slivers"].after) == (600, 0)
    # `check` reports the slivers that the repair remeshes.
    report = check_scene(tmp_path / "scene.glb", CheckSettings(), BakeSettings())
    reported = [f.found.count for f in report.findings if f.code == "sliver-faces"]
    assert reported == [600]
    assert changes["remeshed"].lost == ("TEXCOORD_0",)
    assert 300 < changes["remeshed"].after < 1200
    assert set(primitive["attributes"]) == {"POSITION", "NORMAL", "COLOR_0"}
    place, made, paint = (
        glb.accessor(primitive["attributes"][name]) for name in ("POSITION", "NORMAL", "COLOR_0")
    )
    assert np.abs(paint[:, :3] - (place / 2 + 0.5)).max() < 5e-3
    assert np.abs(made - place * [1, 1, 0]).max() < 0.02
    # Vertices lie near the circle. A chord is at most (edge length)^2 / 8 from it.
    assert np.abs(np.hypot(place[:, 0], place[:, 1]) - 1).max() < 0.005
    assert 0 < changes["slivers"].distance < 0.01
    corner = glb.corners(primitive, "POSITION").astype(np.float64)
    area = (
        np.linalg.norm(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1).sum() / 2
    )
    assert area == pytest.approx(np.pi, rel=0.01)
    # The repair is deterministic, and a second repair changes nothing.
    assert fix_file(tmp_path / "scene.glb", REPAIR).data == fixed.data
    (tmp_path / "again.glb").write_bytes(fixed.data)
    assert fix_file(tmp_path / "again.glb", REPAIR).fixed == ()


def test_textured_and_locked_meshes_are_left_and_named(tmp_path):
    position, triangle = vault()
    members = {"NORMAL": (position * [1, 1, 0]).astype(np.float32), "TEXCOORD_0": position[:, :2].copy()}
    b = builder(position, triangle, material=0, **members)
    b.add("materials", {"pbrMetallicRoughness": {"baseColorTexture": {"index": b.image(PICTURE)}}})
    fixed = fix_file(write(tmp_path / "textured.glb", b), REPAIR)
    assert fixed.fixed == ()
    assert fixed.left_alone[0].reason == "its slivers stay: its textures would lose their uv"
    skin = {
        "JOINTS_0": np.zeros((len(position), 4), np.uint8),
        "WEIGHTS_0": np.tile(np.float32([1, 0, 0, 0]), (len(position), 1)),
    }
    fixed, _, _ = repaired(builder(position, triangle, **members, **skin), tmp_path)
    assert fixed.fixed == ()
    assert fixed.left_alone[0].reason == "its shape is not repaired: it is skinned"


def test_the_distance_of_two_boxes_is_their_shift():
    position, triangle = box()
    none = np.zeros(len(triangle), np.int64)
    one = WeldedMesh(position, triangle, none, triangle)
    shifted = WeldedMesh(position + np.float32([0.25, 0, 0]), triangle, none, triangle)
    assert distance(one, shifted) == pytest.approx(0.25, abs=1e-6)
    # A small box in the corner of a large one: the small box is near the large one everywhere, but parts of
    # the large box are far from the small one.
    near = WeldedMesh(position * np.float32(0.1), triangle, none, triangle)
    one_sided = meshlab.largest_distance((near.position, triangle), (position, triangle))
    assert one_sided == pytest.approx(0.1, abs=1e-6)
    assert distance(one, near) == distance(near, one) == pytest.approx(np.sqrt(3 * 0.9**2), abs=1e-6)
    # With one face missing, the distance is that of a point of this face to the nearest other face.
    less = WeldedMesh(position, triangle[:-1], none[:-1], triangle[:-1])
    assert 0.2 < distance(one, less) < 0.5


def test_the_distance_is_told_in_metres(tmp_path):
    position, triangle = torus(60, 40)
    keep = np.arange(len(triangle)) != 7
    b = builder(position, triangle[keep], NORMAL=away_from(position, (0, 0, 0.01)))
    one, _, _ = repaired(b, tmp_path)
    b.json["nodes"][0]["scale"] = [10, 10, 10]
    ten, _, _ = repaired(b, tmp_path)
    assert ten.fixed[0].change.distance == pytest.approx(10 * one.fixed[0].change.distance)
    # The patch is the missing face. Its point that is furthest from the other faces is its incentre.
    a, b, c = position[triangle[7]].astype(np.float64)
    sides = [np.linalg.norm(p - q) for p, q in ((a, b), (b, c), (c, a))]
    radius = np.linalg.norm(np.cross(b - a, c - a)) / sum(sides)
    assert one.fixed[0].change.distance == pytest.approx(radius, rel=0.05)


def test_without_pymeshlab_there_is_one_sentence(monkeypatch, tmp_path):
    path = write(tmp_path / "scene.glb", builder(*box()))
    monkeypatch.setitem(sys.modules, "pymeshlab", None)
    with pytest.raises(ResourceError, match="pip install pymeshlab"):
        fix_file(path, REPAIR)
    assert fix_file(path, RepairSettings()).fixed


def test_pymeshlab_is_never_loaded_unasked(tmp_path):
    path = write(tmp_path / "scene.glb", builder(*box()))
    code = (
        "import sys, pathlib, baker.repairs.fix_file as m;"
        f"m.fix_file(pathlib.Path({str(path)!r}));"
        "sys.exit('pymeshlab' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
