"""Gather, AO, light samples and shadow rays agree with Python loops over rays in a small room."""

from __future__ import annotations

import naive
import numpy as np
import pytest
from inner import compiled
from tiny_scenes import Quad, box_quads, grey, quad_scene, quad_world, seen_light

from baker.core.lightmap import TexelStatus
from baker.core.scene import Material, PunctualLight
from baker.core.settings import make_settings
from baker.core.stage import Stage
from baker.kernels.emitters import emitter_density, tile_emitters
from baker.kernels.rays import lane_seeds
from baker.kernels.sampling import shared_bits_mask, sobol_reversed, texel_scramble
from baker.kernels.surface import N_POINTS
from baker.pipeline.bake import bake
from baker.radiosity.direct import direct_light
from baker.radiosity.final_gather import ambient_occlusion, final_gather
from baker.radiosity.kernels.gather import (
    DIRECT,
    INDIRECT,
    N_COLUMNS,
    OPEN,
    SQUARE,
    estimate_occlusion,
    gather,
)
from baker.radiosity.kernels.shadow import add_visible
from baker.radiosity.point_cache import points_of
from baker.trace.packets import new_packet_buffers

emitter_density, lane_seeds, texel_scramble = compiled(emitter_density, lane_seeds, texel_scramble)

SKY = np.float32([0.5, 1.0, 2.0])
REACH = 0.7


@pytest.fixture(scope="module")
def room():
    """Return the world of a room without a ceiling, with an emitter and a two-sided board in it."""
    quads = [q for k, q in enumerate(box_quads((0, 0, 0), (2, 1.5, 2), inward=True)) if k != 3]
    quads += [
        Quad((0.5, 1.2, 0.6), (0.6, 0, 0), (0, 0, 0.5), grey(0.1, 4.0)),
        Quad((1.4, 0.1, 0.3), (0.3, 0, 0.5), (0, 0.8, 0), grey(0.7, 0.5, double_sided=True)),
    ]
    return quad_world(quads, 24, inset=0.2)


@pytest.fixture(scope="module")
def rays_of(room):
    """Return the inputs of `gather` for 23 texels, and the result computed ray by ray in Python."""
    n_samples, n_light = 64, 23
    net, shared = sobol_reversed(n_samples, 0, 6), shared_bits_mask(n_samples)
    # The tile does not begin at texel 0, and its 23 texels are not a multiple of the packet width.
    begin, end = 40, 63
    origin, normal = points_of(room.surface, room.free, np.arange(begin, end))
    exitance = np.random.default_rng(0).random((room.texels.n, 4), np.float32)
    truth = np.zeros((end - begin, N_COLUMNS))
    emitters = tile_emitters(room.emitters, origin)
    corner = room.geometry.uv[room.geometry.triangle]
    entry_at = room.texels.hit_image(np.arange(room.texels.n), -1)
    seeds = np.zeros(32, np.uint32)
    emitter_of = {int(t): m for m, t in enumerate(room.emitters.triangle)}
    for i in range(end - begin):
        lane_seeds(begin + i, 1, 25, seeds)
        batch = np.zeros(N_POINTS)
        for s in range(n_samples):
            k = s * N_POINTS // n_samples
            u, v = (texel_scramble(net[s, a], seeds[16 * a], shared) for a in (0, 1))
            direction = naive.frame(normal[i, k]) @ naive.cosine_direction(float(u), float(v))
            t, prim = naive.intersect(room.geometry.position, room.geometry.triangle, origin[i, k], direction)
            truth[i, OPEN] += (t > REACH) / n_samples
            got, indirect = np.zeros(3), np.zeros(3)
            if prim < 0:
                got = SKY.astype(float)
            else:
                front = direction @ room.geometry.face_normal[prim] < 0
                m = emitter_of.get(prim)
                if m is not None and (front or room.geometry.double_sided[prim]):
                    # Balance heuristic: the density of hemisphere rays in this direction, divided by that of
                    # all rays.
                    radiance = room.shading.emission[room.geometry.material[prim]]
                    cosine, facing = (
                        direction @ normal[i, k],
                        abs(direction @ room.geometry.face_normal[prim]),
                    )
                    area = float(emitter_density(emitters.row, emitters.chance, emitters.cumulative, m))
                    by_light, by_cosine = n_light * area * t * t / facing, n_samples * cosine / np.pi
                    got = radiance * by_cosine / (by_light + by_cosine)
                b1, b2 = naive.barycentric(
                    room.geometry.position[room.geometry.triangle[prim]], origin[i, k] + t * direction
                )
                pixel = naive.hit_pixel(
                    corner, room.geometry.page, room.geometry.double_sided, 24, 1, prim, b1, b2, front
                )
                entry = entry_at[pixel] if pixel >= 0 else -1
                if entry >= 0:
                    indirect = exitance[entry, :3].astype(float) / np.pi
            truth[i, DIRECT : DIRECT + 3] += got * np.pi / n_samples
            truth[i, INDIRECT : INDIRECT + 3] += indirect * np.pi / n_samples
            batch[k] += (got + indirect).sum() * np.pi / n_samples
        truth[i, SQUARE] = (batch**2).sum()
    return net, shared, begin, origin, normal, seen_light(room.texels, exitance), emitters, n_light, truth


def test_gather_is_the_sum_over_its_rays(room, rays_of):
    net, shared, begin, origin, normal, exitance, emitters, n_light, truth = rays_of
    ours = np.zeros((len(origin), N_COLUMNS), np.float32)
    gather(
        origin,
        normal,
        room.table,
        exitance,
        emitters,
        room.shading,
        new_packet_buffers(room.rays.tracer),
        begin,
        net,
        shared,
        SKY,
        np.array([REACH, n_light], np.float64),
        np.zeros(len(origin), np.uint8),
        ours,
    )
    # By rounding, a hit on the border between two texels may be assigned to either texel.
    differs = np.abs(ours - truth) > 2e-4 * (1 + np.abs(truth))
    assert differs[:, INDIRECT : INDIRECT + 3].any(axis=1).sum() <= 2
    for column in (DIRECT, DIRECT + 1, DIRECT + 2, OPEN):
        np.testing.assert_allclose(ours[:, column], truth[:, column], rtol=3e-4, atol=1e-4)
    assert differs[:, SQUARE].sum() <= 2
    assert (truth[:, [DIRECT, INDIRECT, OPEN]].std(axis=0) > 0.01).all()
    share = np.full(room.texels.n, -1, np.float32)
    estimate_occlusion(
        origin, normal, new_packet_buffers(room.rays.tracer), begin, net, shared, np.float32(REACH), 0, share
    )
    np.testing.assert_allclose(share[begin : begin + len(origin)], truth[:, OPEN], atol=1e-6)


def test_stages_call_the_kernels_tile_by_tile(room, rays_of):
    net, _, begin, origin, _, exitance, _, n_light, truth = rays_of
    n_front, n_samples = room.texels.n_front, len(net)
    runs = [
        final_gather(
            room.job(threads=threads),
            n_front,
            exitance,
            np.zeros(room.texels.n, np.uint8),
            room.sampling(n_light, n_samples),
            sky=tuple(SKY.tolist()),
            ao_distance=REACH,
        )
        for threads in (1, 2)
    ]
    for name in ("indirect", "direct", "open", "variance"):
        assert getattr(runs[0], name).tobytes() == getattr(runs[1], name).tobytes()
        assert len(getattr(runs[0], name)) == room.texels.n_front
    assert runs[0].rays == room.texels.n_front * len(net)  # no surface is transparent
    np.testing.assert_allclose(runs[0].open[begin : begin + len(origin)], truth[:, OPEN], atol=1e-6)
    alone = ambient_occlusion(room.job(), n_front, n_samples=n_samples, distance=REACH)
    # Both stages trace the same rays.
    np.testing.assert_array_equal(alone, runs[0].open)
    near = ambient_occlusion(room.job(), n_front, n_samples=n_samples, distance=float("inf"))
    assert (near <= alone).all()
    assert near.mean() < 0.8 * alone.mean()


def test_shadow_rays_add_what_they_reach(room):
    rng = np.random.default_rng(4)
    begin, n = 10, 37
    origin, _ = points_of(room.surface, room.free, np.arange(begin, begin + n))
    light = np.array([0.8, 1.35, 0.8])
    ray = np.concatenate([light - origin, np.full((n, N_POINTS, 1), 0.999)], axis=2).astype(np.float32)
    weight = rng.random((n, N_POINTS), np.float32) * (rng.random((n, N_POINTS)) < 0.7)
    colour = np.float32([1, 2, 0.5])
    out = rng.random((n, 6), np.float32)
    before = out.copy()
    add_visible(new_packet_buffers(room.rays.tracer), origin, ray, weight.astype(np.float32), colour, out)
    mesh = room.geometry.position, room.geometry.triangle
    hit = [
        [naive.intersect(*mesh, o, d, 0, 0.999)[1] for o, d in zip(a, b, strict=True)]
        for a, b in zip(origin, ray[..., :3], strict=True)
    ]
    seen = np.array(hit) < 0
    truth = (weight * seen).mean(axis=1)[:, None] * np.tile(colour, 2)
    np.testing.assert_allclose(out - before, truth, atol=2e-6)
    assert 0.1 < seen.mean() < 0.95


def rectangle_irradiance(point, normal, corners):
    """Return E / L of a polygon above the horizon by Lambert's formula."""
    v = np.asarray(corners, float) - point
    v /= np.linalg.norm(v, axis=1, keepdims=True)
    total = 0.0
    for a, b in zip(v, np.roll(v, -1, axis=0), strict=True):
        cross = np.cross(a, b)
        total += np.arccos(np.clip(a @ b, -1, 1)) * (cross @ normal) / np.linalg.norm(cross)
    return abs(total) / 2


EMITTER = (0.3, 0.4, 0.3), (0.5, 0, 0), (0, 0, 0.6)


def lit_floor(pieces, n_light, seed=0, n_gather=64):
    """Compute the light of a floor below an emitter that consists of `pieces` strips.

    Returns the world, the direct light, the gathered light, the floor's texels (n,) and their irradiance (n,)
    by Lambert's formula.
    """
    (x, y, z), (width, *_), long = EMITTER
    strips = [
        Quad((x + k * width / pieces, y, z), (width / pieces, 0, 0), long, grey(0.0, 5.0))
        for k in range(pieces)
    ]
    world = quad_world([Quad((0, 0, 0), (0, 0, 1), (1, 0, 0), grey(0.5)), *strips], 32, inset=0.3)
    sampling = world.sampling(n_light, n_gather)
    direct = direct_light(world.job(seed=seed), (), sampling)
    gathered = final_gather(
        world.job(seed=seed),
        world.texels.n_front,
        seen_light(world.texels, np.zeros((world.texels.n, 4), np.float32)),
        direct.analytic,
        sampling,
        sky=(0, 0, 0),
        ao_distance=1.0,
    )
    own = np.flatnonzero(world.texels.instance == 0)
    corners = [(0.3, 0.4, 0.3), (0.8, 0.4, 0.3), (0.8, 0.4, 0.9), (0.3, 0.4, 0.9)]
    points, _ = points_of(world.surface, world.free, own)
    truth = [
        np.mean([rectangle_irradiance(point, [0, 1, 0], corners) for point in texel]) for texel in points
    ]
    return world, direct, gathered, own, 5.0 * np.array(truth)


@pytest.mark.parametrize("n_light", [16, 64])
def test_both_estimates_of_an_emitter_meet_lamberts_formula(n_light):
    """The MIS-weighted sum of light samples and hemisphere rays is L x projected solid angle."""
    # The closed form is not used for 5 strips, because they have too many triangles.
    found = {"whole": [], "complete": [], "part": []}
    sampled, variance = [], []
    for seed in range(6):
        world, direct, gathered, own, truth = lit_floor(5, n_light, seed)
        assert not direct.analytic[own].any()
        area = world.texels.area[own]
        light = np.average(truth, weights=area)
        whole = direct.weighted[own, 0] + gathered.direct[own, 0]
        for name, estimate in (("whole", whole), ("complete", direct.complete[own, 0])):
            found[name].append(np.average(estimate, weights=area) / light)
            assert np.sqrt(np.average((estimate / truth - 1) ** 2, weights=area)) < 0.8 / np.sqrt(n_light)
        found["part"].append(np.average(direct.weighted[own, 0], weights=area) / light)
        sampled.append(direct.weighted[own].mean(axis=1))
        variance.append(direct.variance[own])
    for name in ("whole", "complete"):
        assert np.mean(found[name]) == pytest.approx(1, rel=4e-3)
    assert 0.05 < np.mean(found["part"]) < 0.95
    np.testing.assert_array_equal(direct.weighted[own, 0], direct.weighted[own, 2])
    # The emitter does not illuminate itself or its back.
    other = world.texels.instance != 0
    assert (direct.complete[other] == 0).all()
    # The variance is estimated as if the 16 batches of samples were independent. The samples are stratified
    # over all batches, so the reported standard error is about 2.3 times the spread over seeds.
    assert 1.5 < np.sqrt(np.mean(variance) / np.var(sampled, axis=0, ddof=1).mean()) < 3.5
    # The emitter is unoccluded, so only one shadow ray is traced from each of the 16 points. A packet with
    # only few texels of the floor traces more.
    shadow = direct.rays - 4 * world.texels.n
    assert 16 * len(own) <= shadow <= (16 if n_light == 16 else 30) * len(own)


@pytest.mark.parametrize("n_light", [16, 64])
def test_an_unoccluded_emitter_follows_lamberts_formula(n_light):
    world, direct, gathered, own, truth = lit_floor(1, n_light)
    # The floor's last texel may share its packet with 15 texels of the emitter. It then has too few rays to
    # decide that the emitter is unoccluded.
    sure = own[direct.analytic[own] != 0]
    assert len(own) - len(sure) <= 1
    np.testing.assert_array_equal(direct.weighted[sure], direct.complete[sure])
    assert (gathered.direct[sure] == 0).all()
    assert (direct.variance[sure] == 0).all()
    np.testing.assert_allclose(direct.complete[sure, 0], truth[: len(sure)], rtol=2e-5)
    # The emitter does not illuminate itself or its back.
    assert (direct.complete[world.texels.instance != 0] == 0).all()


def test_dark_lights_cast_nothing(room):
    lights = (PunctualLight("point", "off", 0, (0, 0, 0)),)
    world = quad_world([Quad((0, 0, 0), (0, 0, 1), (1, 0, 0))])
    direct = direct_light(world.job(threads=2), lights, world.sampling(4, 4))
    assert not direct.complete.any()
    assert not direct.weighted.any()
    assert not direct.variance.any()


def test_rays_that_are_cast_twice_count_twice():
    """A packet of rays is cast again if a ray of it stopped at a pane, here almost all rays of the floor."""
    pane = Material(base_colour=(1.0, 1.0, 1.0, 0.5), alpha_mode="BLEND", double_sided=True)
    scene = quad_scene([Quad((0, 0, 0), (0, 0, 1), (1, 0, 0)), Quad((0, 0.1, 0), (0, 0, 1), (1, 0, 0), pane)])
    settings = make_settings({"resolution": 64, "samples": 64, "sky": "1,1,1", "denoise": False})
    result = bake(scene, settings=settings)
    n_front = np.isin(result.status, [TexelStatus.COVERED, TexelStatus.UNCONVERGED]).sum()
    # The other half of the texels are on the pane. Their rays leave the scene, and are cast once.
    assert 1.4 < result.rays[Stage.FINAL_GATHER] / (64 * n_front) < 1.5
