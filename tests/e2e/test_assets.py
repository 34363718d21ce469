"""Scenes of assets/: reproducible bytes, closed meshes with fronts outwards, and documented sizes."""

from __future__ import annotations

import json
import struct
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

ASSETS = Path(__file__).parents[2] / "assets"
SCENES = ("cornell", "interior", "hall")
TYPES = {"SCALAR": 1, "VEC2": 2, "VEC3": 3}


def read(name):
    data = (ASSETS / f"{name}.glb").read_bytes()
    magic, version, total = struct.unpack("<4sII", data[:12])
    assert (magic, version, total) == (b"glTF", 2, len(data))
    size = struct.unpack("<I", data[12:16])[0]
    return json.loads(data[20 : 20 + size]), data[28 + size :]


def array(document, body, index):
    accessor = document["accessors"][index]
    start = document["bufferViews"][accessor["bufferView"]]["byteOffset"]
    width = TYPES[accessor["type"]]
    kind = "<u2" if accessor["componentType"] == 5123 else "<f4"
    values = np.frombuffer(body, kind, accessor["count"] * width, start).reshape(-1, width)
    return values.astype(float if kind == "<f4" else int)


def meshes(name):
    """Yield (mesh name, corners (T, 3, 3), vertex normals at the corners (T, 3, 3))."""
    document, body = read(name)
    for mesh in document["meshes"]:
        corners, normals = [], []
        for primitive in mesh["primitives"]:
            index = array(document, body, primitive["indices"]).reshape(-1, 3)
            corners.append(array(document, body, primitive["attributes"]["POSITION"])[index])
            normals.append(array(document, body, primitive["attributes"]["NORMAL"])[index])
        yield mesh["name"], np.concatenate(corners), np.concatenate(normals)


def triangles(name):
    document, _ = read(name)
    count = {
        k: sum(document["accessors"][p["indices"]]["count"] // 3 for p in mesh["primitives"])
        for k, mesh in enumerate(document["meshes"])
    }
    return sum(count[node["mesh"]] for node in document["nodes"] if "mesh" in node)


def directed_edges(corner):
    """Return (E, 2) point indices of the directed edges of triangles; coincident points have one index."""
    _, point = np.unique(np.round(corner.reshape(-1, 3), 5), axis=0, return_inverse=True)
    triangle = point.reshape(-1, 3)
    return triangle[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)


def test_scenes_are_made_again_byte_for_byte(tmp_path):
    subprocess.run(
        [sys.executable, str(ASSETS / "make_scenes.py"), str(tmp_path)], check=True, capture_output=True
    )
    for name in SCENES:
        assert (tmp_path / f"{name}.glb").read_bytes() == (ASSETS / f"{name}.glb").read_bytes(), name


def test_scenes_have_the_promised_size():
    assert triangles("cornell") == 32
    assert 10_000 < triangles("interior") < 40_000
    assert 69_000 < triangles("hall") < 72_000
    for name in SCENES:
        assert (ASSETS / f"{name}.glb").stat().st_size < 1_000_000


@pytest.mark.parametrize("name", SCENES)
def test_normals_and_faces_agree(name):
    for mesh, corner, normal in meshes(name):
        face = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
        length = np.linalg.norm(face, axis=1)
        assert length.min() > 1e-7, mesh
        assert np.allclose(np.linalg.norm(normal, axis=2), 1.0, atol=1e-5), mesh
        # The cosine between a vertex normal and its face normal is above 0.3.
        assert np.einsum("tk,tck->tc", face / length[:, None], normal).min() > 0.3, mesh


@pytest.mark.parametrize("name", ["interior", "hall"])
def test_solids_are_closed_and_right_way_out(name):
    solids = {mesh: corner for mesh, corner, _ in meshes(name)}
    # Only together, floor, walls and ceiling form a closed solid.
    building = np.concatenate([solids.pop(part) for part in ("floor", "walls", "ceiling")])
    for mesh, corner in {**solids, "building": building}.items():
        edge = directed_edges(corner)
        forth = edge[np.lexsort(edge.T)]
        back = edge[:, ::-1][np.lexsort(edge[:, ::-1].T)]
        assert (forth == back).all(), f"{mesh} is open"
        volume = np.einsum("tk,tk->t", corner[:, 0], np.cross(corner[:, 1], corner[:, 2])).sum() / 6
        assert volume > 0, f"{mesh} is inside out"


@pytest.mark.parametrize(
    ("name", "kinds"), [("cornell", set()), ("interior", {"directional"}), ("hall", {"directional", "point"})]
)
def test_lights_and_uvs(name, kinds):
    document, _ = read(name)
    lights = document.get("extensions", {}).get("KHR_lights_punctual", {"lights": []})["lights"]
    assert {light["type"] for light in lights} == kinds
    emissive = [material for material in document["materials"] if "emissiveFactor" in material]
    assert emissive
    assert all("KHR_materials_emissive_strength" in material["extensions"] for material in emissive)
    textured = {
        k for k, m in enumerate(document["materials"]) if "baseColorTexture" in m["pbrMetallicRoughness"]
    }
    for mesh in document["meshes"]:
        for primitive in mesh["primitives"]:
            assert "TEXCOORD_1" not in primitive["attributes"]
            if primitive["material"] in textured:
                assert "TEXCOORD_0" in primitive["attributes"]
    names = [node["name"] for node in document["nodes"]]
    assert len(set(names)) == len(names)
