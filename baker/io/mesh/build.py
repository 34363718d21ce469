"""Builds a `Mesh` from source primitives: drops invalid triangles and unused vertices, adds normals.

All importers use `build_mesh`, so that the same rules apply to all formats.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from baker.core.scene import LARGEST_UV, Material, Mesh, SceneWarning
from baker.core.source_mesh import SourcePrimitive
from baker.topology.triangle_check import (
    duplicates,
    face_normal,
    in_range,
    sound_groups,
    usable_vertices,
    zero_area,
)

# Number of vertices that `sound_meshes` tests together, except in meshes with more.
_BATCH = 1 << 17


def build_mesh(
    name: str, primitives: Sequence[SourcePrimitive], materials: Sequence[Material], *, sound: bool = False
) -> tuple[Mesh | None, list[SceneWarning]]:
    """Concatenate the valid triangles of primitives into one mesh.

    Parameters
    ----------
    name : str
        Name of the mesh.
    primitives : sequence of SourcePrimitive
        The primitives of the file.
    materials : sequence of Material
        Materials of the scene; `double_sided` and the TEXCOORD sets of their textures are used.
    sound : bool
        Whether all triangles are known to be valid, see `sound_meshes`.

    Returns
    -------
    mesh : Mesh or None
        None if no valid triangle is left. If some primitives lack a TEXCOORD set that other primitives have
        or that their material reads, their uv in that set is 0.
    warnings : list of SceneWarning
        One for each kind of invalid triangle, with the number of triangles. Others report recomputed normals,
        and missing or unusable uv.
    """
    primitives = [p for p in primitives if len(p.triangle)]
    if not primitives:
        return None, []
    warnings: list[SceneWarning] = []
    kept = (
        [p.triangle for p in primitives] if sound else _valid_triangles(name, primitives, materials, warnings)
    )
    parts = [_Part(p, t) for p, t in zip(primitives, kept, strict=True) if len(t)]
    if not parts:
        return None, warnings

    sets = _texcoord_sets(name, parts, materials, warnings)
    start = np.cumsum([0] + [len(part.row) for part in parts[:-1]])
    colour = None
    if any(part.source.colour is not None for part in parts):
        colour = np.concatenate([part.colour() for part in parts])
    mesh = Mesh(
        name=name,
        position=np.concatenate([part.source.position[part.row] for part in parts]),
        normal=np.concatenate([part.normal(name, warnings) for part in parts]),
        triangle=np.concatenate([part.triangle + s for part, s in zip(parts, start, strict=True)]).astype(
            np.int32
        ),
        material=np.concatenate([np.full(len(p.triangle), p.source.material, np.int32) for p in parts]),
        primitive=np.concatenate([np.full(len(p.triangle), p.source.index, np.int32) for p in parts]),
        vertex_primitive=np.concatenate([np.full(len(p.row), p.source.index, np.int32) for p in parts]),
        source_vertex=np.concatenate([part.row for part in parts]).astype(np.int32),
        texcoord=tuple(
            np.concatenate([part.texcoord(k) for part in parts]) if k in sets else None
            for k in range(max(2, max(sets, default=0) + 1))
        ),
        colour=colour,
    )
    return mesh, warnings


def sound_meshes(meshes: Sequence[Sequence[SourcePrimitive]]) -> list[bool]:
    """Return for each mesh whether all its triangles are certainly valid, so that no further test is needed.

    Parameters
    ----------
    meshes : sequence of sequence of SourcePrimitive
        The primitives of each mesh.

    Returns
    -------
    list of bool
        One for each mesh. It may be False although all triangles are valid.
    """
    sound = np.zeros(len(meshes), bool)
    size = np.cumsum([sum(len(p.position) for p in mesh) for mesh in meshes])
    for mine in np.split(np.arange(len(meshes)), np.flatnonzero(np.diff(size // _BATCH)) + 1):
        parts = [(number, p) for number in mine for p in meshes[number] if len(p.triangle)]
        if not parts or any(p.stitched for _, p in parts):
            continue
        start = np.cumsum([0] + [len(p.position) for _, p in parts])
        length = [len(p.triangle) for _, p in parts]
        low, high = np.repeat(start[:-1], length), np.repeat(start[1:], length)
        triangle = np.concatenate([p.triangle for _, p in parts]) + low[:, None]
        if not in_range(triangle, low, high).all():
            continue
        owner = np.repeat([number - mine[0] for number, _ in parts], length)
        position = np.concatenate([p.position for _, p in parts])
        sound[mine] = sound_groups(position, triangle, owner, len(mine))
    return sound.tolist()


def _valid_triangles(
    name: str,
    primitives: Sequence[SourcePrimitive],
    materials: Sequence[Material],
    warnings: list[SceneWarning],
) -> list[NDArray[np.int64]]:
    """Return the valid triangles of each primitive; add a warning with a count for each kind of defect.

    Triangles of strips that repeat a vertex are dropped without a warning.
    """
    start = np.cumsum([0] + [len(p.position) for p in primitives])
    position = np.concatenate([p.position for p in primitives])
    triangle = np.concatenate([p.triangle + s for p, s in zip(primitives, start, strict=False)])
    owner = np.repeat(np.arange(len(primitives)), [len(p.triangle) for p in primitives])
    stitched = np.array([p.stitched for p in primitives])[owner]

    def keep(good: NDArray[np.bool_], code: str, what: str) -> None:
        nonlocal triangle, owner
        bad = len(good) - int(good.sum())
        if not bad:
            return
        triangle, owner = triangle[good], owner[good]
        if code:
            some, verb = ("1 triangle", "is") if bad == 1 else (f"{bad} triangles", "are")
            message = f"{some} {what} {verb} left out"
            warnings.append(SceneWarning(code, message, name))

    if stitched.any():
        a, b, c = triangle.T
        keep(~(stitched & ((a == b) | (b == c) | (c == a))), "", "")
    inside = in_range(triangle, start[owner], start[owner + 1])
    if not inside.all():
        keep(inside, "index-range", "with a vertex number that does not exist")
    usable = usable_vertices(position)
    if not usable.all():
        keep(usable[triangle].all(axis=1), "bad-vertices", "with NaN, infinite or huge coordinates")
    keep(~zero_area(position, triangle), "zero-area", "without area")
    material = np.array([p.material for p in primitives], np.int32)[owner]
    double_sided = np.array([materials[p.material].double_sided for p in primitives], bool)[owner]
    keep(
        ~duplicates(position, triangle, material, double_sided),
        "duplicate-faces",
        "with the corners of another",
    )
    if len(primitives) == 1:
        return [triangle]
    return [triangle[owner == i] - start[i] for i in range(len(primitives))]


class _Part:
    """The valid triangles of a primitive, and the indices `row` of the source vertices that they use."""

    def __init__(self, source: SourcePrimitive, triangle: NDArray[np.int64]) -> None:
        self.source = source
        if source.normal is None:
            # Flat normals (glTF 2.0, section 3.7.2.1) need a separate vertex for each corner.
            self.row = triangle.reshape(-1)
            self.triangle = np.arange(len(self.row)).reshape(-1, 3)
            return
        used = np.zeros(len(source.position), bool)
        used[triangle] = True
        self.row = np.flatnonzero(used)
        self.triangle = triangle if len(self.row) == len(used) else (np.cumsum(used) - 1)[triangle]

    def normal(self, name: str, warnings: list[SceneWarning]) -> NDArray[np.float32]:
        position = self.source.position[self.row]
        if self.source.normal is None:
            flat = face_normal(position, self.triangle)
            return np.repeat(_unit(flat), 3, axis=0).astype(np.float32)
        with np.errstate(over="ignore", invalid="ignore"):
            given = self.source.normal[self.row].astype(np.float64)
            x, y, z = given.T
            length = np.sqrt(x * x + y * y + z * z)
            bad = ~(np.isfinite(length) & (length > 1e-12))
        if bad.any():
            some = f"{int(bad.sum())} vertex normals"
            warnings.append(
                SceneWarning("bad-normals", f"{some} of no length or not finite were recomputed", name)
            )
            smooth = np.zeros_like(given)
            face = face_normal(position, self.triangle)
            for axis in range(3):
                smooth[:, axis] = np.bincount(
                    self.triangle.reshape(-1), np.repeat(face[:, axis], 3), minlength=len(smooth)
                )
            # If the face normals at a vertex add up to 0, use the normal of the vertex's first face.
            lost = bad & (np.abs(smooth).max(axis=1) == 0)
            first = np.zeros(len(smooth), np.int64)
            first[self.triangle.reshape(-1)[::-1]] = np.repeat(np.arange(len(face)), 3)[::-1]
            smooth[lost] = face[first[lost]]
            given[bad] = smooth[bad]
        return _unit(given).astype(np.float32)

    def texcoord(self, number: int) -> NDArray[np.float32]:
        value = self.source.texcoord.get(number)
        if value is None:
            return np.zeros((len(self.row), 2), np.float32)
        return np.nan_to_num(value[self.row], nan=0.0, posinf=0.0, neginf=0.0)

    def colour(self) -> NDArray[np.float32]:
        if self.source.colour is None:
            return np.ones((len(self.row), 4), np.float32)
        # glTF clamps vertex colours to 0..1 (section 3.7.2.1). Replace NaN by 1.
        return np.clip(np.nan_to_num(self.source.colour[self.row], nan=1.0), 0.0, 1.0)


def _texcoord_sets(
    name: str, parts: Sequence[_Part], materials: Sequence[Material], warnings: list[SceneWarning]
) -> set[int]:
    """Return the TEXCOORD numbers that the mesh has or its textures read; add warnings about their uv."""
    sets: set[int] = set()
    for part in parts:
        sets.update(part.source.texcoord)
        material = materials[part.source.material]
        for texture in (material.base_colour_texture, material.emission_texture):
            if texture is not None and texture.texcoord not in part.source.texcoord:
                sets.add(texture.texcoord)
                lacks = f"which primitive {part.source.index} lacks"
                message = f"material '{material.name}' reads TEXCOORD_{texture.texcoord}, {lacks}"
                warnings.append(SceneWarning("missing-texcoord", message, name))
    for number in sorted(sets):
        values = [part.source.texcoord[number] for part in parts if number in part.source.texcoord]
        if not all(np.isfinite(value).all() for value in values):
            message = f"TEXCOORD_{number} holds NaN or infinite values, read as 0"
            warnings.append(SceneWarning("bad-texcoord", message, name))
        largest = max((float(np.abs(np.nan_to_num(value)).max(initial=0.0)) for value in values), default=0.0)
        if largest > LARGEST_UV:
            limit = f"beyond {LARGEST_UV:.0f} repeats no texel of a texture has a place of its own"
            message = f"TEXCOORD_{number} reaches {largest:.3g}; {limit}, so map the texture again"
            warnings.append(SceneWarning("bad-texcoord", message, name))
    return sets


def _unit(vector: NDArray[np.float64]) -> NDArray[np.float64]:
    """Normalise vectors (n, 3)."""
    # Divide by the largest component first, so that squares of tiny or huge vectors stay in range.
    # NumPy is several times as fast with whole columns as with the three numbers of each row.
    x, y, z = np.abs(vector).T
    scaled: NDArray[np.float64] = vector / np.maximum(np.maximum(np.maximum(x, y), z), 1e-300)[:, None]
    x, y, z = scaled.T
    length = np.sqrt(x * x + y * y + z * z)
    scaled /= np.maximum(length, 1e-300)[:, None]
    return scaled
