"""The transmittance along shadow rays is a deterministic product over crossings, each counted once."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scenes import icosphere
from test_alpha import shaded, sheet
from test_transmittance_filter import COLOUR, pane
from tiny_scenes import Quad, box_quads, grey, quad_scene

from baker.core.atlas import Atlas, InstanceLayout
from baker.core.geometry import world_geometry
from baker.core.scene import Instance, Mesh
from baker.kernels.alpha import SURFACE
from baker.radiosity.kernels.shadow import add_visible
from baker.shading.materials import resolve_materials
from baker.shading.ray_tree import build_ray_tree
from baker.trace.packets import PACKET_WIDTH, new_packet_buffers


def passed(colour, alpha):
    return (1 - alpha) * (1 - alpha * (1 - np.asarray(colour, float)))


def mesh_scene(*parts):
    """Return geometry and shading of meshes (position (V, 3), triangle (T, 3)) with `pane`'s material."""
    material = pane().material
    quad = quad_scene([Quad((0, 0, 0), (1, 0, 0), (0, 1, 0), material)])
    meshes, instances, layouts = [], [], []
    for k, (position, triangle) in enumerate(parts):
        position, triangle = np.float32(position), np.int32(triangle)
        n, t = len(position), len(triangle)
        up = np.tile(np.float32([0, 0, 1]), (n, 1))
        zero = np.zeros(t, np.int32)
        meshes.append(
            Mesh(
                f"m{k}",
                position,
                up,
                triangle,
                zero,
                zero,
                np.zeros(n, np.int32),
                np.arange(n, dtype=np.int32),
            )
        )
        instances.append(Instance(k, f"i{k}", k, np.eye(4)))
        uv = np.zeros((n, 2), np.float32)
        layouts.append(InstanceLayout(k, 0, np.arange(n, dtype=np.int32), uv, triangle, zero, True, 1.0))
    scene = replace(quad, meshes=tuple(meshes), instances=tuple(instances))
    geometry = world_geometry(scene, Atlas(8, 1, tuple(layouts), 1, 1))
    return geometry, resolve_materials(scene, geometry)


def visible(world, origin, direction, far=1e30):
    """Return the transmittance (n, 3) along n rays. It is 0 if a ray is blocked."""
    n = len(origin)
    count = -(-n // 16)
    row = np.zeros((count * 16, 3), np.float32), np.zeros((count * 16, 4), np.float32)
    row[0][:n], row[1][:n, :3], row[1][:, 3] = origin, direction, far
    weight = (np.arange(count * 16) < n).astype(np.float32).reshape(count, 16)
    found = []
    rays = build_ray_tree(*world, threads=1)
    # `add_visible` averages over the 16 points of a texel, so each call has only one point with a weight.
    for k in range(16):
        only, out = weight * (np.arange(16) == k), np.zeros((count, 6), np.float32)
        origins, ways = row[0].reshape(count, 16, 3), row[1].reshape(count, 16, 4)
        add_visible(new_packet_buffers(rays.tracer), origins, ways, only, np.ones(3, np.float32), out)
        np.testing.assert_array_equal(out[:, :3], out[:, 3:])
        found.append(out[:, :3] * 16)
    return np.stack(found, axis=1).reshape(-1, 3)[:n]


def down(n=400, seed=0, diagonal=False):
    rng = np.random.default_rng(seed)
    where = rng.integers(1, 2**14, (n, 2)) / 2.0**14
    where[:, 1] = where[:, 0] if diagonal else where[:, 1]
    return np.column_stack([where, np.full(n, 5.0)]), np.tile([0.0, 0, -1], (n, 1))


@pytest.mark.parametrize("diagonal", [False, True])
def test_transmittance_is_the_product_over_panes(diagonal):
    panes = [(COLOUR, 0.5), ((1, 1, 1), 0.9), ((0.2, 0.4, 1.0), 0.25), ((0, 0, 0), 0.6)]
    world = shaded([pane(0.5 * k, c, a) for k, (c, a) in enumerate(panes)])
    for n in range(1, 5):
        # Rays start at z = 5, and pane k lies at z = k / 2. The rays end 0.25 m behind the n-th pane.
        found = visible(world, *down(diagonal=diagonal), far=5.0 - 0.5 * (4 - n) + 0.25)
        crossed = panes[4 - n :]
        np.testing.assert_allclose(found[0], np.prod([passed(*p) for p in crossed], axis=0), rtol=1e-5)
        assert np.ptp(found, axis=0).max() == 0


def test_walls_and_masks_block_and_holes_do_not():
    wall = Quad((0, 0, -1), (1, 0, 0), (0, 1, 0), grey())
    assert (visible(shaded([pane(), wall]), *down()) == 0).all()
    leaf = sheet("MASK", 0.6, -1.0, alpha_cutoff=0.5)
    assert (visible(shaded([pane(), leaf]), *down()) == 0).all()
    hole = sheet("MASK", 0.4, -1.0, alpha_cutoff=0.5)
    np.testing.assert_allclose(visible(shaded([pane(), hole]), *down())[:, 0], 0.5, rtol=1e-6)
    np.testing.assert_allclose(visible(shaded([hole]), *down()), 1.0, rtol=1e-6)


def grid(n, z=0.0):
    """Return vertices and triangles of a unit square at z: 2 n^2 triangles that share vertices."""
    x = np.linspace(0, 1, n + 1)
    position = np.array([[a, b, z] for a in x for b in x])
    corner = np.array([[i * (n + 1) + k for k in range(n)] for i in range(n)]).reshape(-1, 1)
    first, second = corner + np.array([0, n + 1, n + 2]), corner + np.array([0, n + 2, 1])
    return position, np.concatenate([first, second])


def split(position, triangle):
    """Return the mesh with separate vertices for each triangle."""
    corner = np.asarray(triangle).reshape(-1)
    return np.asarray(position)[corner], np.arange(len(corner)).reshape(-1, 3)


def joined(*parts):
    offset = np.cumsum([0, *[len(p) for p, _ in parts]])
    return np.concatenate([p for p, _ in parts]), np.concatenate(
        [np.asarray(t) + o for (_, t), o in zip(parts, offset, strict=False)]
    )


SHARE = passed(COLOUR, 0.5)
LATTICE = np.array([[i, k] for i in range(1, 16) for k in range(1, 16)]) / 16


@pytest.mark.parametrize("separate", [False, True])
def test_edges_and_vertices_count_once(separate):
    """Rays pass exactly through the vertices and edges of a grid of 8 x 8 squares."""
    mesh = grid(8)
    world = mesh_scene(split(*mesh) if separate else mesh)
    origin = np.column_stack([LATTICE, np.full(len(LATTICE), 4.0)])
    found = visible(world, origin, np.tile([0.0, 0, -1], (len(origin), 1)))
    np.testing.assert_allclose(found, np.tile(SHARE, (len(found), 1)), rtol=1e-6)
    # Rays from one point to the same vertices and edges, with coordinates that float32 rounds.
    light = np.array([0.37, 0.41, 3.0])
    way = np.column_stack([LATTICE, np.zeros(len(LATTICE))]) - light
    found = visible(world, np.tile(light, (len(way), 1)), way, far=2.0)
    np.testing.assert_allclose(found, np.tile(SHARE, (len(found), 1)), rtol=1e-6)


@pytest.mark.parametrize(
    ("parts", "crossings"),
    [
        ([grid(4), grid(4)], 2),
        ([joined(grid(4), grid(4))], 2),
        ([joined(grid(4), (grid(4)[0], grid(4)[1][:, ::-1]))], 2),
        ([joined(grid(4), grid(4), grid(4))], 3),
        ([joined(grid(4), grid(4, 0.001))], 2),
        ([joined(*[grid(4, 0.01 * k) for k in range(12)])], 12),
    ],
    ids=["two objects", "one mesh", "two faces", "three layers", "1 mm apart", "twelve panes"],
)
def test_layers_count_each(parts, crossings):
    """Rays cross coincident or nearby panes in faces, edges and vertices. Each pane counts once."""
    world = mesh_scene(*parts)
    where = np.concatenate([LATTICE, LATTICE * 0.9 + 0.03])
    origin = np.column_stack([where, np.full(len(where), 4.0)])
    found = visible(world, origin, np.tile([0.0, 0, -1], (len(origin), 1)))
    np.testing.assert_allclose(found, np.tile(SHARE**crossings, (len(found), 1)), rtol=1e-5)


def test_a_thin_box_is_two_surfaces():
    """A ray crosses a closed box of 1 mm thickness twice, even through the diagonals of its faces."""
    position = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 0.001)], float)
    face = [[0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3], [0, 4, 5], [0, 5, 1]]
    face += [[2, 3, 7], [2, 7, 6], [0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5]]
    world = mesh_scene((position, face))
    for diagonal in (False, True):
        found = visible(world, *down(diagonal=diagonal))
        np.testing.assert_allclose(found, np.tile(SHARE**2, (len(found), 1)), rtol=1e-5)


def test_connected_triangles_are_one_surface():
    geometry, shading = mesh_scene(split(*grid(3)), joined(grid(2), grid(2, 1.0), grid(2)), grid(1))
    number = shading.alpha.row[:, SURFACE]
    assert len(number) == len(geometry.triangle)
    runs = np.split(number, np.cumsum([18, 8, 8, 8]))
    assert [len(set(run.tolist())) for run in runs] == [1] * 5
    assert len(set(number.tolist())) == 5


def test_a_gradient_is_looked_up_where_each_ray_passes():
    image = np.repeat(np.linspace(0.0, 1.0, 64)[None], 2, axis=0)
    origin, way = down(600)
    found = visible(shaded([sheet("BLEND", 0.8, image=image)]), origin, way)
    # Alpha rises linearly from the first texel centre, at 0.5 / 64, to the last. The colour is a grey of 0.5.
    alpha = 0.8 * np.clip((origin[:, 0] * 64 - 0.5) / 63, 0, 1)
    inside = (origin[:, 0] > 1 / 64) & (origin[:, 0] < 63 / 64)
    truth = (1 - alpha) * (1 - 0.5 * alpha)
    np.testing.assert_allclose(found[inside, 0], truth[inside], rtol=1e-4)


def test_a_pane_seen_edge_on_is_crossed_by_nothing():
    """Rays parallel to a pane, 0.1 mm above it, do not cross the pane."""
    origin = np.column_stack([np.full(50, -1.0), np.linspace(0.1, 0.9, 50), np.full(50, 1e-4)])
    along = np.tile([1.0, 0, 0], (50, 1))
    assert (visible(shaded([pane()]), origin, along) == 1).all()


def test_fifty_cards_multiply_light_without_randomness():
    cards = [pane(0.05 * k, (0.9, 1.0, 0.8), 0.1) for k in range(50)]
    found = visible(shaded(cards), *down(PACKET_WIDTH * 16))
    np.testing.assert_allclose(found[0], passed((0.9, 1.0, 0.8), 0.1) ** 50, rtol=1e-4)
    assert np.ptp(found, axis=0).max() == 0
    # If the transmittance is almost zero, the ray counts as blocked.
    assert (visible(shaded([pane(0.05 * k, alpha=0.9) for k in range(50)]), *down()) == 0).all()


def test_each_crossing_counts_once_for_rays_of_all_directions():
    """Compare with a loop over all triangles.

    With Embree's coherent flag, the filter would be called once for each octant of ray directions.
    """
    rng = np.random.default_rng(7)
    corner = rng.uniform(-1, 1, (300, 1, 3)) + rng.uniform(-0.5, 0.5, (300, 3, 3))
    world = mesh_scene((corner.reshape(-1, 3), np.arange(900).reshape(-1, 3)))
    origin, way = rng.uniform(-1, 1, (640, 3)), rng.normal(size=(640, 3))
    corner = world[0].position[world[0].triangle].astype(float)
    # Moeller-Trumbore intersection of all rays with all triangles.
    a, b = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
    p = np.cross(way[:, None], b[None])
    det = (p * a).sum(-1)
    s = np.float32(origin)[:, None] - corner[:, 0]
    q = np.cross(s, a)
    u, v, t = (p * s).sum(-1) / det, (q * way[:, None]).sum(-1) / det, (q * b).sum(-1) / det
    crossing = ((u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0) & (t < 1.5)).sum(axis=1)
    assert crossing.max() > 6
    found = visible(world, origin, way, far=1.5)
    wrong = abs(found / SHARE ** crossing[:, None] - 1).max(axis=1) > 1e-4
    assert wrong.sum() <= 1  # by rounding, one ray near an edge may hit or miss


def test_a_sphere_is_left_once_and_crossed_twice():
    """Rays from the centre of a sphere cross it once, rays from outside cross it twice.

    The rays pass through vertices and edge midpoints.
    """
    corner = icosphere(2)
    world = mesh_scene((corner.reshape(-1, 3), np.arange(3 * len(corner)).reshape(-1, 3)))
    aim = np.concatenate([corner.reshape(-1, 3), 0.5 * (corner + np.roll(corner, 1, axis=1)).reshape(-1, 3)])
    aim = np.float32(aim).astype(float)
    found = visible(world, np.zeros_like(aim), aim)
    np.testing.assert_allclose(found, np.tile(SHARE, (len(aim), 1)), rtol=1e-5)
    found = visible(world, -2.0 * aim, aim)
    np.testing.assert_allclose(found, np.tile(SHARE**2, (len(aim), 1)), rtol=1e-5)


def test_a_wall_that_a_pane_passes_through_still_blocks():
    """A wall intersects a pane. Rays through the wall are blocked, rays beside it cross the pane once."""
    wall = Quad((0.5, 0, -1), (0, 1, 0), (0, 0, 2), grey())
    world = shaded([Quad((0, 0, 0), (1, 0, 0), (0, 1, 0), pane().material), wall])
    origin, _ = down(200)
    along = np.tile([0.0, 0.3, -5.0], (200, 1))
    np.testing.assert_allclose(visible(world, origin - along, 2 * along)[0], SHARE, rtol=1e-5)
    # These rays end on the other side of the wall.
    across = np.column_stack([1.0 - 2.0 * origin[:, 0], np.zeros(200), np.full(200, -1.0)])
    crossing = visible(world, origin * [1, 1, 0.1], across, far=1.0)
    assert (crossing[origin[:, 0] != 0.5] == 0).all()


def test_a_box_of_glass_is_left_once_from_within():
    walls = box_quads((-1, -1, -1), (1, 1, 1), inward=False, material=pane().material)
    rng = np.random.default_rng(3)
    way = rng.normal(size=(500, 3))
    found = visible(
        shaded(walls), rng.uniform(-0.5, 0.5, (500, 3)), way / np.linalg.norm(way, axis=1)[:, None]
    )
    np.testing.assert_allclose(found, np.tile(SHARE, (500, 1)), rtol=1e-6)
