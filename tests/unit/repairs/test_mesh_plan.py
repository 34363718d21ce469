"""`plan_mesh`: fixes of faces, vertices, winding and normals of a single mesh."""

from __future__ import annotations

import numpy as np
import pytest
from repair_scenes import away_from, box, bytes_of, part, soup, torus, volume

from baker.repairs.mesh_plan import plan_mesh
from baker.repairs.primitive_edit import apply_edit
from baker.topology.unique_rows import first_equal, unique_rows

CENTRE = (0.5, 0.5, 0.5)


def fix_one(one):
    plan = plan_mesh([one])
    return plan, apply_edit(plan.edits[0])


def changes(plan):
    return {change.change: (change.before, change.after) for change in plan.changes}


def places(made, position):
    return position[made.row[made.triangle]]


# ---- Rows ----


@pytest.mark.parametrize("seed", range(5))
def test_first_equal_is_the_naive_search(seed):
    rng = np.random.default_rng(seed)
    one, two = rng.integers(0, 3, (40, 3)).astype(np.float32), rng.integers(0, 2, (40, 1)).astype(np.uint8)
    rows = [one[k].tobytes() + two[k].tobytes() for k in range(40)]
    assert first_equal([one, two], 40).tolist() == [rows.index(row) for row in rows]


def test_first_equal_without_columns_or_rows():
    assert first_equal([], 3).tolist() == [0, 0, 0]
    assert first_equal([np.zeros((0, 3), np.float32)], 0).tolist() == []


def test_rows_that_only_share_a_hash_are_told_apart(monkeypatch):
    monkeypatch.setattr("baker.topology.unique_rows.mix", lambda value: np.zeros_like(value))
    data = np.array([[1.0], [2.0], [1.0], [3.0]])
    assert first_equal([data], 4).tolist() == [0, 1, 0, 3]


def test_unique_rows_numbers_the_first_rows():
    kept, place = unique_rows([np.array([[5], [7], [5], [9], [7]])], 5)
    assert kept.tolist() == [0, 1, 3]
    assert place.tolist() == [0, 1, 0, 2, 1]


# ---- Faces and vertices ----


def test_a_clean_mesh_is_not_touched():
    position, triangle = box()
    plan, made = fix_one(part(position, triangle, away_from(position, CENTRE)))
    assert made is None
    assert not plan.changes
    assert not plan.left


def test_flat_faces_and_doubles_go_and_all_else_stays():
    position, triangle = box()
    normal = away_from(position, CENTRE)
    bad = [[0, 0, 1], [3, 3, 3], triangle[5].tolist(), triangle[7][[1, 2, 0]].tolist()]
    plan, made = fix_one(part(position, np.concatenate([triangle, bad]), normal))
    assert changes(plan) == {"zero-area-faces": (16, 14), "duplicate-faces": (14, 12)}
    assert np.array_equal(made.row[made.triangle], triangle)


def test_a_flat_face_between_three_places_goes():
    position = np.float32([[0, 0, 0], [1, 0, 0], [0.5, 0, 0], [0, 1, 0]])
    plan, made = fix_one(
        part(position, np.array([[0, 1, 3], [0, 1, 2]]), np.tile(np.float32([0, 0, 1]), (4, 1)))
    )
    assert changes(plan) == {"zero-area-faces": (2, 1)}
    assert made.row.tolist() == [0, 1, 3]


def test_faces_with_coordinates_that_nothing_draws_go():
    position, triangle = box()
    position = np.concatenate([position, np.float32([[np.nan, 0, 0], [np.inf, 1, 1]])])
    normal = away_from(np.nan_to_num(position, posinf=9.0), CENTRE)
    plan, made = fix_one(part(position, np.concatenate([triangle, [[0, 1, 8], [1, 2, 9]]]), normal))
    assert changes(plan) == {"unusable-faces": (14, 12)}
    assert made.row.max() == 7


@pytest.mark.parametrize("what", ["material blends", "uv differ", "normals differ"])
def test_a_double_that_may_show_stays_and_is_named(what):
    position, triangle = box()
    double = np.concatenate([position, position])
    twice = np.concatenate([triangle, triangle + 8])
    normal = np.tile(away_from(position, CENTRE), (2, 1))
    uv = np.zeros((16, 2), np.float32)
    if what == "uv differ":
        uv[8:] = 0.5
    if what == "normals differ":
        normal[8:] = np.roll(normal[8:], 1, axis=1)
    plan, made = fix_one(part(double, twice, normal, uv=uv, blends=what == "material blends"))
    assert "duplicate-faces" not in changes(plan)
    assert "keeps 12 duplicate faces" in plan.left[0]
    assert made is None or len(made.triangle) == 24


def test_a_double_with_other_lightmap_uv_goes_if_nothing_reads_them():
    position, triangle = box()
    double, twice = np.concatenate([position, position]), np.concatenate([triangle, triangle + 8])
    normal = np.tile(away_from(position, CENTRE), (2, 1))
    own = {"TEXCOORD_1": bytes_of(np.arange(32, dtype=np.float32).reshape(16, 2))}
    plan, made = fix_one(part(double, twice, normal, column=own))
    assert changes(plan) == {"duplicate-faces": (24, 12)}
    assert made.row.max() == 7
    plan, _ = fix_one(part(double, twice, normal, column=own, reads_lightmap_uv=True))
    assert "duplicate-faces" not in changes(plan)


def test_the_back_of_a_double_sided_face_goes_only_if_it_shows_the_same():
    position = np.float32([[0, 0, 0], [1, 0, 0], [0, 1, 0]])
    both = np.concatenate([position, position])
    triangle = np.array([[0, 1, 2], [3, 5, 4]])
    up = np.tile(np.float32([0, 0, 1]), (3, 1))
    opposite, same = np.concatenate([up, -up]), np.concatenate([up, up])
    assert changes(fix_one(part(both, triangle, opposite, double_sided=True))[0]) == {
        "duplicate-faces": (2, 1)
    }
    assert "duplicate-faces" not in changes(fix_one(part(both, triangle, same, double_sided=True))[0])
    # If the material is one-sided, both faces are visible, each from its side. Therefore neither is removed.
    plan, made = fix_one(part(both, triangle, opposite))
    assert made is None
    assert not plan.left


def test_vertices_are_welded_by_all_attributes():
    position, triangle = box()
    normal = away_from(position, CENTRE)
    flat_position, flat_triangle = soup(position, triangle)
    heat = np.zeros((36, 1), np.float32)
    heat[0] = 1.0
    one = part(
        flat_position, flat_triangle, normal[triangle].reshape(-1, 3), column={"_HEAT": bytes_of(heat)}
    )
    plan, made = fix_one(one)
    assert changes(plan) == {"duplicate-vertices": (36, 9)}
    assert np.array_equal(places(made, flat_position), position[triangle])
    assert np.array_equal(heat[made.row[made.triangle]], heat[flat_triangle])


def test_stitches_of_a_strip_are_no_defect():
    position = np.float32([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]])
    normal = np.tile(np.float32([0, 0, 1]), (4, 1))
    strip = np.array([[0, 1, 2], [2, 1, 3], [2, 3, 3]])
    assert fix_one(part(position, strip, normal, stitched=True))[1] is None
    assert fix_one(part(position, strip, normal))[1] is not None


def test_a_primitive_that_would_be_empty_stays_and_is_named():
    position = np.float32([[0, 0, 0], [1, 0, 0], [2, 0, 0]])
    plan, made = fix_one(part(position, np.array([[0, 1, 2]])))
    assert made is None
    assert plan.left == (
        "primitive 0 keeps 1 faces without area: nothing would be left of it; delete it in the scene it comes"
        " from",
    )


def test_a_locked_primitive_stays_and_is_named():
    position, triangle = box()
    flat = soup(position, triangle)
    plan, made = fix_one(part(*flat, locked="it is skinned"))
    assert made is None
    assert not plan.changes
    assert plan.left[0].endswith("36 vertices without normal: it is skinned")


# ---- Winding ----


@pytest.mark.parametrize("shape", [box, torus])
@pytest.mark.parametrize("seed", range(4))
def test_turned_faces_of_closed_meshes_are_turned_back(shape, seed):
    position, triangle = shape()
    rng = np.random.default_rng(seed)
    turned = rng.permutation(len(triangle))[: len(triangle) // 4]
    wrong = triangle.copy()
    wrong[turned] = wrong[turned][:, [0, 2, 1]]
    plan, made = fix_one(part(position, wrong))
    assert changes(plan)["winding"] == (len(turned), 0)
    assert volume(position, made.row[made.triangle]) == pytest.approx(volume(position, triangle))
    # The new flat normals are those of the fixed faces.
    corner = places(made, position).astype(np.float64)
    front = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    front /= np.linalg.norm(front, axis=1, keepdims=True)
    assert np.abs(made.normal[made.triangle] - front[:, None, :]).max() < 1e-6


def test_normals_say_which_side_is_the_front():
    position, triangle = box()
    outward = away_from(position, CENTRE)
    plan, made = fix_one(part(position, triangle[:, ::-1], outward))
    assert changes(plan) == {"winding": (12, 0)}
    assert made.normal is None
    assert not made.turned.any()
    assert volume(position, made.row[made.triangle]) == pytest.approx(1.0)
    # A room: winding and normals agree that its faces point inwards.
    plan, made = fix_one(part(position, triangle[:, ::-1], -outward))
    assert made is None
    assert not plan.left
    # If one wall of the room is flipped, it is flipped back.
    wrong = triangle[:, ::-1].copy()
    wrong[:2] = wrong[:2, ::-1]
    plan, made = fix_one(part(position, wrong, -outward))
    assert changes(plan) == {"winding": (2, 0)}
    assert volume(position, made.row[made.triangle]) == pytest.approx(-1.0)


def test_normals_of_turned_faces_follow_with_their_tangents():
    position, triangle = box()
    flat, own = soup(position, triangle)
    corner = flat.reshape(-1, 3, 3).astype(np.float64)
    wrong = own.copy()
    wrong[:2] = wrong[:2, ::-1]
    front = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    front[:2] *= -1
    normal = np.repeat(front / np.linalg.norm(front, axis=1, keepdims=True), 3, axis=0).astype(np.float32)
    plan, made = fix_one(part(flat, wrong, normal))
    assert changes(plan)["winding"] == (2, 0)
    facing = places(made, flat) - 0.5
    assert (np.einsum("tkx,tkx->tk", facing, made.normal[made.triangle]) > 0).all()
    assert made.turned[made.triangle][:2].all()
    assert not made.turned[made.triangle][2:].any()


def test_open_meshes_and_one_sided_bands_keep_their_winding():
    position, triangle = box()
    normal = away_from(position, CENTRE)
    wrong = triangle[:-2].copy()
    wrong[0] = wrong[0][::-1]
    assert fix_one(part(position, wrong, normal))[1] is None


def test_a_projective_plane_is_named():
    # The hemi-icosahedron has 6 vertices and 10 faces. Each edge is in two faces, but the surface is not
    # orientable, so it has no outside.
    triangle = np.array(
        [
            [0, 1, 2],
            [0, 2, 3],
            [0, 3, 4],
            [0, 4, 5],
            [0, 5, 1],
            [1, 2, 4],
            [2, 3, 5],
            [3, 4, 1],
            [4, 5, 2],
            [5, 1, 3],
        ]
    )
    position = np.random.default_rng(1).random((6, 3), np.float32)
    plan, made = fix_one(part(position, triangle, np.tile(np.float32([0, 0, 1]), (6, 1))))
    assert made is None
    assert "no outside" in plan.left[0]


def test_a_mesh_closed_by_two_primitives_is_one_mesh():
    position, triangle = box()
    wrong = triangle.copy()
    wrong[6:8] = wrong[6:8, ::-1]
    normal = away_from(position, CENTRE)
    plan = plan_mesh([part(position, wrong[:6], normal), part(position, wrong[6:], normal)])
    assert changes(plan) == {"winding": (2, 0)}
    first, second = (apply_edit(p) for p in plan.edits)
    assert first is None
    assert (
        np.array_equal(position[second.row[second.triangle]], position[triangle[6:][:, [0, 1, 2]]])
        or (np.sort(second.row[second.triangle], axis=1) == np.sort(triangle[6:], axis=1)).all()
    )
    plan = plan_mesh(
        [part(position, wrong[:6], normal), part(position, wrong[6:], normal, locked="it is skinned")]
    )
    assert not plan.changes
    assert plan.left[0] == "2 faces look the wrong way, but it is skinned"


# ---- Normals ----


def test_normals_of_wrong_length_become_unit_and_keep_their_direction():
    position, triangle = box()
    normal = away_from(position, CENTRE)
    plan, made = fix_one(part(position, triangle, normal * np.float32(3)))
    assert changes(plan) == {"bad-normals": (8, 0)}
    assert np.abs(made.normal - normal[made.row]).max() < 1e-6


def test_empty_normals_become_the_mean_of_their_faces():
    position, triangle = box()
    normal = away_from(position, CENTRE)
    bad = normal.copy()
    bad[0], bad[3] = 0, np.nan
    plan, made = fix_one(part(position, triangle, bad))
    assert changes(plan) == {"bad-normals": (2, 0)}
    assert np.isfinite(made.normal).all()
    for row in (0, 3):
        face = [t for t in triangle if row in t]
        mean = sum(np.cross(position[t[1]] - position[t[0]], position[t[2]] - position[t[0]]) for t in face)
        assert np.abs(made.normal[made.row == row] - mean / np.linalg.norm(mean)).max() < 1e-6
    rest = ~np.isin(made.row, (0, 3))
    assert np.array_equal(made.normal[rest], normal[made.row[rest]])


def test_short_numbers_are_not_tested_for_unit_length():
    position, triangle = box()
    rough = np.rint(away_from(position, CENTRE) * 100).astype(np.int8)
    one = part(position, triangle, rough.astype(np.float32) / 127, column={"NORMAL": bytes_of(rough)})
    assert fix_one(one)[1] is None
