"""Computes properties of the faces, edges and pieces of a mesh that several rules use.

Each property is computed on first use and then stored.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from baker.core.material_flags import flag_of_faces
from baker.core.scene import Material
from baker.core.source_mesh import SourceMesh
from baker.topology.edges import Edges, find_edges
from baker.topology.triangle_check import duplicates, face_normal, in_range, usable_vertices, zero_area
from baker.topology.unique_rows import unique_rows
from baker.topology.weld import number_by_first


class MeshFacts:
    """A mesh of the file, with V vertices and T triangular faces.

    Faces are numbered from 0 to T - 1 over all primitives. Degenerate triangles that only join the parts of a
    triangle strip are left out and have no number.

    The G good faces are those that a bake uses: their indices and coordinates are valid, they have area, and
    they repeat no earlier face. Arrays of shape (G, ...) have one entry for each entry of `good`.

    The S sheet faces are the good faces whose three positions are not those of another good face. A piece is
    a set of sheet faces that are connected by edges. Edges and pieces are computed from sheet faces only.

    Attributes
    ----------
    position : (V, 3) float32, object space
    triangle : (T, 3) int64
        Indices into `position`, possibly out of range.
    primitive, local : (T,) int64
        Index into `source.primitives` of each face's primitive, and the number of the face in this primitive.
    material : (T,) int32
        Material index of each face.
    sound : bool
        True if all faces are known to be good, because the importer has removed the others, or because
        `sound_meshes` found no others.
    """

    def __init__(self, source: SourceMesh, materials: tuple[Material, ...], *, sound: bool = False) -> None:
        self.source = source
        self.sound = sound
        self.materials = materials
        start = np.cumsum([0] + [len(p.position) for p in source.primitives])
        self.vertex_start = start
        empty = [np.zeros((0, 3), np.float32)]
        self.position: NDArray[np.float32] = np.concatenate([p.position for p in source.primitives] or empty)
        parts, primitive, local, material = [], [], [], []
        for k, p in enumerate(source.primitives):
            number = np.arange(len(p.triangle))
            if p.stitched:
                # Drop triangles with a repeated index, which only join the parts of a triangle strip.
                t = p.triangle
                number = number[(t[:, 0] != t[:, 1]) & (t[:, 1] != t[:, 2]) & (t[:, 2] != t[:, 0])]
            parts.append(p.triangle[number] + start[k])
            primitive.append(np.full(len(number), k, np.int64))
            local.append(number)
            material.append(np.full(len(number), p.material, np.int32))
        none = np.zeros(0, np.int64)
        self.triangle: NDArray[np.int64] = np.concatenate(parts or [np.zeros((0, 3), np.int64)])
        self.primitive: NDArray[np.int64] = np.concatenate(primitive or [none])
        self.local: NDArray[np.int64] = np.concatenate(local or [none])
        self.material: NDArray[np.int32] = np.concatenate(material or [none.astype(np.int32)])

    @cached_property
    def within(self) -> NDArray[np.bool_]:
        """Return (T,) bool: the faces whose three indices refer to vertices of their own primitive."""
        if self.sound:
            return np.ones(len(self.triangle), bool)
        low, high = self.vertex_start[self.primitive], self.vertex_start[self.primitive + 1]
        return in_range(self.triangle, low, high)

    @cached_property
    def usable(self) -> NDArray[np.bool_]:
        """Return (T,) bool: the faces with valid indices and usable coordinates (see `usable_vertices`)."""
        if self.sound:
            return self.within
        good = usable_vertices(self.position)
        if good.all() and self.within.all():
            return self.within
        found = self.within.copy()
        found[self.within] = good[self.triangle[self.within]].all(axis=1)
        return found

    @cached_property
    def flat(self) -> NDArray[np.bool_]:
        """Return (T,) bool: the usable faces without area."""
        found = np.zeros(len(self.triangle), bool)
        if self.sound:
            return found
        usable = np.flatnonzero(self.usable)
        found[usable] = zero_area(self.position, self.triangle[usable])
        return found

    @cached_property
    def repeated(self) -> NDArray[np.bool_]:
        """Return (T,) bool: the usable faces with area that repeat an earlier face."""
        found = np.zeros(len(self.triangle), bool)
        if self.sound:
            return found
        rest = np.flatnonzero(self.usable & ~self.flat)
        double_sided = self.flag(self.material[rest], lambda m: m.double_sided)
        found[rest] = duplicates(self.position, self.triangle[rest], self.material[rest], double_sided)
        return found

    @cached_property
    def good(self) -> NDArray[np.int64]:
        """Return the indices of the faces that a bake uses, (G,) int64, ascending."""
        return np.flatnonzero(self.usable & ~self.flat & ~self.repeated)

    @cached_property
    def corner(self) -> NDArray[np.float64]:
        """Return the corner positions of the good faces, (G, 3, 3) float64, object space."""
        return self.position[self.triangle[self.good]].astype(np.float64)

    @cached_property
    def bounds(self) -> NDArray[np.float64]:
        """Return the bounding box of the good faces, (2, 3) float64, object space: lowest, highest corner.

        There must be a good face.
        """
        used = self.position[self.triangle[self.good].reshape(-1)].astype(np.float64)
        return np.stack([used.min(axis=0), used.max(axis=0)])

    @cached_property
    def area_vector(self) -> NDArray[np.float64]:
        """Return the normals of the good faces scaled by their areas, (G, 3) float64, object space."""
        return 0.5 * face_normal(self.position, self.triangle[self.good])

    @cached_property
    def area(self) -> NDArray[np.float64]:
        """Return the areas of the good faces, (G,) float64, object space."""
        area: NDArray[np.float64] = np.sqrt(np.einsum("gx,gx->g", self.area_vector, self.area_vector))
        return area

    @cached_property
    def double_sided(self) -> NDArray[np.bool_]:
        """Return (G,) bool: the good faces with a double-sided material."""
        return self.flag(self.material[self.good], lambda m: m.double_sided)

    @cached_property
    def welded(self) -> NDArray[np.int64]:
        """Return the welded vertex of each corner of the good faces, (G, 3) int64.

        Corners with equal positions have the same number.
        """
        corner = self.triangle[self.good]
        # Add 0 to make -0 equal to 0, because bits are compared.
        return unique_rows([self.position + np.float32(0.0)], len(self.position))[1][corner]

    @cached_property
    def single(self) -> NDArray[np.bool_]:
        """Return (G,) bool: the good faces whose three positions are not those of another good face."""
        ordered = np.sort(self.welded, axis=1)
        n = int(ordered.max(initial=0)) + 1
        # Hash the three vertex numbers of a face, because a unique key may need more than 64 bits.
        key = (ordered[:, 0] * n + ordered[:, 1]).astype(np.uint64) * np.uint64(0x9E3779B97F4A7C15)
        key ^= ordered[:, 2].astype(np.uint64) * np.uint64(0xBF58476D1CE4E5B9)
        order = np.argsort(key)
        same = key[order][1:] == key[order][:-1]
        twin = np.zeros(len(key), bool)
        twin[order[1:][same]] = True
        twin[order[:-1][same]] = True
        return ~twin

    @cached_property
    def edges(self) -> Edges:
        """Return the edges of the sheet faces. `Edges.face` contains indices into `sheet`."""
        return find_edges(self.welded[self.sheet])

    @cached_property
    def sheet(self) -> NDArray[np.int64]:
        """Return the sheet faces as indices into `good`, (S,) int64: those for which `single` is true."""
        return np.flatnonzero(self.single)

    @cached_property
    def piece(self) -> NDArray[np.int32]:
        """Return the piece of each sheet face, (S,) int32. The faces of a piece are connected by edges."""
        return number_by_first(self.edges.connected_faces(len(self.sheet)))

    @cached_property
    def n_pieces(self) -> int:
        """Return the number of pieces, P."""
        return int(self.piece.max(initial=-1)) + 1

    @cached_property
    def closed(self) -> NDArray[np.bool_]:
        """Return (P,) bool: the pieces in which two consistently wound faces meet at every edge."""
        edges = self.edges
        fine = (edges.count == 2) & (edges.balance == 0)
        closed = np.ones(self.n_pieces, bool)
        closed[self.piece[edges.face[edges.first[~fine]]]] = False
        return closed

    @cached_property
    def volume(self) -> NDArray[np.float64]:
        """Return the signed volume of each piece, (P,) float64, object space.

        It is meaningful only for pieces that are `closed`, and positive if their fronts point outwards.
        """
        corner = self.corner[self.sheet]
        corner = corner - corner.mean(axis=(0, 1))
        six = np.einsum("gx,gx->g", corner[:, 0], 2.0 * self.area_vector[self.sheet])
        return np.bincount(self.piece, six / 6.0, minlength=self.n_pieces).astype(np.float64)

    def flag(self, material: NDArray[np.int32], read: Callable[[Material], bool]) -> NDArray[np.bool_]:
        """Return (n,) bool: the result of `read` for the material at each index of `material` (n,)."""
        return flag_of_faces(self.materials, material, read)

    def named(self, faces: NDArray[np.integer], most: int = 10) -> tuple[int, ...]:
        """Return the numbers in their primitives (`local`) of the first `most` of the faces (n,)."""
        return tuple(int(k) for k in self.local[faces[:most]])

    def primitive_of(self, faces: NDArray[np.integer]) -> int | None:
        """Return the number in the mesh of the primitive of the first of the faces (n,), None if n is 0."""
        return int(self.source.primitives[self.primitive[faces[0]]].index) if len(faces) else None
