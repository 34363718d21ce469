"""Mends one mesh: first decides what stays, then makes the new vertices and triangles of each primitive.

Between the two the caller may judge the lightmap uv of what stays, and give new ones.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from baker.io.gltf.edited_primitive import EditedPrimitive
from baker.repairs.faces import FaceChoice, choose_faces
from baker.repairs.normals import NormalChoice, choose_normals
from baker.repairs.part import Part
from baker.repairs.winding import judge_winding
from baker.topology.triangle_check import face_normal, usable_vertices, zero_area
from baker.topology.unique_rows import compact, first_equal


@dataclass(frozen=True)
class Change:
    """One kind of defect that was mended in an object.

    Attributes
    ----------
    change : str
        Stable name.
    counted : str
        What the numbers count.
    before, after : int
    distance : float or None
        Of a repair: the furthest that the surface moved, metres by the first node's scale (Hausdorff).
    lost : tuple of str
        Vertex attributes that could not be kept.
    """

    change: str
    counted: str
    before: int
    after: int
    distance: float | None = None
    lost: tuple[str, ...] = ()


@dataclass(frozen=True)
class PartPlan:
    """What stays of a primitive.

    Attributes
    ----------
    part : Part
    touched : bool
        Something was mended; otherwise the primitive stays as it is in the file.
    triangle : (T, 3) int64, old vertices; faces to be turned are turned already
    normal : (T, 3, 3) float32 or None
        New normals of the corners.
    turned : (T, 3) bool
        Corners whose normal points the other way now.
    """

    part: Part
    touched: bool
    triangle: NDArray[np.int64]
    normal: NDArray[np.float32] | None
    turned: NDArray[np.bool_]


@dataclass(frozen=True)
class MeshPlan:
    """What stays of a mesh, what was mended, and what was left and why (sentences)."""

    parts: tuple[PartPlan, ...]
    changes: tuple[Change, ...]
    left: tuple[str, ...]


def plan_mesh(
    parts: Sequence[Part],
    *,
    make_normals: bool = True,
    inside_out: Sequence[NDArray[np.bool_]] | None = None,
) -> MeshPlan:
    """Decide what stays of a mesh.

    Parameters
    ----------
    parts : sequence of Part
        All its primitives of triangles.
    make_normals : bool
        Make normals where there are none. Not before a repair, which would take them for the file's own.
    inside_out : sequence of (T,) bool, one for each primitive, or None
        Faces of closed parts that are to be turned as a whole.
    """
    left: list[str] = []
    choices = [choose_faces(part) for part in parts]
    parts = [_lock_empty(part, choice) for part, choice in zip(parts, choices, strict=True)]
    free = [not part.locked for part in parts]
    triangles = [
        part.arrays.triangle[choice.keep] if is_free else part.arrays.triangle
        for part, choice, is_free in zip(parts, choices, free, strict=True)
    ]
    flips = _choose_flips(parts, triangles, left)
    turns = [np.zeros(len(triangle), bool) for triangle in triangles]
    if inside_out is not None:
        turns = [
            mask[choice.keep] if is_free else mask
            for mask, choice, is_free in zip(inside_out, choices, free, strict=True)
        ]
        turns = _unless_locked(parts, turns, "are inside out", left)
    plans: list[PartPlan] = []
    totals = _Totals()
    for part, choice, kept, wrong, inward in zip(parts, choices, triangles, flips, turns, strict=True):
        flip = wrong ^ inward
        turned_faces = np.where(flip[:, None], kept[:, [0, 2, 1]], kept)
        good = part.arrays.triangle[choice.keep] if part.locked else turned_faces
        normals = _normals(part, good, make=make_normals)
        n_doubles = _count_doubles(part, good, normals)
        wanted = bool(choice.n_dropped or flip.any() or normals.n_made or n_doubles)
        if part.locked:
            if wanted or choice.n_unlike:
                left.append(_locked_sentence(part, choice, normals, n_doubles))
            none = np.zeros(kept.shape, bool)
            plans.append(PartPlan(part, False, kept, None, none))
            continue
        if choice.n_unlike:
            left.append(_unlike_sentence(part, choice.n_unlike))
        plans.append(turn_faces(part, turned_faces, flip, touched=wanted, normals=normals))
        totals.add(choice, len(np.unique(kept)), n_doubles, normals)
        totals.add_turned(int(wrong.sum()), int(inward.sum()))
    return MeshPlan(tuple(plans), totals.changes(), tuple(left))


def finish_part(plan: PartPlan, uv: NDArray[np.float32] | None = None) -> EditedPrimitive | None:
    """Make the new vertices of a primitive: equal ones become one, unused ones go.

    Parameters
    ----------
    plan : PartPlan
    uv : (T, 3, 2) float32 or None
        New TEXCOORD_1 of each corner.

    Returns
    -------
    EditedPrimitive or None
        None if the primitive stays as it is in the file.
    """
    if not plan.touched and uv is None:
        return None
    part = plan.part
    replaced = set() if plan.normal is None else {"NORMAL"}
    replaced |= set() if uv is None else {"TEXCOORD_1"}
    column = [data for name, data in part.column.items() if name not in replaced]
    row = first_equal(column, len(part.arrays.position))[plan.triangle].reshape(-1)
    own: list[NDArray[np.generic]] = [row.reshape(-1, 1), plan.turned.reshape(-1, 1)]
    # + 0 makes -0 equal to 0, as it is to every reader.
    normal = None if plan.normal is None else plan.normal.reshape(-1, 3) + np.float32(0.0)
    own += [] if normal is None else [normal]
    own += [] if uv is None else [uv.reshape(-1, 2)]
    corner, place = compact(first_equal(own, len(row)))
    # Vertices stay in the file's order.
    order = np.argsort(row[corner], kind="stable")
    rank = np.zeros(len(order), np.int64)
    rank[order] = np.arange(len(order))
    corner = corner[order]
    return EditedPrimitive(
        row=row[corner],
        triangle=rank[place].reshape(-1, 3),
        normal=None if normal is None else normal[corner],
        turned=plan.turned.reshape(-1)[corner],
        uv=None if uv is None else uv.reshape(-1, 2)[corner],
    )


def turn_faces(
    part: Part,
    triangle: NDArray[np.int64],
    flip: NDArray[np.bool_],
    *,
    touched: bool,
    normals: NormalChoice | None = None,
) -> PartPlan:
    """Put together what a primitive becomes: the normals of turned faces follow them.

    Parameters
    ----------
    part : Part
    triangle : (T, 3) int64
        The faces that stay, turned where `flip` says so.
    flip : (T,) bool
    touched : bool
        Something about the primitive is mended.
    normals : NormalChoice or None
        New normals of the corners before that.
    """
    normals = normals or NormalChoice(None)
    turned = np.zeros(triangle.shape, bool)
    corner = normals.corner
    given = part.arrays.normal
    if flip.any() and given is not None:
        corner = given[triangle] if corner is None else corner
        front = face_normal(part.arrays.position, triangle)
        against = np.einsum("tkx,tx->t", np.nan_to_num(corner).astype(np.float64), front) < 0
        turned[flip & against] = True
        if turned.any():
            corner = np.where(turned[..., None], -corner, corner)
        else:
            corner = normals.corner
    return PartPlan(part, touched, triangle, corner, turned)


def _lock_empty(part: Part, choice: FaceChoice) -> Part:
    if part.locked or choice.keep.any():
        return part
    # A primitive cannot be empty in glTF, and to take it away would renumber the others.
    return replace(part, locked="nothing would be left of it; delete it in the scene it comes from")


def _choose_flips(
    parts: Sequence[Part], triangles: Sequence[NDArray[np.int64]], left: list[str]
) -> list[NDArray[np.bool_]]:
    """Return for each primitive which of its faces are to be turned."""
    nothing = [np.zeros(len(triangle), bool) for triangle in triangles]
    position = np.concatenate([part.arrays.position for part in parts])
    start = np.cumsum([0] + [len(part.arrays.position) for part in parts])
    joined = np.concatenate([t + s for t, s in zip(triangles, start, strict=False)])
    owner = np.repeat(np.arange(len(parts)), [len(t) for t in triangles])
    # What is not drawn takes no part: in locked primitives it is still there.
    drawn = usable_vertices(position)[joined].all(axis=1)
    drawn[drawn] = ~zero_area(position, joined[drawn])
    if not drawn.any():
        return nothing
    normal = np.concatenate([_face_mean(p, t) for p, t in zip(parts, triangles, strict=True)])[drawn]
    place = first_equal([position + np.float32(0.0)], len(position))
    winding = judge_winding(position, place[joined[drawn]], normal)
    if winding.n_one_sided:
        left.append(f"{winding.n_one_sided} closed pieces have no outside (like a Klein bottle)")
    flip = np.zeros(len(joined), bool)
    flip[np.flatnonzero(drawn)[winding.flip]] = True
    flips = [flip[owner == k] for k in range(len(parts))]
    return _unless_locked(parts, flips, "look the wrong way", left)


def _unless_locked(
    parts: Sequence[Part], flips: list[NDArray[np.bool_]], what: str, left: list[str]
) -> list[NDArray[np.bool_]]:
    """Return the faces to turn, none of the mesh if some of them must stay as they are."""
    locked = [part.locked for part, flip in zip(parts, flips, strict=True) if part.locked and flip.any()]
    if not locked:
        return flips
    left.append(f"{sum(int(flip.sum()) for flip in flips)} faces {what}, but {locked[0]}")
    return [np.zeros(len(flip), bool) for flip in flips]


def _face_mean(part: Part, triangle: NDArray[np.int64]) -> NDArray[np.float32]:
    """Return the (T, 3) mean of each face's vertex normals, zero without normals."""
    if part.arrays.normal is None:
        return np.zeros((len(triangle), 3), np.float32)
    with np.errstate(over="ignore", invalid="ignore"):
        mean = part.arrays.normal[triangle].mean(axis=1)
    return np.asarray(np.nan_to_num(mean, nan=0.0, posinf=0.0, neginf=0.0), np.float32)


def _normals(part: Part, triangle: NDArray[np.int64], *, make: bool) -> NormalChoice:
    if not len(triangle) or (part.arrays.normal is None and not make):
        return NormalChoice(None)
    exact = part.arrays.normal is not None and part.column["NORMAL"].shape[1] == 12
    return choose_normals(part.arrays.position, triangle, part.arrays.normal, exact=exact)


def _count_doubles(part: Part, triangle: NDArray[np.int64], normals: NormalChoice) -> int:
    """Count the used vertices that equal another used one in everything."""
    used = np.unique(triangle)
    if normals.n_missing:
        # Flat normals part what the file shares: only what is fewer in the end was double.
        plan = PartPlan(part, True, triangle, normals.corner, np.zeros(triangle.shape, bool))
        made = finish_part(plan)
        return max(0, len(used) - len(made.row)) if made is not None else 0
    first = first_equal([data[used] for data in part.column.values()], len(used))
    return int((first != np.arange(len(used))).sum())


class _Totals:
    """Adds up the changes of a mesh's primitives."""

    def __init__(self) -> None:
        self._faces = 0
        self._vertices = 0
        self._n: dict[str, int] = {}

    def add(self, choice: FaceChoice, n_vertices: int, n_doubles: int, normals: NormalChoice) -> None:
        self._faces += len(choice.keep) - choice.n_stitches
        self._vertices += n_vertices
        for name, count in (
            ("unusable-faces", choice.n_unusable),
            ("zero-area-faces", choice.n_zero_area),
            ("duplicate-faces", choice.n_duplicate),
            ("duplicate-vertices", n_doubles),
            ("winding", 0),
            ("inside-out", 0),
            ("missing-normals", normals.n_missing),
            ("bad-normals", normals.n_empty + normals.n_long),
        ):
            self._n[name] = self._n.get(name, 0) + count

    def add_turned(self, n_wrong: int, n_inward: int) -> None:
        self._n["winding"] += n_wrong
        self._n["inside-out"] += n_inward

    def changes(self) -> tuple[Change, ...]:
        found = []
        faces = self._faces
        for name, count in self._n.items():
            if not count:
                continue
            if name.endswith("-faces"):
                found.append(Change(name, "faces", faces, faces - count))
                faces -= count
            elif name == "duplicate-vertices":
                found.append(Change(name, "vertices", self._vertices, self._vertices - count))
            else:
                found.append(Change(name, _COUNTED[name], count, 0))
        return tuple(found)


_COUNTED = {
    "winding": "faces that look the wrong way",
    "inside-out": "faces of closed parts that look inwards, with nothing in them",
    "missing-normals": "vertices without normal",
    "bad-normals": "vertices with a normal not of unit length",
}


def _locked_sentence(part: Part, choice: FaceChoice, normals: NormalChoice, n_doubles: int) -> str:
    counts = (
        (choice.n_unusable, "faces with unusable coordinates"),
        (choice.n_zero_area, "faces without area"),
        (choice.n_duplicate + choice.n_unlike, "duplicate faces"),
        (n_doubles, "duplicate vertices"),
        (normals.n_missing, "vertices without normal"),
        (normals.n_empty + normals.n_long, "vertices with a normal not of unit length"),
    )
    what = ", ".join(f"{count} {words}" for count, words in counts if count)
    return f"primitive {part.arrays.index} keeps {what}: {part.locked}"


def _unlike_sentence(part: Part, count: int) -> str:
    why = (
        "its material blends, so a face drawn twice covers more"
        if part.blends
        else "they differ in normals, uv or other attributes, and which one is seen depends on the renderer"
    )
    return f"primitive {part.arrays.index} keeps {count} duplicate faces: {why}"
