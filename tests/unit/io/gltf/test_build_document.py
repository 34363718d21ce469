"""For scenes that do not come from a glTF file, `scene.glb` is loaded and compared with the scene."""

from __future__ import annotations

import io
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from glb_reader import Glb
from io_scenes import make_atlas, split_layout
from PIL import Image

from baker.core.scene import Instance, Material, Mesh, PunctualLight, Scene, Texture
from baker.io.gltf.write_baked import make_glb
from baker.io.load import load_scene
from baker.io.png import encode_png

TEXTURE = Texture(
    np.random.default_rng(2).integers(0, 256, (4, 6, 4)).astype(np.uint8),
    transform=np.array([[0.0, 2.0, 0.25], [-3.0, 0.0, 0.5]]),
    wrap=("clamp", "mirror"),
)


def two_material_mesh() -> Mesh:
    position = np.float32([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    return Mesh(
        name="board",
        position=position,
        normal=np.float32([[0, 0, 1]] * 4),
        triangle=np.int32([[0, 1, 2], [0, 2, 3]]),
        material=np.int32([1, 0]),
        primitive=np.zeros(2, np.int32),
        vertex_primitive=np.zeros(4, np.int32),
        source_vertex=np.arange(4, dtype=np.int32),
        texcoord=(position[:, :2].copy(), None),
    )


def scene_of(*matrices: np.ndarray, lights: tuple[PunctualLight, ...] = ()) -> Scene:
    materials = (
        Material("paint", (0.5, 0.25, 1.0, 1.0), TEXTURE, double_sided=True, metallic=0.0),
        Material("lamp", emission=(10.0, 20.0, 5.0)),
    )
    # Instance k has the node count - 1 - k, so that the order of instances differs from that of nodes.
    count = len(matrices)
    instances = tuple(Instance(count - 1 - k, f"i{k}", 0, m) for k, m in enumerate(matrices))
    return Scene("hand-made", None, (two_material_mesh(),), materials, instances, lights)


def write(scene: Scene) -> Glb:
    atlas = make_atlas(*(split_layout(scene, k) for k in range(len(scene.instances))))
    return Glb(make_glb(scene, atlas, {0: encode_png(np.zeros((4, 4), np.uint8))}).data)


def world_corners(glb: Glb, node: int) -> np.ndarray:
    item = glb.json["nodes"][node]
    matrix = np.array(item.get("matrix", np.eye(4).ravel())).reshape(4, 4).T
    corners = [glb.corners(p, "POSITION") for p in glb.json["meshes"][item["mesh"]]["primitives"]]
    return np.concatenate(corners) @ matrix[:3, :3].T + matrix[:3, 3]


def signed_areas(corner: np.ndarray) -> np.ndarray:
    return np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])


def test_nodes_stand_where_instances_stand() -> None:
    turn = np.array([[0, -2, 0, 5], [2, 0, 0, 6], [0, 0, 2, 7], [0, 0, 0, 1]], np.float64)
    after = write(scene_of(np.eye(4), turn))
    assert [n["name"] for n in after.json["nodes"]] == ["i1", "i0"]
    found = {tuple(p) for p in world_corners(after, 0).reshape(-1, 3).tolist()}
    assert found == {(5, 6, 7), (5, 8, 7), (3, 8, 7), (3, 6, 7)}


@pytest.mark.parametrize("mirror", [1.0, -1.0])
def test_a_sheared_instance_is_moved_into_the_world_and_faces_the_same_way(mirror: float) -> None:
    shear = np.eye(4)
    shear[0, 1], shear[1, 1] = 0.5, mirror
    after = write(scene_of(shear))
    assert "matrix" not in after.json["nodes"][0], "a glTF node cannot shear"
    corner = world_corners(after, 0)
    assert {tuple(p) for p in corner.reshape(-1, 3).tolist()} == {
        (0, 0, 0), (1, 0, 0), (1.5, mirror, 0), (0.5, mirror, 0),
    }  # fmt: skip
    normals = [after.corners(p, "NORMAL") for p in after.json["meshes"][0]["primitives"]]
    assert (signed_areas(corner)[:, 2] * np.concatenate(normals)[:, 0, 2] > 0).all()


def test_materials_and_textures_read_back_as_they_were(tmp_path: Path) -> None:
    scene = scene_of(np.eye(4))
    (tmp_path / "a.glb").write_bytes(make_glb(scene, make_atlas(split_layout(scene, 0)), None).data)
    again = load_scene(tmp_path / "a.glb")
    assert [m.name for m in again.materials] == ["paint", "lamp"]
    paint, emitting = again.materials
    assert paint.base_colour == (0.5, 0.25, 1.0, 1.0)
    assert paint.double_sided
    assert emitting.emission == pytest.approx((10.0, 20.0, 5.0), rel=1e-12)
    texture = paint.base_colour_texture
    assert texture is not None
    assert np.array_equal(texture.image, TEXTURE.image)
    assert texture.wrap == TEXTURE.wrap
    assert texture.transform == pytest.approx(TEXTURE.transform, abs=1e-12)
    areas = {again.materials[m].name for m in again.meshes[0].material}
    assert areas == {"paint", "lamp"}


def test_a_linear_float_texture_is_stored_as_srgb() -> None:
    linear = np.float32([[[0.0, 0.002, 0.21586, 1.0], [1.0, 0.5, 2.0, 0.5]]])
    scene = scene_of(np.eye(4))
    paint = replace(scene.materials[0], base_colour_texture=Texture(linear))
    after = write(replace(scene, materials=(paint, scene.materials[1])))
    image = Image.open(io.BytesIO(after.view(after.json["images"][0]["bufferView"])))
    # 0.21586 is the linear value of sRGB 128. 0.002 is in sRGB's linear segment: 0.002 * 12.92 * 255 = 6.6.
    assert np.asarray(image).tolist() == [[[0, 7, 128, 255], [255, 188, 255, 128]]]


@pytest.mark.parametrize(
    "direction", [(0, 0, -1), (0, 0, 1), (0, -1, 0), (0.6, 0.0, 0.8), (-0.48, 0.6, -0.64)]
)
def test_lights_read_back_as_they_were(tmp_path: Path, direction: tuple[float, float, float]) -> None:
    light = PunctualLight("spot", "lamp", 1, (3.0, 2.0, 1.0), (1.0, 2.0, 3.0), direction, 0.25, 0.5)
    scene = scene_of(np.eye(4), lights=(light, replace(light, kind="directional")))
    (tmp_path / "a.glb").write_bytes(make_glb(scene, make_atlas(split_layout(scene, 0)), None).data)
    spot, sun = load_scene(tmp_path / "a.glb").lights
    assert (spot.kind, sun.kind) == ("spot", "directional")
    assert spot.intensity == pytest.approx(light.intensity, rel=1e-12)
    assert spot.position == pytest.approx(light.position)
    assert spot.direction == pytest.approx(direction, abs=1e-12)
    assert sun.direction == pytest.approx(direction, abs=1e-12)
    assert (spot.inner_cone, spot.outer_cone) == (0.25, 0.5)
