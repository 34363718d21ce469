"""Poses skinned meshes by the joint matrices of the file; the matrix of the mesh's own node does not apply.

world position = sum over joints of (weight x world matrix of the joint x inverse bind matrix) x position

Based on: Khronos Group, glTF 2.0 Specification, section 3.7.3.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from baker.core.errors import InputError
from baker.core.source_mesh import SourcePrimitive
from baker.io.gltf.accessor import FLOAT, component_type, read_accessor
from baker.io.gltf.accessor_bytes import gather_rows
from baker.io.gltf.document import GltfDocument
from baker.io.gltf.json import JsonObject
from baker.io.gltf.node import Placed, local_matrix

# Number of attribute sets JOINTS_k / WEIGHTS_k that are read; each has four joints for each vertex.
_MAX_SETS = 4
# Largest absolute coordinate of the centre of a posed mesh's bounding box, divided by the box's longest edge.
# Above this ratio, float32 positions would lose precision. They are then stored relative to the centre, and
# the matrix of the mesh contains the translation.
_FAR = 8.0


class Poser:
    """Computes the pose of skinned meshes from the matrices of nodes.

    Parameters
    ----------
    document : GltfDocument
        The document.
    nodes : sequence of JsonObject
        The nodes of the document, in the pose in which they are placed.
    """

    def __init__(self, document: GltfDocument, nodes: Sequence[JsonObject]) -> None:
        self._document = document
        self._nodes = nodes
        self._parent: dict[int, int] | None = None

    def pose(
        self, mesh: JsonObject, arrays: Sequence[SourcePrimitive], node: Placed
    ) -> tuple[list[SourcePrimitive], NDArray[np.float64]]:
        """Return a mesh's posed primitives and the (4, 4) float64 matrix, world from posed mesh.

        Parameters
        ----------
        mesh : JsonObject
        arrays : sequence of SourcePrimitive
            The primitives of the mesh, as `read_primitives` returns them.
        node : Placed
            The node with the mesh and the skin. Its matrix applies only to primitives without joints.

        Raises
        ------
        InputError
            If the skin, its matrices, or the joints or weights of a vertex cannot be read.
        """
        skins = self._document.root.children("skins")
        matrices = self._matrices(skins[node.json.index("skin", len(skins), "skins")])
        posed = []
        for part in arrays:
            primitive = mesh.children("primitives")[part.index]
            if "JOINTS_0" in primitive.child("attributes"):
                blend = self._blend(primitive, matrices, len(part.position))
            else:
                blend = np.tile(node.matrix, (len(part.position), 1, 1))
            posed.append((part, *_moved(part, blend)))
        world_from_posed = np.eye(4)
        all_points = np.concatenate([p for _, p, _ in posed]) if posed else np.zeros((0, 3))
        finite = all_points[np.isfinite(all_points).all(axis=1)]
        if len(finite):
            low, high = finite.min(axis=0), finite.max(axis=0)
            if np.abs(low + high).max() > 2 * _FAR * (high - low).max():
                world_from_posed[:3, 3] = 0.5 * (low + high)
        out = [
            replace(part, position=(p - world_from_posed[:3, 3]).astype(np.float32), normal=normal)
            for part, p, normal in posed
        ]
        return out, world_from_posed

    def _matrices(self, skin: JsonObject) -> NDArray[np.float64]:
        """Return (J, 4, 4) float64: world matrix x inverse bind matrix of each joint of a skin."""
        joints = skin.indices("joints", len(self._nodes), "nodes")
        if not joints:
            skin.fail("the skin has no joints")
        world = np.array([self._world(k) for k in joints])
        if "inverseBindMatrices" not in skin:
            return world
        accessors = self._document.root.children("accessors")
        at = skin.index("inverseBindMatrices", len(accessors), "accessors")
        if accessors[at].string("type") != "MAT4" or component_type(self._document, at) != FLOAT:
            accessors[at].fail("inverse bind matrices must be MAT4 of floats")
        rows = np.arange(len(joints), dtype=np.int32)
        try:
            data = gather_rows(self._document.root.value, self._document.buffers, at, rows)
        except InputError as error:
            skin.fail(f"{error.object}: {error.message}", "inverseBindMatrices")
        # Matrices are stored column by column.
        inverse = np.ascontiguousarray(data).view("<f4").reshape(-1, 4, 4).transpose(0, 2, 1)
        return np.asarray(world @ inverse.astype(np.float64), np.float64)

    def _world(self, node: int) -> NDArray[np.float64]:
        """Return the world matrix of a node, which need not be part of the scene."""
        if self._parent is None:
            self._parent = {}
            for k, above in enumerate(self._nodes):
                try:
                    self._parent.update(
                        dict.fromkeys(above.indices("children", len(self._nodes), "nodes"), k)
                    )
                except InputError:
                    continue
        matrix, at, steps = np.eye(4), node, 0
        while True:
            matrix = local_matrix(self._nodes[at]) @ matrix
            steps += 1
            if at not in self._parent:
                return matrix
            if steps > len(self._nodes):
                self._nodes[node].fail("the nodes above this joint form a cycle")
            at = self._parent[at]

    def _blend(
        self, primitive: JsonObject, matrices: NDArray[np.float64], n_vertices: int
    ) -> NDArray[np.float64]:
        """Return the weighted sum of joint matrices for each vertex, (V, 4, 4) float64."""
        attributes = primitive.child("attributes")
        accessors = self._document.root.children("accessors")
        joints: list[NDArray[np.float64]] = []
        weights: list[NDArray[np.float64]] = []
        for k in range(_MAX_SETS):
            if f"JOINTS_{k}" not in attributes:
                break
            for key, into in ((f"JOINTS_{k}", joints), (f"WEIGHTS_{k}", weights)):
                at = attributes.index(key, len(accessors), "accessors")
                value = read_accessor(self._document, at, types=("VEC4",))
                if len(value) != n_vertices:
                    attributes.fail(f"the accessor has {len(value)} rows, POSITION has {n_vertices}", key)
                into.append(value.astype(np.float64))
        joint, weight = np.concatenate(joints, axis=1).astype(np.int64), np.concatenate(weights, axis=1)
        weight = np.nan_to_num(weight, nan=0.0, posinf=0.0, neginf=0.0)
        total = weight.sum(axis=1, keepdims=True)
        # If the sum of a vertex's weights is not positive, its first joint gets weight 1.
        weight = np.where(total > 0, weight / np.where(total > 0, total, 1.0), np.eye(1, weight.shape[1]))
        joint = np.where(weight != 0, joint, 0)
        if len(joint) and joint.max() >= len(matrices):
            attributes.fail(f"joint {joint.max()} is out of range: the skin has {len(matrices)}", "JOINTS_0")
        out = np.zeros((n_vertices, 4, 4))
        for c in range(weight.shape[1]):
            out += weight[:, c, None, None] * matrices[joint[:, c]]
        return out


def _moved(
    part: SourcePrimitive, blend: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float32] | None]:
    """Return world positions, (V, 3) float64, and world normals of any length, (V, 3) float32 or None."""
    with np.errstate(over="ignore", invalid="ignore"):
        position = (
            np.einsum("vij,vj->vi", blend[:, :3, :3], part.position.astype(np.float64)) + blend[:, :3, 3]
        )
        if part.normal is None:
            return position, None
        # Transform normals by the cofactor matrix: unlike the inverse, it exists if the determinant is 0.
        a, b, c = (blend[:, :3, k] for k in range(3))
        cofactor = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], axis=2)
        normal = np.einsum("vij,vj->vi", cofactor, part.normal.astype(np.float64))
        flip = np.where(np.linalg.det(blend[:, :3, :3]) < 0, -1.0, 1.0)
        return position, (flip[:, None] * normal).astype(np.float32)
