"""`world_geometry` gives instances the correct winding, normals and areas if mirrored or scaled."""

from __future__ import annotations

import numpy as np
import pytest
from tiny_scenes import Quad, grey, quad_atlas, quad_scene

from baker.core.atlas import Atlas, InstanceLayout
from baker.core.geometry import face_normals, world_geometry
from baker.core.scene import Instance, Mesh, Scene
from baker.core.texels import TexelBuffer


def ball(n=400, seed=0):
    """Return a convex mesh of n random vertices on the unit sphere, with smooth normals and outward faces."""
    from scipy.spatial import ConvexHull

    point = np.random.default_rng(seed).normal(size=(n, 3))
    point /= np.linalg.norm(point, axis=1, keepdims=True)
    triangle = ConvexHull(point).simplices
    corner = point[triangle]
    inwards = (
        np.einsum(
            "ij,ij->i", np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), corner[:, 0]
        )
        < 0
    )
    triangle[inwards] = triangle[inwards][:, ::-1]
    zero, row = np.zeros(len(triangle), np.int32), np.arange(n, dtype=np.int32)
    return Mesh(
        "ball",
        np.float32(point),
        np.float32(point),
        np.int32(triangle),
        zero,
        zero,
        np.zeros(n, np.int32),
        row,
    )


def placed(mesh, *matrices, split=False):
    instances = tuple(Instance(k, f"i{k}", 0, m) for k, m in enumerate(matrices))
    vertex = mesh.triangle.reshape(-1) if split else np.arange(len(mesh.position), dtype=np.int32)
    triangle = np.arange(len(vertex), dtype=np.int32).reshape(-1, 3) if split else mesh.triangle
    layouts = tuple(
        InstanceLayout(
            k,
            k,
            vertex,
            np.zeros((len(vertex), 2), np.float32),
            triangle,
            np.full(len(triangle), k, np.int32),
            False,
            1.0,
        )
        for k in range(len(instances))
    )
    scene = Scene("s", None, (mesh,), (grey(),), instances)
    return world_geometry(scene, Atlas(16, len(layouts), layouts, len(layouts), 1))


def matrix(scale, turn=0.0, shift=(0, 0, 0)):
    out = np.eye(4)
    c, s = np.cos(turn), np.sin(turn)
    out[:3, :3] = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) @ np.diag(scale)
    out[:3, 3] = shift
    return out


SCALES = [(1, 1, 1), (2, 0.3, 5), (-1, 1, 1), (1, -2, 0.5), (-1, -1, -1), (-3, -1, 1)]


@pytest.mark.parametrize("scale", SCALES)
def test_fronts_stay_outside(scale):
    mesh = ball()
    world = placed(mesh, matrix(scale, 0.7, (5, -2, 1)))
    centre = world.position[world.triangle].mean(axis=1) - [5, -2, 1]
    outwards = np.einsum("ij,ij->i", world.face_normal, centre)
    assert (outwards > 0).all()
    # With M = `linear`, the image of the unit sphere is the ellipsoid |M^-1 p|^2 = 1. Its normal is the
    # gradient of this equation, M^-T M^-1 p.
    linear = matrix(scale, 0.7)[:3, :3]
    object_point = (world.position - [5, -2, 1]) @ np.linalg.inv(linear).T
    truth = object_point @ np.linalg.inv(linear)
    truth /= np.linalg.norm(truth, axis=1, keepdims=True)
    np.testing.assert_allclose(world.normal, truth, atol=3e-5)
    agree = np.einsum("tca,ta->tc", world.normal[world.triangle], world.face_normal)
    assert (agree.mean(axis=1) > 0).all()
    np.testing.assert_allclose(np.linalg.norm(world.normal, axis=1), 1, atol=1e-6)
    # The signed volume is the volume of the mesh times the absolute product of the scales.
    a, b, c = world.position[world.triangle].astype(float).transpose(1, 0, 2)
    volume = np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6
    a, b, c = mesh.position[mesh.triangle].astype(float).transpose(1, 0, 2)
    truth = np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6 * abs(np.prod(scale))
    assert volume == pytest.approx(truth, rel=1e-4)


def test_split_vertices_stay_bitwise_together():
    mesh = ball(60)
    world = placed(mesh, matrix((1.1, 0.7, 1.3), 0.3, (100, 0, 0)), split=True)
    for vertex in range(60):
        same = world.position[world.vertex_source == vertex]
        assert (same == same[0]).all()


def test_columns_follow_the_instances():
    world = placed(ball(30), matrix((1, 1, 1)), matrix((-1, 1, 1), 0.0, (3, 0, 0)))
    half = len(world.triangle) // 2
    np.testing.assert_array_equal(world.instance, np.repeat([0, 1], half))
    np.testing.assert_array_equal(world.page, world.instance)
    np.testing.assert_array_equal(world.chart, world.instance)
    assert world.triangle[:half].max() < 30 <= world.triangle[half:].min()
    # Each triangle of the mirrored instance has the area of the same triangle in the other instance.
    np.testing.assert_allclose(world.area[half:], world.area[:half], rtol=1e-5)
    low, high = world.position.min(axis=0), world.position.max(axis=0)
    assert world.diagonal == pytest.approx(np.linalg.norm(high - low))


def test_face_normals():
    position = np.float32([[0, 0, 0], [2, 0, 0], [0, 3, 0], [4, 0, 0]])
    normal, area = face_normals(position, np.int32([[0, 1, 2], [2, 1, 0], [0, 1, 3], [0, 0, 0]]))
    np.testing.assert_allclose(normal, [[0, 0, 1], [0, 0, -1], [0, 0, 0], [0, 0, 0]])
    np.testing.assert_allclose(area, [3, 3, 0, 0])
    far = np.float32([[1e3, 1e3, 0], [1e3 + 1e-3, 1e3, 0], [1e3, 1e3 + 1e-3, 0]])
    assert face_normals(far, np.int32([[0, 1, 2]]))[0][0, 2] == 1


def test_materials_say_which_triangles_have_two_sides():
    scene = quad_scene(
        [
            Quad((0, 0, 0), (1, 0, 0), (0, 1, 0)),
            Quad((0, 0, 1), (1, 0, 0), (0, 1, 0), grey(double_sided=True)),
        ]
    )
    world = world_geometry(scene, quad_atlas(scene, 16))
    np.testing.assert_array_equal(world.double_sided, [False, False, True, True])
    np.testing.assert_array_equal(world.material, [0, 0, 1, 1])
    assert scene.n_triangles == 4


def test_a_scene_without_objects_gives_empty_arrays():
    world = world_geometry(Scene("s", None, (), (grey(),), ()), Atlas(16, 1, (), 0, 1))
    assert world.diagonal == 0.0
    assert world.triangle.shape == (0, 3)
    assert world.triangle.dtype == np.int32
    assert world.double_sided.shape == (0,)


def test_values_land_on_their_pixels():
    nothing = np.zeros(0, np.float32)
    pixel = np.int64([3, 0, 4 + 2, 3])
    texels = TexelBuffer(2, 2, 3, pixel, *[nothing] * (len(TexelBuffer.__dataclass_fields__) - 4))
    assert texels.n == 4
    image = texels.page_image(np.float32([[1, 2], [3, 4], [5, 6]]), fill=-1)
    truth = np.full((2, 2, 2, 2), -1.0)
    truth[0, 1, 1], truth[0, 0, 0], truth[1, 1, 0] = [1, 2], [3, 4], [5, 6]
    np.testing.assert_array_equal(image, truth)
    assert texels.page_image(np.int32([1, 2, 3])).dtype == np.int32
