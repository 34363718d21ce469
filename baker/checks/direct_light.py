"""Estimates direct irradiance at a few hundred points of a scene without a bake, for rules about light.

    E = sum I w  +  sum L cos cos' A / r^2  +  pi L_sky

The first sum is over lights without area of intensity I. w is the result of `LightKind.fill`, which is
cos / r^2 for a point light without a range. The second sum is over emitters of radiance L and area A. L_sky
is the radiance of the sky. r is the distance to the light. cos and cos' are the cosines at the point and at
the emitter. Each term is multiplied by visibility. Every triangle blocks all light, even if its material is
transparent.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baker.checks.emission import Emission
from baker.checks.world_triangles import WorldTriangles
from baker.core.colour import LUMINANCE_WEIGHTS
from baker.core.light_kind import kind_of
from baker.core.scene import PunctualLight, Scene
from baker.core.settings import BakeSettings

# Number of sample points, a multiple of 16; rays from each point to emitters; rays from each point to the
# sky.
POINTS, EMITTER_RAYS, SKY_RAYS = 512, 16, 16
# Number of points at which the light of both sides is compared, a multiple of 16.
SIDE_POINTS = 2048
_LUMINANCE = np.array(LUMINANCE_WEIGHTS)


@dataclass(frozen=True)
class Levels:
    """Direct irradiance at sample points.

    Attributes
    ----------
    position : (n, 3) float64, metres, world, relative to `Scene.origin`
    irradiance : (n,) float64, lx
        The largest of the components R, G and B at each point.
    from_lights : (n,) float64, lx
        The same, but only of the lights without area.
    triangle : (n,) int64
        Index in `WorldTriangles` of the triangle on which each point lies.
    """

    position: NDArray[np.float64]
    irradiance: NDArray[np.float64]
    from_lights: NDArray[np.float64]
    triangle: NDArray[np.int64]


def estimate_levels(
    scene: Scene, world: WorldTriangles, emission: Emission, settings: BakeSettings
) -> Levels:
    """Estimate the direct irradiance of the fronts of triangles at random points, stratified by area.

    Parameters
    ----------
    scene : Scene
        The lights.
    world : WorldTriangles
        The triangles of the scene.
    emission : Emission
        The triangles that emit.
    settings : BakeSettings
        The seed and the radiance of the sky.

    Returns
    -------
    Levels
        `POINTS` points with their irradiance.
    """
    random = np.random.default_rng(settings.seed)
    position, normal, triangle = spread_points(world, POINTS, random)
    total = np.zeros((len(position), 3))
    origin = world.lifted(position, triangle, normal)
    for light in scene.local_lights:
        if max(light.intensity) > 0:
            total += _punctual(world, light, origin, normal)
    from_lights = total.max(axis=1)
    total += _emissive(world, emission, origin, normal, random)
    sky = np.array(settings.sky_radiance)
    if sky.any():
        direction = cosine_directions(normal, SKY_RAYS, random)
        far = np.full(len(direction), 1e30)
        hit, _ = world.first_hits(
            np.repeat(origin, SKY_RAYS, axis=0), direction, np.zeros(len(direction)), far
        )
        total += np.pi * (hit < 0).reshape(-1, SKY_RAYS).mean(axis=1)[:, None] * sky
    return Levels(position, total.max(axis=1), from_lights, triangle)


@dataclass(frozen=True)
class SideLight:
    """Direct irradiance of both sides of surfaces, from emitters and lights with a position only.

    Attributes
    ----------
    front, back : (n,) float64, lx
        Sum of the components R, G and B of the irradiance of the front and of the back at each point.
    triangle : (n,) int64
        Index in `WorldTriangles` of the triangle on which each point lies.
    """

    front: NDArray[np.float64]
    back: NDArray[np.float64]
    triangle: NDArray[np.int64]


def side_light(scene: Scene, world: WorldTriangles, emission: Emission, seed: int) -> SideLight:
    """Estimate the direct irradiance of both sides of triangles, from emitters and lights with a position.

    Parameters
    ----------
    scene : Scene
        The lights.
    world : WorldTriangles
        The triangles of the scene.
    emission : Emission
        The triangles that emit.
    seed : int
        Seed of the points and of the rays to emitters.

    Returns
    -------
    SideLight
        The irradiance at `SIDE_POINTS` random points on all triangles, stratified by area.
    """
    random = np.random.default_rng(seed)
    position, normal, triangle = spread_points(world, SIDE_POINTS, random)
    lights = [
        light for light in scene.local_lights if kind_of(light).has_position and max(light.intensity) > 0
    ]
    sides = []
    for up in (normal, -normal):
        origin = world.lifted(position, triangle, up)
        total = _emissive(world, emission, origin, up, random)
        for light in lights:
            total += _punctual(world, light, origin, up)
        sides.append(total.sum(axis=1))
    return SideLight(sides[0], sides[1], triangle)


def spread_points(
    world: WorldTriangles, n: int, random: np.random.Generator
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int64]]:
    """Return n random points on all triangles, stratified by area.

    The results are positions (n, 3), metres, unit face normals (n, 3) and triangle indices (n,).
    """
    share = np.cumsum(world.area)
    pick = (np.arange(n) + random.random(n)) / n * share[-1]
    triangle = np.minimum(np.searchsorted(share, pick), len(share) - 1)
    return points_inside(world, triangle, random), world.normal[triangle], triangle


def points_inside(
    world: WorldTriangles,
    triangle: NDArray[np.int64],
    random: np.random.Generator,
    part: NDArray[np.float64] | None = None,
) -> NDArray[np.float64]:
    """Return one uniform random point inside each triangle, (n, 3) float64, metres.

    If `part` (n, 3) is given, its rows are rows of `Emission.inside`, and each point lies in that part of its
    triangle.
    """
    u, v = random.random((2, len(triangle)))
    over = u + v > 1.0
    u, v = np.where(over, 1.0 - u, u), np.where(over, 1.0 - v, v)
    if part is not None:
        u, v = part[:, 0] + part[:, 2] * u, part[:, 1] + part[:, 2] * v
    corner = world.position[world.triangle[triangle]].astype(np.float64)
    point: NDArray[np.float64] = (
        corner[:, 0] + u[:, None] * (corner[:, 1] - corner[:, 0]) + v[:, None] * (corner[:, 2] - corner[:, 0])
    )
    return point


def _punctual(
    world: WorldTriangles, light: PunctualLight, origin: NDArray[np.float64], normal: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the irradiance at n points from one light without area, (n, 3) float64, lx."""
    # `LightKind.fill` takes points in groups of 16.
    shape = (len(origin) // 16, 16)
    ray, weight = np.zeros((*shape, 4), np.float32), np.zeros(shape, np.float32)
    at, up = (value.astype(np.float32).reshape(*shape, 3) for value in (origin, normal))
    kind_of(light).fill(light, at, up, ray, weight)
    rows = ray.reshape(-1, 4)
    hit, _ = world.first_hits(origin, rows[:, :3], np.zeros(len(rows)), rows[:, 3])
    seen = np.where(hit < 0, weight.reshape(-1), 0.0)
    return np.asarray(seen[:, None] * np.array(light.intensity), np.float64)


def _emissive(
    world: WorldTriangles,
    found: Emission,
    origin: NDArray[np.float64],
    normal: NDArray[np.float64],
    random: np.random.Generator,
) -> NDArray[np.float64]:
    """Return the irradiance at (n, 3) points from emitters, (n, 3) float64, lx.

    This is a Monte Carlo estimate with `EMITTER_RAYS` rays from each point to random points on emitters. The
    probability of an emitter is proportional to its area times the luminance of its radiance.
    """
    power = found.area * (found.radiance @ _LUMINANCE)
    total = np.zeros((len(origin), 3))
    if not power.sum() > 0:
        return total
    share = np.cumsum(power) / power.sum()
    for _ in range(EMITTER_RAYS):
        part = np.minimum(np.searchsorted(share, random.random(len(origin))), len(share) - 1)
        chosen = found.triangle[part]
        direction = points_inside(world, chosen, random, found.inside[part]) - origin
        square = np.maximum(np.einsum("nx,nx->n", direction, direction), 1e-20)
        here = np.einsum("nx,nx->n", direction, normal)
        there = -np.einsum("nx,nx->n", direction, world.normal[chosen])
        there = np.where(world.double_sided[chosen], np.abs(there), there)
        hit, _ = world.first_hits(
            origin, direction, np.zeros(len(direction)), np.full(len(direction), 0.9999)
        )
        geometry = np.maximum(here, 0) * np.maximum(there, 0) / square**2 * (hit < 0)
        density = power[part] / power.sum() / np.maximum(found.area[part], 1e-300)
        total += found.radiance[part] * (geometry / density)[:, None] / EMITTER_RAYS
    return total


def cosine_directions(
    normal: NDArray[np.float64], n: int, random: np.random.Generator
) -> NDArray[np.float64]:
    """Return n cosine-weighted directions around each of N normals, (N n, 3) float64, not normalised."""
    direction = random.normal(size=(len(normal) * n, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    out: NDArray[np.float64] = direction * (1.0 - 1e-6) + np.repeat(normal, n, axis=0)
    return out
