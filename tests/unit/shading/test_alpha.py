"""The hit filter accepts a hit with a probability equal to the opacity at the hit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from inner import compiled
from packet_driver import cast
from tiny_scenes import Quad, grey, quad_scene

from baker.core.atlas import Atlas, InstanceLayout
from baker.core.geometry import world_geometry
from baker.core.scene import Texture
from baker.kernels.alpha import CUTOFF, opacity_at
from baker.kernels.textures import PackImage, pack_textures, sample_alpha, sample_texture
from baker.shading.alpha import hit_filter
from baker.shading.materials import resolve_materials
from baker.trace.embree import RayScene

opacity_at, sample_alpha, sample_texture = compiled(opacity_at, sample_alpha, sample_texture)


def shaded(quads):
    """Return the geometry and shading of quads. Their lightmap uv overlap, because no test reads them."""
    scene = quad_scene(quads)
    row, square = np.arange(4, dtype=np.int32), np.float32([[0, 0], [1, 0], [1, 1], [0, 1]])
    layouts = [
        InstanceLayout(k, 0, row, square, mesh.triangle, np.zeros(2, np.int32), True, 1.0)
        for k, mesh in enumerate(scene.meshes)
    ]
    geometry = world_geometry(scene, Atlas(8, 1, tuple(layouts), 1, 1))
    return geometry, resolve_materials(scene, geometry)


def sheet(mode, alpha, z=0.0, image=None, **changes):
    """Return a unit square at z that faces +z. `image` (H, W) is the alpha of its texture."""
    texture = None
    if image is not None:
        rgba = np.ones((*np.shape(image), 4), np.float32)
        rgba[..., 3] = image
        texture = Texture(rgba)
    material = replace(
        grey(), base_colour=(0.5, 0.5, 0.5, alpha), base_colour_texture=texture, alpha_mode=mode, **changes
    )
    return Quad((0, 0, z), (1, 0, 0), (0, 1, 0), material)


def tree(quads):
    geometry, shading = shaded(quads)
    see = hit_filter(shading)
    return RayScene(geometry.position, geometry.triangle, threads=1, hit_filter=see), shading


def downward(n, seed=0, height=5.0):
    rng = np.random.default_rng(seed)
    origin = np.float32(np.column_stack([rng.uniform(0.01, 0.99, (n, 2)), np.full(n, height)]))
    return origin, np.float32(np.tile([0, 0, -1], (n, 1)))


def test_alpha_lookup_is_that_of_the_whole_texture():
    rng = np.random.default_rng(1)
    images = [
        (np.float32(rng.random((5, 7, 4))), ("repeat", "mirror")),
        (np.float32(rng.random((1, 3, 4))), ("clamp", "repeat")),
        (np.float32(rng.random((4, 1, 4))), ("mirror", "clamp")),
        (rng.integers(0, 256, (3, 8, 4)).astype(np.uint8), ("repeat", "repeat")),
    ]
    pack, rgba = pack_textures([PackImage(*image) for image in images]), np.zeros(4)
    for k in range(4):
        for u, v in rng.uniform(-3, 3, (200, 2)):
            sample_texture(pack, k, u, v, 0.0, rgba)
            found = sample_alpha(pack, k, u, v)
            assert found == pytest.approx(rgba[3], abs=1e-9)


def test_only_triangles_that_let_light_through_are_chosen():
    opaque = np.ones((2, 2))
    quads = [
        sheet("OPAQUE", 0.0),
        sheet("BLEND", 1.0),
        sheet("BLEND", 1.0, image=opaque),
        sheet("MASK", 0.5, alpha_cutoff=0.5),
        sheet("MASK", 1.0, image=opaque, alpha_cutoff=1.0),
        sheet("MASK", 0.49, alpha_cutoff=0.5),
        sheet("BLEND", 0.9),
        sheet("BLEND", 1.0, image=opaque * 0.99),
    ]
    _, shading = shaded(quads)
    assert (shading.alpha.slot >= 0).tolist() == [k >= 5 for k in range(8) for _ in range(2)]
    assert shading.alpha.row[:, CUTOFF].tolist() == [0.5, 0.5, -1, -1, -1, -1]
    _, nothing = shaded(quads[:5])
    assert len(nothing.alpha.slot) == 0
    assert hit_filter(nothing) is None


def test_opacity_is_factor_times_texture_times_vertex_colour():
    image = np.array([[0.2, 0.4], [0.6, 0.8]])
    quad = replace(
        sheet("BLEND", 0.5, image=image), colour=np.float32([[1, 1, 1, a] for a in (1, 0.5, 0, 0.5)])
    )
    _, shading = shaded([quad])
    # The corners of triangle 0 have the uv (0, 0), (1, 0) and (1, 1). Therefore b1 = 0.25 and b2 = 0.5 are at
    # uv (0.75, 0.5).
    vertex = 0.25 * 1 + 0.25 * 0.5 + 0.5 * 0
    assert opacity_at(shading, 0, 0.25, 0.5) == pytest.approx(0.5 * vertex * (0.4 + 0.8) / 2, abs=1e-6)


def test_a_texture_of_one_value_meets_its_cutoff_everywhere():
    image = np.full((3, 3), 0.3)
    image[0, 0] = 0.0
    rays, _ = tree([sheet("MASK", 1.0, image=image, alpha_cutoff=float(np.float32(0.3)))])
    origin, direction = downward(4000)
    hit = cast(rays, origin, direction)[0] >= 0
    # Bilinear lookups read pixel (0, 0) within a pixel's width of its centre. As the texture repeats, they
    # also read it at the opposite sides.
    near = (np.abs(origin[:, :2] * 3 - 0.5) % 3 < 1.0).all(axis=1)
    far = ((origin[:, :2] * 3 > 2.5) | (np.abs(origin[:, :2] * 3 - 0.5) < 1.0)).all(axis=1)
    assert hit[~near & ~far].all()
    assert not hit[near].any()


def test_each_texture_of_a_scene_keeps_its_own_wrap_mode():
    """Near the left edge, a lookup reads only the left texel with clamp, and both texels with repeat."""
    quads = []
    for z, wrap in enumerate([("repeat", "repeat"), ("repeat", "repeat"), ("clamp", "clamp")]):
        quad = sheet("MASK", 1.0, z, image=[[0, 1]], alpha_cutoff=0.3)
        texture = replace(quad.material.base_colour_texture, wrap=wrap)
        quads.append(replace(quad, material=replace(quad.material, base_colour_texture=texture)))
    rays, _ = tree(quads)
    for z, left in enumerate([True, True, False]):
        origin = np.float32([[0.02, 0.5, z + 0.5], [0.98, 0.5, z + 0.5]])
        hit = cast(rays, origin, np.float32([[0, 0, -1]] * 2), far=1.0)[0] >= 0
        assert hit.tolist() == [left, True]


@pytest.mark.parametrize("alpha", [0.1, 0.5, 0.93])
def test_blend_counts_with_probability_alpha_alone_and_in_layers(alpha):
    n = 40000
    rays, _ = tree([sheet("BLEND", alpha, z) for z in (0.0, 1.0, 2.0)])
    origin, direction = downward(n)
    geom, prim, *_ = cast(rays, origin, direction)
    layer = np.where(geom >= 0, prim // 2, -1)
    for k, expected in (
        (2, alpha),
        (1, alpha * (1 - alpha)),
        (0, alpha * (1 - alpha) ** 2),
        (-1, (1 - alpha) ** 3),
    ):
        error = np.sqrt(expected * (1 - expected) / n)
        assert (layer == k).mean() == pytest.approx(expected, abs=4 * error)
    # Whether a ray is stopped is independent of its position and of the previous ray.
    stopped = (layer == 2).astype(float) - alpha
    limit = 4 / np.sqrt(n)
    for other in (origin[:, 0] - 0.5, origin[:, 1] - 0.5, np.roll(stopped, 1)):
        assert abs(np.corrcoef(stopped, other)[0, 1]) < limit


def test_the_answer_does_not_depend_on_the_packet():
    rays, _ = tree([sheet("BLEND", 0.5, z) for z in (0.0, 1.0)])
    rng = np.random.default_rng(2)
    origin, direction = downward(3001)
    direction[:, :2] += np.float32(rng.normal(0, 0.02, (len(direction), 2)))
    first = cast(rays, origin, direction, width=16)
    order = rng.permutation(len(origin))
    for width in (4, 8, 16):
        geom, prim, *_ = cast(rays, origin[order], direction[order], width=width)
        assert (geom == first[0][order]).all()
        hit = geom >= 0
        assert (prim == first[1][order])[hit].all()
        dark = cast(rays, origin[order], direction[order], width=width, occluded=True)[4] < 0
        assert (dark == hit).all()


def test_a_shared_edge_is_decided_once():
    """A pane stops the share alpha of rays through its diagonal, although they hit two triangles."""
    n = 20000
    x = np.random.default_rng(5).integers(1, 2**16, n) / np.float64(2**16)
    origin = np.float32(np.column_stack([x, x, np.full(n, 5.0)]))
    for panes in (1, 2):
        rays, _ = tree([sheet("BLEND", 0.5, z) for z in range(panes)])
        stopped = (cast(rays, origin, np.tile([0, 0, -1], (n, 1)))[0] >= 0).mean()
        expected = 1 - 0.5**panes
        assert stopped == pytest.approx(expected, abs=4 * np.sqrt(expected * (1 - expected) / n))
