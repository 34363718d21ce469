"""The importer of OBJ and MTL files reads geometry, relative indices and materials, and refuses errors."""

from __future__ import annotations

import hashlib

import numpy as np
import pytest
from PIL import Image

from baker.core.errors import InputError
from baker.core.read_options import ReadOptions
from baker.io.load import load_scene
from baker.io.scene_hash import scene_sha256

SQUARE = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"


def load(tmp_path, text, **options):
    (tmp_path / "a.obj").write_bytes(text.encode() if isinstance(text, str) else text)
    return load_scene(tmp_path / "a.obj", **options)


def area(scene):
    total = 0.0
    for instance in scene.instances:
        mesh = scene.meshes[instance.mesh]
        corner = mesh.position[mesh.triangle].astype(float)
        cross = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
        total += np.linalg.norm(cross, axis=1).sum() / 2
    return total


def codes(scene):
    return {warning.code: warning.message for warning in scene.warnings}


def test_relative_indices_count_back_from_where_they_stand(tmp_path):
    # Squares of side 1, 2 and 3. Each face refers to the four vertices before it. The last face refers to the
    # vertices of the first square.
    text = ""
    for side in (1, 2, 3):
        text += "".join(f"v {x * side} {y * side} {side}\n" for x, y in ((0, 0), (1, 0), (1, 1), (0, 1)))
        text += "f -4 -3 -2 -1\n"
    text += "f -9 -10 -11 -12\n"  # the first square with opposite winding
    scene = load(tmp_path, text)
    assert scene.n_triangles == 8
    assert area(scene) == pytest.approx(1 + 4 + 9 + 1)
    corner = scene.meshes[0].position[scene.meshes[0].triangle]
    assert np.unique(corner[-2:, :, 2]).tolist() == [1]


def test_shapes_materials_and_primitives(tmp_path):
    (tmp_path / "room.mtl").write_text(
        "newmtl red\nKd 0.5 0.25 0\n\nnewmtl bulb\n\tKd 0.78 0.78 0.78\n\tKe 17 12 4\n"
        "newmtl glass\nKd 1 1 1\nd 0.25\n"
    )
    scene = load(
        tmp_path,
        "mtllib room.mtl\no floor\n" + SQUARE + "usemtl red\nf 1 2 3\nusemtl bulb\nf 1 3 4\n"
        "g pane\nusemtl glass\nf 2 1 3 4\n",
    )
    assert [m.name for m in scene.materials] == ["red", "bulb", "glass"]
    red, bulb, glass = scene.materials
    assert red.base_colour == (0.5, 0.25, 0, 1)
    assert red.emission == (0, 0, 0)
    assert bulb.emission == (17, 12, 4)
    assert (glass.base_colour[3], glass.alpha_mode, red.alpha_mode) == (0.25, "BLEND", "OPAQUE")
    assert [m.name for m in scene.meshes] == ["floor", "pane"]
    assert [(i.node, i.mesh, i.name) for i in scene.instances] == [(0, 0, "floor"), (1, 1, "pane")]
    floor = scene.meshes[0]
    assert floor.material.tolist() == [0, 1]
    assert floor.primitive.tolist() == [0, 1]
    assert floor.vertex_primitive.tolist() == [0, 0, 0, 1, 1, 1]
    assert scene.source is None
    assert scene.warnings == ()


def test_polygons_are_cut_and_faces_without_normals_are_flat(tmp_path):
    scene = load(tmp_path, SQUARE + "v 0.5 1.5 0\nf 1 2 3 5 4\n")
    assert area(scene) == pytest.approx(1.25)
    assert scene.n_triangles == 3
    np.testing.assert_array_equal(scene.meshes[0].normal, [[0, 0, 1]] * 9)
    assert scene.materials[0].base_colour == (0.8, 0.8, 0.8, 1)


def test_normals_and_turned_texture_coordinates(tmp_path):
    scene = load(tmp_path, SQUARE + "vt 0.25 0.75\nvt 1 0\nvn 0 0 2\nvn 0 3 0\nf 1/1/1 2/2/1 3/1/2 4/2/1\n")
    mesh = scene.meshes[0]
    assert len(mesh.position) == 4
    by_position = {
        tuple(p): (tuple(n), tuple(t))
        for p, n, t in zip(mesh.position, mesh.normal, mesh.texcoord[0], strict=True)
    }
    assert by_position[(0, 0, 0)] == ((0, 0, 1), (0.25, 0.25))
    assert by_position[(1, 1, 0)] == ((0, 1, 0), (0.25, 0.25))
    assert by_position[(0, 1, 0)] == ((0, 0, 1), (1, 1))


def test_up_and_scale_are_put_into_the_positions(tmp_path):
    text = "v 1 2 3\nv 2 2 3\nv 1 3 3\nvn 0 0 1\nf 1//1 2//1 3//1\n"
    mesh = load(tmp_path, text, up="z", scale=0.01).meshes[0]
    np.testing.assert_allclose(mesh.position[0], (0.01, 0.03, -0.02), rtol=1e-6)
    np.testing.assert_array_equal(mesh.normal, [[0, 1, 0]] * 3)
    corner = mesh.position[mesh.triangle[0]].astype(float)
    assert np.cross(corner[1] - corner[0], corner[2] - corner[0])[1] > 0  # rotated, not mirrored


def test_textures_with_options_and_blanks_in_names(tmp_path):
    pixels = np.arange(16, dtype=np.uint8).reshape(2, 2, 4)
    Image.fromarray(pixels).save(tmp_path / "old wood.png")
    (tmp_path / "m.mtl").write_text(
        "newmtl a\nKd 1 1 1\nmap_Kd -s 2 4 1 -o 0.5 0 0 -clamp on C:\\art\\old wood.png\n"
        "map_Ke old wood.png\n"
    )
    scene = load(tmp_path, "mtllib m.mtl\nusemtl a\n" + SQUARE + "vt 0.25 0.125\nf 1/1 2/1 3/1 4/1\n")
    material = scene.materials[0]
    texture = material.base_colour_texture
    np.testing.assert_array_equal(texture.image, pixels)
    assert texture.wrap == ("clamp", "clamp")
    # In OBJ, where v points up, the transformed uv is (2 * 0.25 + 0.5, 4 * 0.125) = (1, 0.5). In the scene,
    # where v points down, it is (1, 1 - 0.5), the same point.
    u, v = scene.meshes[0].texcoord[0][0]
    np.testing.assert_allclose(texture.transform @ (u, v, 1), (1, 0.5))
    assert material.emission == (1, 1, 1)
    assert material.emission_texture.image is texture.image
    expected = hashlib.sha256((tmp_path / "a.obj").read_bytes())
    for name in ("m.mtl", "old wood.png"):
        expected.update((tmp_path / name).read_bytes())
    assert scene.sha256 == expected.hexdigest()


def test_a_missing_library_or_material_gives_grey(tmp_path):
    scene = load(tmp_path, "mtllib gone.mtl\nusemtl red\n" + SQUARE + "f 1 2 3\n")
    assert scene.materials[scene.meshes[0].material[0]].base_colour == (0.8, 0.8, 0.8, 1)
    assert "'gone.mtl' is missing" in codes(scene)["missing-mtl"]
    (tmp_path / "m.mtl").write_text("newmtl blue\nKd 0 0 1\n")
    scene = load(tmp_path, "mtllib m.mtl\nusemtl red\n" + SQUARE + "f 1 2 3\nusemtl blue\nf 1 3 4\n")
    assert [scene.materials[k].name for k in scene.meshes[0].material] == ["blue", "default"]
    assert "no-material" in codes(scene)


def test_faces_with_invalid_vertices_are_left_out(tmp_path):
    scene = load(tmp_path, SQUARE + "v nan 5 5\nv 1 1e999 0\nv 2 two 2\nf 1 2 3\nf 1 2 5\nf 1 6 2\nf 2 3 7\n")
    assert scene.n_triangles == 1
    assert codes(scene)["bad-vertices"].startswith("3 triangles")


def test_vertex_colours_are_decoded(tmp_path):
    text = "v 0 0 0 1 0 0.5\nv 1 0 0 1 1 1\nv 0 1 0 0 0 0\nf 1 2 3\n"
    colour = load(tmp_path, text).meshes[0].colour
    np.testing.assert_allclose(colour, [[1, 0, 0.21404114, 1], [1, 1, 1, 1], [0, 0, 0, 1]], rtol=1e-5)
    assert load(tmp_path, SQUARE + "f 1 2 3\n").meshes[0].colour is None


def test_names_in_another_encoding_load(tmp_path):
    scene = load(tmp_path, "o b\xe9ton\n".encode("latin-1") + SQUARE.encode() + b"f 1 2 3\n")
    assert scene.meshes[0].name == "b\xe9ton"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (SQUARE + "f 1 2 9\n", ["vertex 9", "has 4"]),
        (SQUARE + "f 1/7 2/7 3/7\n", ["texture vertex 7", "has 0"]),
        (SQUARE + "f 1//3 2//3 3//3\n", ["normal 3"]),
        (SQUARE + "f 1 2 -9\n", ["cannot be parsed"]),
        (SQUARE + "f 0 1 2\n", ["cannot be parsed"]),
        (SQUARE + "l 1 2 3\np 1\n", ["nothing to bake"]),
        (SQUARE + "f 1 1 2\n", ["nothing to bake", "1 triangle without area"]),
        ("# empty\n", ["nothing to bake"]),
    ],
)
def test_bad_files_are_refused_in_a_sentence(tmp_path, text, words):
    with pytest.raises(InputError) as caught:
        load(tmp_path, text)
    for word in words:
        assert word in str(caught.value)


@pytest.mark.parametrize("broken", ["Kd 0.5 x 0", "Ke -1 0 0", "map_Kd gone.png", "Kd spectral f.rfl"])
@pytest.mark.parametrize("name", ["b", "two words"])
def test_unused_broken_materials_are_accepted(tmp_path, broken, name):
    (tmp_path / "m.mtl").write_text(f"newmtl {name}\n{broken}\nnewmtl a\nKd 0.25 0.5 0.75\n")
    scene = load(tmp_path, "mtllib m.mtl\nusemtl a\n" + SQUARE + "f 1 2 3\n")
    assert [m.name for m in scene.materials] == [name, "a"]
    assert scene.materials[scene.meshes[0].material[0]].base_colour == (0.25, 0.5, 0.75, 1)
    with pytest.raises(InputError):
        load(tmp_path, f"mtllib m.mtl\nusemtl {name}\n" + SQUARE + "f 1 2 3\n")


@pytest.mark.parametrize(
    ("mtl", "words"),
    [
        ("newmtl a\nKd 0.5 x 0\n", ["m.mtl: a", "Kd", "'x'"]),
        ("newmtl a\nKe -1 0 0\n", ["Ke", "negative"]),
        ("newmtl a\nmap_Kd gone.png\n", ["gone.png", "missing"]),
        ("newmtl a\nKd spectral f.rfl\n", ["spectral"]),
    ],
)
def test_bad_libraries_are_refused_in_a_sentence(tmp_path, mtl, words):
    (tmp_path / "m.mtl").write_text(mtl)
    with pytest.raises(InputError) as caught:
        load(tmp_path, "mtllib m.mtl\nusemtl a\n" + SQUARE + "f 1 2 3\n")
    for word in words:
        assert word.lower() in str(caught.value).lower()


@pytest.mark.parametrize("image", [None, b"no image"])
def test_a_colour_replaces_a_missing_picture(tmp_path, image):
    if image is not None:
        (tmp_path / "gone.png").write_bytes(image)
    (tmp_path / "m.mtl").write_text("newmtl a\nKd 0.5 0.25 1\nmap_Kd gone.png\n")
    text = "mtllib m.mtl\nusemtl a\n" + SQUARE + "f 1 2 3\n"
    with pytest.raises(InputError, match=r"gone\.png|decoded"):
        load(tmp_path, text)
    scene = load(tmp_path, text, options=ReadOptions(missing_textures="grey"))
    np.testing.assert_array_equal(scene.materials[0].base_colour_texture.image, [[[0.5, 0.5, 0.5, 1]]])
    assert scene.materials[0].base_colour == (0.5, 0.25, 1, 1)
    assert [w.object for w in scene.warnings if w.code == "missing-texture"] == ["a"]
    assert scene.sha256 == scene_sha256(tmp_path / "a.obj")


@pytest.mark.parametrize(
    ("split", "names"), [("groups", ["a", "b", "c"]), ("objects", ["a", "c"]), ("none", ["shape_0"])]
)
def test_objects_and_groups_become_meshes(tmp_path, split, names):
    text = SQUARE + "o a\nf 1 2 3\n g b\nf 1 3 4\no c\nf 2 3 4\n"
    scene = load(tmp_path, text, options=ReadOptions(split=split))
    assert [i.name for i in scene.instances] == names
    assert area(scene) == pytest.approx(1.5)


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "utf-16-be", "latin-1"])
def test_encodings_and_continued_lines(tmp_path, encoding):
    text = "mtllib m.mtl\no M\u00fchle\n" + SQUARE + "usemtl gr\u00fcn\nf 1 2 \\\r\n 3 4\n"
    mark = "\ufeff" if encoding == "utf-16-be" else ""
    (tmp_path / "m.mtl").write_bytes((mark + "newmtl gr\u00fcn\nKd 0 \\\n1 0\n").encode(encoding))
    scene = load(tmp_path, (mark + text).encode(encoding))
    assert scene.instances[0].name == "M\u00fchle"
    assert scene.materials[scene.meshes[0].material[0]].base_colour == (0, 1, 0, 1)
    assert area(scene) == pytest.approx(1)


def test_polygons_with_a_notch_are_cut_along_their_edges(tmp_path):
    corners = [(0, 0), (3, 0), (3, 3), (2, 3), (2, 1), (1, 1), (1, 3), (0, 3)]
    text = "".join(f"v {x} {y} 0\n" for x, y in corners) + "f 1 2 3 4 5 6 7 8\n"
    scene = load(tmp_path, text)
    # A U of area 7: triangles of a fan would cover the notch and overlap.
    assert area(scene) == pytest.approx(7)
    mesh = scene.meshes[0]
    middle = mesh.position[mesh.triangle].mean(axis=1)
    assert not ((np.abs(middle[:, 0] - 1.5) < 0.5) & (middle[:, 1] > 1)).any()


def opacity_of(tmp_path, statements):
    (tmp_path / "m.mtl").write_text("newmtl a\nKd 0.5 0.5 0.5\n" + statements)
    scene = load(tmp_path, "mtllib m.mtl\nusemtl a\n" + SQUARE + "f 1 2 3\n")
    return scene.materials[scene.meshes[0].material[0]], codes(scene)


def test_a_material_that_vanishes_is_told(tmp_path):
    for statements in ("Tr 1\n", "d 0\n"):
        material, told = opacity_of(tmp_path, statements)
        assert (material.base_colour[3], list(told)) == (0, ["invisible-material"])
    for statements in ("", "d 1\nTr 1\n", "d 1\nTr 0\n", "Tr 0\n"):
        material, told = opacity_of(tmp_path, statements)
        assert (material.base_colour[3], material.alpha_mode, told) == (1, "OPAQUE", {})


def test_map_d_is_the_alpha_of_the_base_colour(tmp_path):
    colours = np.uint8([[[10, 20, 30], [40, 50, 60]]])
    Image.fromarray(colours).save(tmp_path / "kd.png")
    Image.fromarray(np.uint8([[0], [255]])).save(tmp_path / "d.png")
    material, _ = opacity_of(tmp_path, "map_Kd kd.png\nmap_d d.png\nd 0.5\n")
    image = material.base_colour_texture.image
    np.testing.assert_array_equal(image[..., :3], np.repeat(colours, 2, axis=0))
    np.testing.assert_array_equal(image[..., 3], [[0, 0], [255, 255]])
    assert (material.base_colour[3], material.alpha_mode) == (0.5, "BLEND")
    material, _ = opacity_of(tmp_path, "map_d -clamp on d.png\n")
    np.testing.assert_array_equal(material.base_colour_texture.image[..., 3], [[0], [255]])
    assert material.base_colour_texture.wrap == ("clamp", "clamp")
    # If the image has alpha, its alpha is the opacity.
    Image.fromarray(np.uint8([[[9, 9, 9, 77]]])).save(tmp_path / "rgba.png")
    material, _ = opacity_of(tmp_path, "map_Kd rgba.png\nmap_d rgba.png\n")
    np.testing.assert_array_equal(material.base_colour_texture.image, [[[9, 9, 9, 77]]])
    with pytest.raises(InputError, match="different options"):
        opacity_of(tmp_path, "map_Kd kd.png\nmap_d -s 2 2 d.png\n")
