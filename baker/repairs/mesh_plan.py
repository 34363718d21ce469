"""Plans the fixes of one mesh: faces to keep, faces to flip, and new normals.

Making a plan changes nothing. The caller may then test and replace the lightmap uv of the remaining faces.
Finally `apply_edit` makes the new vertices.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from baker.repairs.faces import FaceChoice, choose_faces
from baker.repairs.normals import NormalChoice, choose_normals
from baker.repairs.primitive_edit import EditablePrimitive, PrimitiveEdit, apply_edit, edit_with_flips
from baker.repairs.winding import find_wrong_winding
from baker.topology.triangle_check import usable_vertices, zero_area
from baker.topology.unique_rows import first_equal

# Size of a vertex normal that is stored as three float32, bytes. Smaller normals are normalized integers.
_FLOAT_NORMAL = 12


@dataclass(frozen=True)
class Change:
    """A change that was made to a mesh, such as the removal of duplicate faces.

    Attributes
    ----------
    change : str
        Name of the kind of change, the same in all versions.
    counted : str
        What `before` and `after` count, such as "faces".
    before, after : int
        Numbers before and after the change.
    distance : float or None
        For a repair, the Hausdorff distance between the old and the new surface, metres, at the scale of the
        first node that has the mesh.
    lost : tuple of str
        Names of vertex attributes that could not be kept.
    """

    change: str
    counted: str
    before: int
    after: int
    distance: float | None = None
    lost: tuple[str, ...] = ()


@dataclass(frozen=True)
class MeshPlan:
    """The planned edits of a mesh.

    Attributes
    ----------
    edits : tuple of PrimitiveEdit
        One for each primitive.
    changes : tuple of Change
        The changes that the edits make.
    left : tuple of str
        One sentence for each defect that is not fixed, with the reason.
    """

    edits: tuple[PrimitiveEdit, ...]
    changes: tuple[Change, ...]
    left: tuple[str, ...]


def plan_mesh(
    primitives: Sequence[EditablePrimitive],
    *,
    make_normals: bool = True,
    inside_out: Sequence[NDArray[np.bool_]] | None = None,
) -> MeshPlan:
    """Plan the fixes of a mesh.

    Parameters
    ----------
    primitives : sequence of EditablePrimitive
        All primitives of the mesh that consist of triangles.
    make_normals : bool
        Whether normals are made for primitives without normals. It is False before a repair, because a repair
        uses normals as evidence of the intended front.
    inside_out : sequence of (T,) bool, or None
        For each primitive, the faces of closed parts that are inside out. They are flipped.

    Returns
    -------
    MeshPlan
        The edits, and the defects that are not fixed.
    """
    left: list[str] = []
    choices = [choose_faces(primitive) for primitive in primitives]
    primitives = [_lock_empty(p, choice) for p, choice in zip(primitives, choices, strict=True)]
    triangles = [
        p.arrays.triangle if p.locked else p.arrays.triangle[choice.keep]
        for p, choice in zip(primitives, choices, strict=True)
    ]
    flips = _choose_flips(primitives, triangles, left)
    turns = [np.zeros(len(triangle), bool) for triangle in triangles]
    if inside_out is not None:
        turns = [
            mask if p.locked else mask[choice.keep]
            for mask, choice, p in zip(inside_out, choices, primitives, strict=True)
        ]
        turns = _unless_locked(primitives, turns, "are inside out", left)
    edits: list[PrimitiveEdit] = []
    totals = _Totals()
    for primitive, choice, kept, wrong, inward in zip(
        primitives, choices, triangles, flips, turns, strict=True
    ):
        flip = wrong ^ inward
        flipped = np.where(flip[:, None], kept[:, [0, 2, 1]], kept)
        good = primitive.arrays.triangle[choice.keep] if primitive.locked else flipped
        normals = _normals(primitive, good, make=make_normals)
        n_doubles = _count_doubles(primitive, good, normals)
        wanted = bool(choice.n_dropped or flip.any() or normals.n_made or n_doubles)
        if primitive.locked:
            if wanted or choice.n_unlike:
                left.append(_locked_sentence(primitive, choice, normals, n_doubles))
            edits.append(PrimitiveEdit(primitive, False, kept, None, np.zeros(kept.shape, bool)))
            continue
        if choice.n_unlike:
            left.append(_unlike_sentence(primitive, choice.n_unlike))
        edits.append(edit_with_flips(primitive, flipped, flip, touched=wanted, normals=normals))
        totals.add(choice, len(np.unique(kept)), n_doubles, normals)
        totals.add_flips(int(wrong.sum()), int(inward.sum()))
    return MeshPlan(tuple(edits), totals.changes(), tuple(left))


def _lock_empty(primitive: EditablePrimitive, choice: FaceChoice) -> EditablePrimitive:
    if primitive.locked or choice.keep.any():
        return primitive
    # In glTF, a primitive cannot be empty, and removing it would change the numbers of other primitives.
    return replace(primitive, locked="nothing would be left of it; delete it in the scene it comes from")


def _choose_flips(
    primitives: Sequence[EditablePrimitive], triangles: Sequence[NDArray[np.int64]], left: list[str]
) -> list[NDArray[np.bool_]]:
    """Return, for each primitive, the mask (T,) of faces whose winding disagrees with their closed piece.

    `triangles` are the faces (T, 3) of each primitive. Sentences about defects that remain are added to
    `left`.
    """
    nothing = [np.zeros(len(triangle), bool) for triangle in triangles]
    position = np.concatenate([p.arrays.position for p in primitives])
    start = np.cumsum([0] + [len(p.arrays.position) for p in primitives])
    joined = np.concatenate([t + s for t, s in zip(triangles, start, strict=False)])
    owner = np.repeat(np.arange(len(primitives)), [len(t) for t in triangles])
    # Ignore faces that no renderer draws, which locked primitives may still have.
    drawn = usable_vertices(position)[joined].all(axis=1)
    drawn[drawn] = ~zero_area(position, joined[drawn])
    if not drawn.any():
        return nothing
    normal = np.concatenate([_mean_normal(p, t) for p, t in zip(primitives, triangles, strict=True)])[drawn]
    vertex = first_equal([position + np.float32(0.0)], len(position))
    winding = find_wrong_winding(position, vertex[joined[drawn]], normal)
    if winding.n_one_sided:
        left.append(f"{winding.n_one_sided} closed pieces have no outside (like a Klein bottle)")
    flip = np.zeros(len(joined), bool)
    flip[np.flatnonzero(drawn)[winding.flip]] = True
    flips = [flip[owner == k] for k in range(len(primitives))]
    return _unless_locked(primitives, flips, "look the wrong way", left)


def _unless_locked(
    primitives: Sequence[EditablePrimitive], flips: list[NDArray[np.bool_]], what: str, left: list[str]
) -> list[NDArray[np.bool_]]:
    """Return the masks `flips`, or masks of False if a locked primitive has a face to flip.

    `flips` has one mask (T,) of faces to flip for each primitive. If a locked primitive has a face to flip, a
    sentence with the defect `what` is added to `left`.
    """
    locked = [p.locked for p, flip in zip(primitives, flips, strict=True) if p.locked and flip.any()]
    if not locked:
        return flips
    left.append(f"{sum(int(flip.sum()) for flip in flips)} faces {what}, but {locked[0]}")
    return [np.zeros(len(flip), bool) for flip in flips]


def _mean_normal(primitive: EditablePrimitive, triangle: NDArray[np.int64]) -> NDArray[np.float32]:
    """Return the mean vertex normal of each face, (T, 3) float32; zero if the primitive has no normals."""
    if primitive.arrays.normal is None:
        return np.zeros((len(triangle), 3), np.float32)
    with np.errstate(over="ignore", invalid="ignore"):
        mean = primitive.arrays.normal[triangle].mean(axis=1)
    return np.asarray(np.nan_to_num(mean, nan=0.0, posinf=0.0, neginf=0.0), np.float32)


def _normals(primitive: EditablePrimitive, triangle: NDArray[np.int64], *, make: bool) -> NormalChoice:
    normal = primitive.arrays.normal
    if not len(triangle) or (normal is None and not make):
        return NormalChoice(None)
    is_float = normal is not None and primitive.column["NORMAL"].shape[1] == _FLOAT_NORMAL
    return choose_normals(primitive.arrays.position, triangle, normal, is_float=is_float)


def _count_doubles(primitive: EditablePrimitive, triangle: NDArray[np.int64], normals: NormalChoice) -> int:
    """Return how many vertices of the faces (T, 3) equal another vertex in every attribute."""
    used = np.unique(triangle)
    if normals.n_missing:
        # Flat normals split shared vertices, so count by how many the number of vertices decreases.
        edit = PrimitiveEdit(primitive, True, triangle, normals.corner, np.zeros(triangle.shape, bool))
        made = apply_edit(edit)
        return max(0, len(used) - len(made.row)) if made is not None else 0
    first = first_equal([data[used] for data in primitive.column.values()], len(used))
    return int((first != np.arange(len(used))).sum())


class _Totals:
    """Sums of the changes over the primitives of a mesh."""

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

    def add_flips(self, n_wrong: int, n_inward: int) -> None:
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


def _locked_sentence(
    primitive: EditablePrimitive, choice: FaceChoice, normals: NormalChoice, n_doubles: int
) -> str:
    counts = (
        (choice.n_unusable, "faces with unusable coordinates"),
        (choice.n_zero_area, "faces without area"),
        (choice.n_duplicate + choice.n_unlike, "duplicate faces"),
        (n_doubles, "duplicate vertices"),
        (normals.n_missing, "vertices without normal"),
        (normals.n_empty + normals.n_long, "vertices with a normal not of unit length"),
    )
    what = ", ".join(f"{count} {words}" for count, words in counts if count)
    return f"primitive {primitive.arrays.index} keeps {what}: {primitive.locked}"


def _unlike_sentence(primitive: EditablePrimitive, count: int) -> str:
    why = (
        "its material blends, so a face drawn twice covers more"
        if primitive.blends
        else "they differ in normals, uv or other attributes, and which one is seen depends on the renderer"
    )
    return f"primitive {primitive.arrays.index} keeps {count} duplicate faces: {why}"
