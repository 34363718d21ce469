"""The importers of PLY, STL and OFF files."""

from __future__ import annotations

import struct
import subprocess
import sys

import numpy as np
import pytest

from baker.core.errors import InputError
from baker.io.load import load_scene

PLY_HEAD = (
    "ply\nformat {} 1.0\nelement vertex {}\n{}element face {}\n"
    "property list uchar int vertex_indices\nend_header\n"
)
PLY_BODY = "0 0 0\n1 0 0\n0 1 0\n"
XYZ = "property float x\nproperty float y\nproperty float z\n"
OFF = "OFF\n4 2 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2\n3 0 2 3\n"
CORNER = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], np.float32)


def load(tmp_path, name, data, **options):
    path = tmp_path / name
    path.write_bytes(data if isinstance(data, bytes) else data.encode())
    return load_scene(path, **options)


def square_of(scene):
    """Return the corner positions (2, 3, 3) of the scene's two triangles.

    Asserts the instance, material and normals, which are the same for all formats.
    """
    mesh = scene.meshes[0]
    assert [(i.node, i.mesh) for i in scene.instances] == [(0, 0)]
    assert scene.materials[0].base_colour == (0.8, 0.8, 0.8, 1)
    assert scene.source is None
    np.testing.assert_array_equal(mesh.normal[mesh.triangle], np.tile([0, 0, 1], (2, 3, 1)))
    return mesh.position[mesh.triangle]


EXPECTED = CORNER[[[0, 1, 2], [0, 2, 3]]]


@pytest.mark.parametrize("order", ["ascii", "binary_little_endian", "binary_big_endian"])
def test_ply_in_each_encoding(tmp_path, order):
    head = PLY_HEAD.format(order, 4, XYZ, 2)
    if order == "ascii":
        body = "".join(f"{x} {y} {z}\n" for x, y, z in CORNER) + "3 0 1 2\n3 0 2 3\n"
        data = (head + body).encode()
    else:
        mark = "<" if "little" in order else ">"
        data = head.encode() + CORNER.astype(f"{mark}f4").tobytes()
        data += b"".join(struct.pack(f"{mark}B3i", 3, *f) for f in ((0, 1, 2), (0, 2, 3)))
    np.testing.assert_array_equal(square_of(load(tmp_path, "a.ply", data)), EXPECTED)


def test_ply_with_normals_colours_and_a_quad(tmp_path):
    more = XYZ + "property float nx\nproperty float ny\nproperty float nz\n"
    more += "property uchar red\nproperty uchar green\nproperty uchar blue\n"
    body = (
        "".join(f"{x} {y} {z} 0 0 4 {k * 85} 255 0\n" for k, (x, y, z) in enumerate(CORNER)) + "4 0 1 2 3\n"
    )
    scene = load(tmp_path, "a.ply", PLY_HEAD.format("ascii", 4, more, 1) + body)
    mesh = scene.meshes[0]
    assert mesh.triangle.tolist() == [[0, 1, 2], [0, 2, 3]]  # vertices with normals stay shared
    np.testing.assert_array_equal(mesh.normal, [[0, 0, 1]] * 4)
    # The second and third value are the linear values of sRGB 85 and 170.
    np.testing.assert_allclose(mesh.colour[:, 0], [0, 0.0908417, 0.4019778, 1], rtol=1e-5)
    np.testing.assert_array_equal(mesh.colour[:, 1:], [[1, 0, 1]] * 4)


def test_stl_binary_and_text(tmp_path):
    facet = b"".join(struct.pack("<12fH", 0, 0, 1, *t.reshape(-1), 0) for t in EXPECTED)
    binary = load(tmp_path, "a.stl", b"x" * 80 + struct.pack("<I", 2) + facet)
    np.testing.assert_array_equal(square_of(binary), EXPECTED)

    def solid(name, triangles):
        lines = "".join(
            "facet normal 0 0 1\nouter loop\n"
            + "".join(f"vertex {x} {y} {z}\n" for x, y, z in t)
            + "endloop\nendfacet\n"
            for t in triangles
        )
        return f"solid {name}\n{lines}endsolid {name}\n"

    np.testing.assert_array_equal(square_of(load(tmp_path, "b.stl", solid("s", EXPECTED))), EXPECTED)
    two = load(tmp_path, "c.stl", solid("s", EXPECTED) + solid("t", EXPECTED + 5)).meshes[0]
    assert two.primitive.tolist() == [0, 0, 1, 1]
    np.testing.assert_array_equal(two.position[two.triangle[2:]], EXPECTED + 5)


def test_off_with_up_and_scale(tmp_path):
    np.testing.assert_array_equal(square_of(load(tmp_path, "a.off", OFF)), EXPECTED)
    mesh = load(tmp_path, "a.off", OFF, up="z", scale=10.0).meshes[0]
    assert sorted(map(tuple, np.unique(mesh.position, axis=0).tolist())) == [
        (0, 0, -10), (0, 0, 0), (10, 0, -10), (10, 0, 0),
    ]  # fmt: skip
    np.testing.assert_array_equal(mesh.normal, [[0, 1, 0]] * 6)


def test_bad_triangles_are_counted_here_too(tmp_path):
    text = "OFF\n5 4 0\n0 0 0\n1 0 0\n1 1 0\n2 0 0\nnan 0 0\n3 0 1 2\n3 1 2 0\n3 0 1 3\n3 0 1 4\n"
    scene = load(tmp_path, "a.off", text)
    assert scene.n_triangles == 1
    assert {w.code for w in scene.warnings} == {"bad-vertices", "zero-area", "duplicate-faces"}


@pytest.mark.parametrize(
    ("name", "data", "word"),
    [
        ("a.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 7\n", "a.off"),
        ("a.off", "OFF\n3 1 0\n0 0 0\n1 0\n", "OFF"),
        ("a.ply", PLY_HEAD.format("ascii", 3, XYZ, 1) + PLY_BODY + "3 0 1 7\n", "index 7 is out of range"),
        ("a.ply", PLY_HEAD.format("ascii", 3, XYZ, 1) + PLY_BODY + "3 0 1 -2\n", "index -2 is out of range"),
        ("a.ply", PLY_HEAD.format("ascii", 3, XYZ, 0) + PLY_BODY, "nothing to bake"),
        ("a.ply", "ply\nformat ascii 1.0\nend_header\n", "a.ply"),
        ("a.stl", b"x" * 80 + struct.pack("<I", 99) + b"y" * 50, "STL"),
        ("a.stl", "solid s\nendsolid s\n", "a.stl"),
    ],
)  # fmt: skip
def test_bad_files_are_refused_in_a_sentence(tmp_path, name, data, word):
    with pytest.raises(InputError) as caught:
        load(tmp_path, name, data)
    assert word in str(caught.value)
    assert "\n" not in str(caught.value)


def test_the_parsers_own_logs_are_not_shown(tmp_path):
    corner = "vertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\n"
    text = f"solid a\nfacet normal 0 x 1\nouter loop\n{corner}endloop\nendfacet\nendsolid a\n"
    (tmp_path / "a.stl").write_text(text)
    script = "import sys\nfrom baker.io.load import load_scene\nprint(load_scene(sys.argv[1]).n_triangles)"
    command = [sys.executable, "-c", script, str(tmp_path / "a.stl")]
    done = subprocess.run(command, capture_output=True, text=True)
    assert (done.stdout.strip(), done.stderr) == ("1", "")
