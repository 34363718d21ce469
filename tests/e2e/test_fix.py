"""`baker check --fix` on the command line. Bakes before and after the fix are compared."""

from __future__ import annotations

import io
import json
import sys
from pathlib import Path

import numpy as np
import pytest
from glb_reader import Glb
from gltf_builder import GltfBuilder, write
from probes import Probe

import baker
from baker.cli.app import run

THIRD_PARTY = Path(__file__).parents[2] / "assets" / "third-party"
SCENES = sorted(p for p in THIRD_PARTY.rglob("*") if p.suffix in {".glb", ".gltf", ".obj"})


def check(*argv):
    out = io.StringIO()
    return run(["check", *map(str, argv)], out=out), out.getvalue()


def quads(*corners):
    """Return separate quads, two triangles each: positions, triangles, face normals."""
    position = np.array(corners, np.float32).reshape(-1, 3)
    first = np.arange(0, len(position), 4)[:, None]
    triangle = np.concatenate([first + np.array(t) for t in ((0, 1, 2), (0, 2, 3))])
    quad = position.reshape(-1, 4, 3).astype(np.float64)
    normal = np.cross(quad[:, 1] - quad[:, 0], quad[:, 3] - quad[:, 0])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    return position, triangle, np.repeat(normal, 4, axis=0).astype(np.float32)


def crate(low, high):
    """Return the six faces of a box as corners of quads, fronts outwards."""
    (x, y, z), (X, Y, Z) = low, high
    return [
        [(x, Y, z), (x, Y, Z), (X, Y, Z), (X, Y, z)], [(x, y, z), (X, y, z), (X, y, Z), (x, y, Z)],
        [(x, y, Z), (X, y, Z), (X, Y, Z), (x, Y, Z)], [(X, y, z), (x, y, z), (x, Y, z), (X, Y, z)],
        [(X, y, Z), (X, y, z), (X, Y, z), (X, Y, Z)], [(x, y, z), (x, y, Z), (x, Y, Z), (x, Y, z)],
    ]  # fmt: skip


def spoiled_room() -> GltfBuilder:
    """Return a floor with a crate under a light, with defects that do not prevent a bake.

    The floor has duplicate faces, faces without area and no normals. The triangles of the crate share no
    vertices, and their lightmap uv all overlap.
    """
    b = GltfBuilder()
    b.add("materials", {"pbrMetallicRoughness": {"baseColorFactor": [0.6, 0.5, 0.4, 1], "metallicFactor": 0}})
    floor, triangle, _ = quads([(-2, 0, -2), (-2, 0, 2), (2, 0, 2), (2, 0, -2)])
    bad = np.concatenate([triangle, triangle[:, [1, 2, 0]], [[0, 0, 2], [1, 1, 1]]])
    b.node(name="floor", mesh=b.mesh(b.primitive(floor, bad.astype(np.uint16), material=0)))
    box, faces, normal = quads(*crate((-0.5, 0, -0.5), (0.5, 1, 0.5)))
    corner = faces.ravel()
    uv = np.tile(np.float32([[0, 0], [1, 0], [1, 1]]), (len(faces), 1))
    heap = b.primitive(
        box[corner], NORMAL=normal[corner], TEXCOORD_0=box[corner][:, :2].copy(), TEXCOORD_1=uv, material=0
    )
    b.node(name="crate", mesh=b.mesh(heap))
    light = {"type": "point", "intensity": 100.0}
    b.json["extensions"] = {"KHR_lights_punctual": {"lights": [light]}}
    b.json["extensionsUsed"] = ["KHR_lights_punctual"]
    b.node(name="lamp", translation=[1.2, 2.5, 1.0], extensions={"KHR_lights_punctual": {"light": 0}})
    return b


@pytest.fixture
def room(tmp_path):
    return write(tmp_path / "room.glb", spoiled_room())


def test_the_fixed_file_bakes_to_the_same_picture(room, tmp_path):
    fixed = tmp_path / "fixed.glb"
    code, _ = check(room, "--fix", "-o", fixed, "-q")
    assert code == 0
    one, two = (
        Probe(baker.bake(path, resolution=128, samples=64, denoise=False, ao_distance="1", sky="3"))
        for path in (room, fixed)
    )
    rng = np.random.default_rng(5)
    for name, n_faces in (("floor", 2), ("crate", 12)):
        assert (two.name == name).sum() == n_faces
        points, normals = one.surface_points(name, 150, rng)
        # Exclude points near the crate's edges, where a texel may be in shade in one bake and in light in the
        # other.
        clear = (np.abs(points).max(axis=1) > 0.6) if name == "floor" else (np.abs(points[:, 1] - 0.5) < 0.4)
        where = points[clear], normals[clear]
        for channel in ("irradiance", "ao"):
            a, b = (
                np.array([probe.at(p, m, channel).mean() for p, m in zip(*where, strict=True)])
                for probe in (one, two)
            )
            assert np.median(np.abs(a - b) / a.mean()) < 0.03
            assert b.mean() == pytest.approx(a.mean(), rel=0.03)


def test_json_lists_what_was_fixed_and_what_is_left(room, tmp_path):
    code, text = check(room, "--fix", "-o", tmp_path / "fixed.glb", "--json", "-q")
    told = json.loads(text)
    assert code == 0
    assert told["passed"]
    assert [(f["object"], f["change"], f["before"], f["after"]) for f in told["fixed"]] == [
        ("floor", "zero-area-faces", 6, 4),
        ("floor", "duplicate-faces", 4, 2),
        ("floor", "missing-normals", 4, 0),
        ("crate", "duplicate-vertices", 36, 30),
        ("crate", "lightmap-uv", 1, 0),
    ]
    assert told["left_alone"] == []
    assert told["out"] == str(tmp_path / "fixed.glb")
    # `check` no longer reports these codes.
    fixable = {"zero-area", "duplicate-faces", "duplicate-vertices", "missing-normals", "uv-overlap"}
    _, before = check(room, "--json", "-q")
    assert fixable & {f["code"] for f in json.loads(before)["findings"]}
    assert not fixable & {f["code"] for f in told["findings"]}


def test_text_names_every_change(room, tmp_path):
    _, text = check(room, "--fix", "-o", tmp_path / "fixed.glb")
    assert "fixed: duplicate-faces: 'floor' (node 0) faces: 4 -> 2" in text
    assert f"{tmp_path / 'fixed.glb'}: passed" in text


def test_the_input_and_other_files_are_safe(room, tmp_path, capsys):
    before = room.read_bytes()
    assert check(room, "--fix", "-o", room, "--force")[0] == 2
    (tmp_path / "there.glb").write_bytes(b"mine")
    assert check(room, "--fix", "-o", tmp_path / "there.glb")[0] == 2
    assert (tmp_path / "there.glb").read_bytes() == b"mine"
    assert check(room, "--fix")[0] == 2
    assert check(room, "-o", tmp_path / "x.glb")[0] == 2
    assert check(room, room, "--fix", "-o", tmp_path / "x.glb")[0] == 2
    assert check(tmp_path / "no.glb", "--fix", "-o", tmp_path / "x.glb")[0] == 3
    assert "Traceback" not in capsys.readouterr().err
    assert room.read_bytes() == before
    assert sorted(p.name for p in tmp_path.iterdir()) == ["room.glb", "there.glb"]
    assert check(room, "--fix", "-o", tmp_path / "there.glb", "--force", "-q")[0] == 0


def test_repair_tells_how_far_the_surface_moved(tmp_path):
    b = GltfBuilder()
    angle = np.arange(301) * np.pi / 300
    arc = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    position = np.concatenate([arc, arc + np.array([0, 0, 1])]).astype(np.float32)
    k = np.arange(300)
    halves = [np.stack(t, axis=1) for t in ((k, k + 1, k + 302), (k, k + 302, k + 301))]
    uv = position[:, :2].copy()
    b.node(
        name="scan",
        mesh=b.mesh(b.primitive(position, np.concatenate(halves).astype(np.uint16), TEXCOORD_0=uv)),
    )
    scene = write(tmp_path / "scan.glb", b)
    code, text = check(scene, "--repair", "-o", tmp_path / "fixed.glb")
    assert code == 0
    line = next(line for line in text.splitlines() if "fixed: remeshed" in line)
    assert "'scan' (node 0) faces: 600 -> " in line
    assert "the surface moved by up to 0.00" in line
    assert line.endswith("TEXCOORD_0 could not be kept")


def test_repair_without_its_library_is_one_sentence(room, tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "pymeshlab", None)
    assert check(room, "--repair", "-o", tmp_path / "fixed.glb")[0] == 4
    assert "pip install pymeshlab" in capsys.readouterr().err
    assert not (tmp_path / "fixed.glb").exists()


@pytest.mark.parametrize("path", SCENES, ids=lambda p: p.stem)
def test_third_party_scenes_are_fixed_once(path, tmp_path):
    """The fixed file is readable and has the same materials; fixing the fixed file changes nothing."""
    first, second = tmp_path / "first.glb", tmp_path / "second.glb"
    code, text = check(path, "--fix", "-o", first, "--json", "-q", "--resolution", "256")
    if path.stem == "zero_area_face":
        assert code == 3, "its only triangle has no area, so no bake could read the result"
        assert not first.exists()
        return
    assert code in (0, 1), text
    glb = Glb(first)
    if path.suffix == ".glb":
        before = Glb(path)
        for key in ("materials", "textures", "samplers", "nodes", "scenes", "skins", "animations", "extras"):
            assert glb.json.get(key) == before.json.get(key), key
        for a, b in zip(before.json.get("images", []), glb.json.get("images", []), strict=True):
            old = before.view(a["bufferView"]) if "bufferView" in a else (path.parent / a["uri"]).read_bytes()
            assert glb.view(b["bufferView"]) == old
    code, text = check(first, "--fix", "-o", second, "--json", "-q", "--resolution", "256")
    assert json.loads(text)["fixed"] == []
    assert first.read_bytes() == second.read_bytes()
