"""Makes shapes and glTF files with known defects, for the tests of fixes and repairs."""

from __future__ import annotations

from typing import Any

import numpy as np
from glb_reader import Glb
from gltf_builder import GltfBuilder

from baker.core.source_mesh import SourcePrimitive
from baker.io.png import encode_png
from baker.repairs.primitive_edit import EditablePrimitive

PICTURE = encode_png(np.full((2, 2, 3), 77, np.uint8))


def box(low=(0.0, 0.0, 0.0), high=(1.0, 1.0, 1.0)) -> tuple[np.ndarray, np.ndarray]:
    """Return vertices (8, 3) float32 and triangles (12, 3) int64 of a closed box that faces outwards."""
    low, high = np.asarray(low), np.asarray(high)
    position = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], np.float64)
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    triangle = [t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))]
    return (low + position * (high - low)).astype(np.float32), np.array(triangle, np.int64)


def torus(n: int = 12, m: int = 8) -> tuple[np.ndarray, np.ndarray]:
    """Return vertices and triangles of a torus of n x m quads that faces outwards."""
    u, v = np.meshgrid(np.arange(n) * 2 * np.pi / n, np.arange(m) * 2 * np.pi / m, indexing="ij")
    radius = 2 + 0.5 * np.cos(v)
    position = np.stack([radius * np.cos(u), 0.5 * np.sin(v), -radius * np.sin(u)], axis=-1).reshape(-1, 3)
    i, j = (a.ravel() for a in np.meshgrid(np.arange(n), np.arange(m), indexing="ij"))
    at = lambda a, b: (a % n) * m + b % m  # noqa: E731
    a, b, c, d = at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)
    triangle = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    return position.astype(np.float32), triangle


def volume(position: np.ndarray, triangle: np.ndarray) -> float:
    """Return the signed volume of a closed mesh, positive if its faces point outwards."""
    a, b, c = (position[triangle[:, k]].astype(np.float64) for k in range(3))
    return float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6)


def away_from(position: np.ndarray, centre: Any) -> np.ndarray:
    """Return unit normals pointing away from a point."""
    out = position - np.asarray(centre, np.float32)
    return (out / np.linalg.norm(out, axis=1, keepdims=True)).astype(np.float32)


def bytes_of(array: np.ndarray) -> np.ndarray:
    return np.ascontiguousarray(array).view(np.uint8).reshape(len(array), -1)


def part(position, triangle, normal=None, *, stitched=False, uv=None, **members) -> EditablePrimitive:
    """Return an editable primitive with float attributes. `uv` becomes TEXCOORD_0."""
    column = {"POSITION": bytes_of(position)}
    texcoord = {}
    if normal is not None:
        column["NORMAL"] = bytes_of(normal)
    if uv is not None:
        column["TEXCOORD_0"], texcoord[0] = bytes_of(uv), uv
    column |= members.pop("column", {})
    arrays = SourcePrimitive(0, 0, position, triangle, normal, texcoord, stitched=stitched)
    return EditablePrimitive(arrays, column, **members)


def soup(position: np.ndarray, triangle: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the mesh with three separate vertices for each triangle."""
    return position[triangle].reshape(-1, 3), np.arange(3 * len(triangle)).reshape(-1, 3)


def random_builder(seed: int) -> GltfBuilder:
    """Return a document of 2 to 4 objects with random defects, and with data that a fix must not change.

    Each object is a box or a torus with shuffled faces. At random, it has duplicate and degenerate faces,
    split vertices, flipped faces, missing normals, normals of wrong length, invalid TEXCOORD_1, tangents,
    custom attributes, a skin, morph targets, an unknown extension, or a further primitive of lines.
    """
    rng = np.random.default_rng(seed)
    b = GltfBuilder()
    image = b.image(PICTURE, sampler=b.add("samplers", {"wrapS": 33071}), extras={"n": seed})
    for k, mode in enumerate(("OPAQUE", "BLEND", "MASK")):
        texture = {"baseColorTexture": {"index": image}} if k == 0 else {}
        b.add(
            "materials",
            {"name": f"m{k}", "alphaMode": mode, "pbrMetallicRoughness": texture, "doubleSided": bool(k % 2)},
        )
    b.json["asset"]["extras"] = {"by": "chance", "number": 0.1}
    b.json["extensionsUsed"] = ["ACME_tag"]
    joint = b.node(name="joint", extras=[1, 2])
    bind = b.accessor(np.eye(4, dtype=np.float32).reshape(1, 16)[:, :4].copy())
    for k in range(int(rng.integers(2, 5))):
        _add_random_object(b, rng, k, joint)
    times, turns = (
        b.accessor(np.array([0, 1], np.float32)),
        b.accessor(np.tile(np.float32([0, 0, 0, 1]), (2, 1))),
    )
    b.add(
        "animations",
        {
            "channels": [{"sampler": 0, "target": {"node": joint, "path": "rotation"}}],
            "samplers": [{"input": times, "output": turns}],
        },
    )
    b.json["extensions"] = {"ACME_tag": {"accessor": bind, "words": ["a", {"b": None}]}}
    return b


def _add_random_object(b: GltfBuilder, rng: np.random.Generator, number: int, joint: int) -> None:
    position, triangle = torus(6, 5) if rng.random() < 0.5 else box((-1, -1, -1), (1, 1, 1))
    centre_normal = away_from(position, (0, 0, 0.01))
    if rng.random() < 0.4:
        at = triangle.ravel()
        position, centre_normal = position[at], centre_normal[at]
        triangle = np.arange(len(at)).reshape(-1, 3)
    if rng.random() < 0.4:
        triangle = triangle.copy()
        some = rng.random(len(triangle)) < 0.3
        triangle[some] = triangle[some][:, ::-1]
    if rng.random() < 0.5:
        again = triangle[rng.integers(0, len(triangle), 3)]
        flat = np.repeat(rng.integers(0, len(position), (2, 1)), 3, axis=1)
        line = triangle[rng.integers(0, len(triangle), 2)][:, [0, 1, 1]]
        triangle = np.concatenate([triangle, np.roll(again, 1, axis=1), flat, line])
    triangle = triangle[rng.permutation(len(triangle))]
    n = len(position)
    uv = rng.random((n, 2), np.float32)
    members: dict[str, Any] = {"TEXCOORD_0": uv, "material": int(rng.integers(0, 3))}
    if rng.random() < 0.6:
        members["NORMAL"] = centre_normal * np.float32(rng.choice([1.0, 1.0, 0.3]))
        if rng.random() < 0.5:
            members["TANGENT"] = np.tile(np.float32([1, 0, 0, 1]), (n, 1))
    if rng.random() < 0.5:
        members["TEXCOORD_1"] = rng.random((n, 2), np.float32)
    if rng.random() < 0.5:
        members["_HEAT"] = rng.integers(0, 2, n).astype(np.float32)
    if rng.random() < 0.5:
        members["extras"] = {"kept": [number, "ü"]}
    fate = rng.random()
    if fate < 0.15:
        members["JOINTS_0"] = np.zeros((n, 4), np.uint8)
        members["WEIGHTS_0"] = np.tile(np.float32([1, 0, 0, 0]), (n, 1))
    elif fate < 0.3:
        members["targets"] = [{"POSITION": b.accessor(position * np.float32(2))}]
    elif fate < 0.4:
        members["extensions"] = {"ACME_tag": {"vertex": 3}}
    kind = np.uint16 if rng.random() < 0.7 else np.uint32
    indexed = rng.random() < 0.8
    if not indexed:
        members = {
            k: v[triangle.ravel()] if isinstance(v, np.ndarray) else v
            for k, v in members.items()
            if k != "targets"
        }
        position = position[triangle.ravel()]
    primitives = [b.primitive(position, triangle.astype(kind) if indexed else None, **members)]
    if rng.random() < 0.3:
        primitives.append(b.primitive(np.array([[0, 0, 0], [1, 1, 1]], np.float32), mode=1))
    mesh = b.mesh(*primitives, name=f"mesh {number}", extras={"of": number})
    b.node(mesh=mesh, name=f"object {number}", translation=[4.0 * number, 0, 0])
    if rng.random() < 0.3:
        b.node(mesh=mesh, name=f"again {number}", translation=[4.0 * number, 5, 0], scale=[-1, 1, 1])


def drawn(glb: Glb, primitive: dict[str, Any], without: set[str] = frozenset()) -> set[tuple[bytes, ...]]:
    """Return the set of a primitive's faces with area, each as the attribute bytes of its three corners.

    The smallest corner comes first. Two faces with the same corners are equal if their winding is the same,
    whichever corner is first in the file.
    """
    names = [name for name in sorted(primitive["attributes"]) if name not in without]
    corner = {name: glb.corners(primitive, name) for name in names}
    place = corner["POSITION"].astype(np.float64)
    found = set()
    for t in range(len(place)):
        a, b, c = place[t]
        size = max(np.linalg.norm(b - a), np.linalg.norm(c - a), np.linalg.norm(c - b))
        if not np.linalg.norm(np.cross(b - a, c - a)) > 1e-6 * size * size:
            continue
        corners = [b"".join((corner[name][t, k] + 0).tobytes() for name in names) for k in range(3)]
        first = corners.index(min(corners))
        found.add(tuple(corners[first:] + corners[:first]))
    return found
