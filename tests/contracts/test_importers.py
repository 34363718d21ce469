"""What every importer promises: the same square from every format, and no surprise from broken files."""

from __future__ import annotations

import struct

import numpy as np
import pytest
from gltf_builder import QUAD, QUAD_TRIANGLE, quad_builder

from baker.core.errors import BakerError, InputError
from baker.io.load import IMPORTERS, load_scene

_OBJ = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n"
_OFF = "OFF\n4 2 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2\n3 0 2 3\n"
_PLY = (
    "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
    "element face 2\nproperty list uchar int vertex_indices\nend_header\n"
    "0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2\n3 0 2 3\n"
)
_STL = b"\0" * 80 + struct.pack("<I", 2)
_STL += b"".join(struct.pack("<12fH", 0, 0, 1, *QUAD[t].reshape(-1), 0) for t in QUAD_TRIANGLE)

# The unit square of the xy plane, facing +z. A new importer adds its own line.
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
def test_the_square_arrives_whole(tmp_path, suffix, upper):
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
