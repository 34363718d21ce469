"""Contract of every importer: it reads the same square, and reads or refuses broken files."""

from __future__ import annotations

import json
import struct
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from gltf_builder import QUAD, QUAD_TRIANGLE, quad_builder

from baker.core.errors import BakerError, InputError
from baker.core.settings import make_settings
from baker.io import importers
from baker.io.formats import scene_file_help, scene_suffixes
from baker.io.load import IMPORTERS, load_scene
from baker.pipeline.bake import bake

ROOT = Path(__file__).parents[2]

_OBJ = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n"
_OFF = "OFF\n4 2 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2\n3 0 2 3\n"
_PLY = (
    "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
    "element face 2\nproperty list uchar int vertex_indices\nend_header\n"
    "0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2\n3 0 2 3\n"
)
_STL = b"\0" * 80 + struct.pack("<I", 2)
_STL += b"".join(struct.pack("<12fH", 0, 0, 1, *QUAD[t].reshape(-1), 0) for t in QUAD_TRIANGLE)

# {suffix: file content}: the unit square of the xy plane, facing +z. Add a line for a new importer.
SQUARES = {
    ".glb": quad_builder().glb(),
    ".gltf": quad_builder().gltf(),
    ".obj": _OBJ.encode(),
    ".off": _OFF.encode(),
    ".ply": _PLY.encode(),
    ".stl": _STL,
}


def test_every_importer_has_a_square():
    assert IMPORTERS.names() == sorted(SQUARES)


@pytest.mark.parametrize("suffix", sorted(SQUARES))
@pytest.mark.parametrize("upper", [False, True])
def test_every_importer_reads_the_same_square(tmp_path, suffix, upper):
    path = tmp_path / f"square{suffix.upper() if upper else suffix}"
    path.write_bytes(SQUARES[suffix])
    scene, again = load_scene(path), load_scene(str(path))
    mesh, instance = scene.meshes[0], scene.instances[0]
    corner = mesh.position[mesh.triangle].astype(float)
    cross = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    np.testing.assert_array_equal(cross, [[0, 0, 1]] * 2)
    np.testing.assert_array_equal(mesh.normal, [[0, 0, 1]] * len(mesh.position))
    np.testing.assert_array_equal(instance.world_from_object, np.eye(4))
    assert scene.n_triangles == 2
    assert scene.warnings == ()
    assert len(scene.sha256) == 64
    for name in (
        "position",
        "normal",
        "triangle",
        "material",
        "primitive",
        "vertex_primitive",
        "source_vertex",
    ):
        first, second = getattr(mesh, name), getattr(again.meshes[0], name)
        assert first.dtype == (np.float32 if name in ("position", "normal") else np.int32)
        assert first.tobytes() == second.tobytes()
    assert (mesh.vertex_primitive[mesh.triangle] == mesh.primitive[:, None]).all()
    assert mesh.material.max() < len(scene.materials)
    assert scene.path == path
    assert again.sha256 == scene.sha256


@pytest.mark.parametrize("suffix", sorted(SQUARES))
def test_broken_files_give_a_scene_or_an_input_error(tmp_path, suffix):
    path = tmp_path / f"a{suffix}"
    with pytest.raises(InputError, match="does not exist"):
        load_scene(path)
    path.write_bytes(b"")
    with pytest.raises(InputError, match="is empty"):
        load_scene(path)
    rng = np.random.default_rng(7)
    data = SQUARES[suffix]
    refused = 0
    for round_ in range(120):
        broken = bytearray(data)
        for at in rng.integers(0, len(data), 1 + round_ % 5):
            broken[at] = rng.integers(0, 256)
        path.write_bytes(broken if round_ % 4 else broken[: rng.integers(1, len(data))])
        try:
            mesh = load_scene(path).meshes[0]
        except BakerError as error:
            refused += "\n" not in str(error)
            continue
        assert np.isfinite(mesh.position).all()
        assert mesh.triangle.max() < len(mesh.position)
    assert refused > 10


def test_help_texts_list_what_is_registered():
    assert scene_suffixes() == IMPORTERS.names()
    assert scene_file_help() == "glb, gltf, obj, off, ply or stl file."


def test_the_hook_matches_what_is_registered():
    command = [sys.executable, str(ROOT / "docs" / "make_hooks.py"), "--print"]
    page = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    assert (ROOT / ".pre-commit-hooks.yaml").read_text("utf-8") == page


# An importer in one file. Each line of a .corners file is a corner, and three lines are a triangle.
_TOY = """
import hashlib

import numpy as np

from baker.core.scene import Material
from baker.core.source_mesh import SourcePrimitive
from baker.io.load import IMPORTERS
from baker.io.mesh.scene import scene_of_meshes, to_world


@IMPORTERS.register(".corners")
def import_corners(source):
    corner = np.array([line.split() for line in source.data.decode().splitlines()], np.float64)
    triangle = np.arange(len(corner)).reshape(-1, 3)
    primitive = SourcePrimitive(0, 0, to_world(corner, source.up, source.scale), triangle)
    digest = hashlib.sha256(source.data).hexdigest()
    return scene_of_meshes(source, [("mesh", [primitive])], [Material("grey")], [], digest)
"""


@pytest.fixture
def toy(tmp_path, monkeypatch):
    """Add the importer of `_TOY` to the plugins and return the path of a scene file that it reads."""
    folder = tmp_path / "plugins"
    folder.mkdir()
    (folder / "toy_corners.py").write_text(_TOY)
    names = IMPORTERS.names()
    monkeypatch.setattr(IMPORTERS, "_plugins", {name: IMPORTERS.get(name) for name in names})
    monkeypatch.setattr(IMPORTERS, "_searched", False)
    monkeypatch.setattr(importers, "__path__", [*importers.__path__, str(folder)])
    scene = tmp_path / "scene.corners"
    corner = QUAD[QUAD_TRIANGLE].reshape(-1, 3)
    scene.write_text("".join(f"{x} {y} {z}\n" for x, y, z in corner))
    yield scene
    sys.modules.pop("baker.io.importers.toy_corners", None)


def test_a_new_importer_is_one_file(toy, tmp_path):
    assert ".corners" in scene_suffixes()
    assert ".corners" in IMPORTERS.names()
    assert "corners, glb" in scene_file_help()
    settings = make_settings(
        {"channels": "ao", "resolution": 32, "quality": "preview", "up": "z", "scale": 2.0}
    )
    out = tmp_path / "out"
    result = bake(toy, settings=settings, out=out)
    # With these settings, +z of the file is +Y of the world, and one unit of the file is two metres.
    np.testing.assert_allclose(result.scene.meshes[0].position.max(axis=0), [2, 0, 0], atol=1e-6)
    assert json.loads((out / "bake.json").read_text())["input"]["sha256"] == load_scene(toy).sha256
    assert (out / "scene.glb").stat().st_size > 0
    value = result.lightmaps["ao"].value
    assert (value[result.status == 1] == 1).all()
