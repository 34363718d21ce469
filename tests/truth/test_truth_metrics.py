"""The reference path tracer deviates from closed forms by at most three standard errors and 0.2 %."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from closed_forms import (
    cornered_ao,
    parallel_squares,
    perpendicular_squares,
    polygon_irradiance,
    solid_angle,
    spot_flux,
    walled_ao,
)
from reference_runs import UP, assert_closed_form, copies_of, spread_over, traced, traced_ao
from scenes import icosphere
from tiny_scenes import Quad, box_quads, grey, quad_scene

from baker.core.scene import Instance, Material, Mesh, PunctualLight, Scene
from baker.pathtracer.estimators import ESTIMATORS

SQUARE = np.array([[(0, 0, 0), (1, 0, 0), (1, 1, 0)], [(0, 0, 0), (1, 1, 0), (0, 1, 0)]]) - (0.5, 0.5, 0)

# {estimator: samples per point in a pass}. An estimator without MIS either hits lights by chance or samples
# them, but does not combine both. It needs more samples.
RAYS = {name: 256 if how.aim == 2 else 1024 for name, how in ESTIMATORS.items()}

# {estimator: (albedo of each colour, passes of 256 x 64 paths)}. With uniform directions the variance is
# infinite if albedo^2 > 3 / 4. The estimator `light` has infinite variance between walls that meet, for any
# albedo, so `test_integrating_sphere` tests it.
FURNACE = {
    "uniform": ((0.5, 0.35, 0.2), 48),
    "cosine": ((0.95, 0.8, 0.5), 140),
    "mis": ((0.8, 0.5, 0.2), 90),
    "mis-power": ((0.5, 0.35, 0.2), 24),
    "bdpt": ((0.7, 0.5, 0.2), 28),
}


@pytest.mark.parametrize("estimator", FURNACE)
def test_furnace(estimator):
    # Every wall emits 1 / pi, so E = 1 / (1 - albedo) everywhere.
    albedo, passes = FURNACE[estimator]
    emissive = Material(base_colour=(*albedo, 1.0), emission=(1 / math.pi,) * 3)
    walls = box_quads((0, 0, 0), (1, 2, 3), inward=True, material=emissive)
    places = np.random.default_rng(1).uniform((0.1, 0.1, 0), (0.9, 1.9, 0), (256, 3))
    found = traced(quad_scene(walls), copies_of(places, copies=1), estimator=estimator, passes=passes)
    for c in range(3):
        assert_closed_form(found, 1 / (1 - albedo[c]), channel=c)


@pytest.mark.parametrize(("albedo", "passes"), [(0.2, 8), (0.6, 32)])
def test_furnace_in_a_sphere_by_aiming(albedo, passes):
    corner = icosphere(2, inward=True)
    scene, face = polyhedron(corner, (), albedo, np.ones(len(corner)))
    where = copies_of(corner[7].mean(axis=0), face[7])
    assert_closed_form(traced(scene, where, estimator="light", passes=passes), math.pi / (1 - albedo))


@pytest.mark.parametrize("estimator", ESTIMATORS)
def test_under_a_parallel_square(estimator):
    corners = [(-0.5, 0.5, 1), (0.5, 0.5, 1), (0.5, -0.5, 1), (-0.5, -0.5, 1)]
    emitter = Quad((-0.5, 0.5, 1), (1, 0, 0), (0, -1, 0), grey(0, 2.0))
    places = [(0, 0, 0), (0.6, 0.2, 0)]
    truth = [2.0 * polygon_irradiance(corners, p, UP) for p in places]
    found = traced(
        quad_scene([emitter]), copies_of(places), estimator=estimator, samples=RAYS[estimator], passes=6
    )
    assert_closed_form(found, truth)


@pytest.mark.parametrize("estimator", ESTIMATORS)
def test_beside_a_perpendicular_square(estimator):
    corners = [(0, 0.5, 0), (0, 0.5, 1), (0, -0.5, 1), (0, -0.5, 0)]
    emitter = Quad((0, -0.5, 0), (0, 1, 0), (0, 0, 1), grey(0, 1.0))
    places = [(0.4, 0.1, 0), (0.9, 0.5, 0)]
    truth = [polygon_irradiance(corners, p, UP) for p in places]
    found = traced(
        quad_scene([emitter]), copies_of(places), estimator=estimator, samples=RAYS[estimator], passes=6
    )
    assert_closed_form(found, truth)


def test_form_factors_agree_with_quadrature():
    """Gauss quadrature of Lambert's formula gives the form factors. It converges slowly at a common edge."""
    spot, weight = np.polynomial.legendre.leggauss(64)
    x, y = np.meshgrid(spot / 2, spot / 2)
    place = np.stack([x, y, 0 * x], axis=-1)
    share = weight[:, None] * weight[None, :] / 4
    above = [(-0.5, 0.5, 1), (0.5, 0.5, 1), (0.5, -0.5, 1), (-0.5, -0.5, 1)]
    beside = [(-0.5, 0.5, 0), (-0.5, 0.5, 1), (-0.5, -0.5, 1), (-0.5, -0.5, 0)]
    found = [(share * polygon_irradiance(corners, place, UP)).sum() / math.pi for corners in (above, beside)]
    assert found[0] == pytest.approx(parallel_squares(), rel=1e-9)
    assert found[1] == pytest.approx(perpendicular_squares(), rel=1e-4)


@pytest.mark.parametrize("estimator", ["mis", "bdpt"])
@pytest.mark.parametrize("perpendicular", [False, True])
def test_form_factor_of_unit_squares(perpendicular, estimator):
    """The mean of E / (pi L) over the square is the form factor: parallel 0.19982, perpendicular 0.20004."""
    emitter = Quad((-0.5, 0.5, 1), (1, 0, 0), (0, -1, 0), grey(0, 1 / math.pi))
    truth, passes = parallel_squares(), 6
    if perpendicular:
        emitter = Quad((-0.5, -0.5, 0), (0, 1, 0), (0, 0, 1), grey(0, 1 / math.pi))
        truth, passes = perpendicular_squares(), 16
    found = traced(
        quad_scene([emitter]),
        lambda k: spread_over(SQUARE, 512, k),
        estimator=estimator,
        samples=512,
        passes=passes,
    )
    assert_closed_form(found, truth)


def polyhedron(corner, light=(), albedo=0.5, emission=None):
    """Return a scene of triangles (t, 3, 3), and their normals; `emission` (t,) bool marks emitters."""
    n = len(corner)
    face = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    face /= np.linalg.norm(face, axis=1, keepdims=True)
    emits = np.zeros(n, np.int32) if emission is None else np.asarray(emission, np.int32)
    mesh = Mesh(
        "sphere", corner.reshape(-1, 3).astype(np.float32), np.repeat(face, 3, axis=0).astype(np.float32),
        np.arange(3 * n, dtype=np.int32).reshape(n, 3), emits, np.zeros(n, np.int32),
        np.zeros(3 * n, np.int32), np.arange(3 * n, dtype=np.int32),
    )  # fmt: skip
    white = Material(base_colour=(albedo, albedo, albedo, 1.0))
    materials = (white, replace(white, emission=(1.0, 1.0, 1.0)))
    instance = Instance(0, "sphere", 0, np.eye(4))
    return Scene("sphere", None, (mesh,), materials, (instance,), tuple(light)), face


def areas(corner):
    return 0.5 * np.linalg.norm(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1)


POINT = PunctualLight("point", "p", 0, (1.0, 1.0, 1.0), (0.3, 0.0, 0.0))
SPOT = PunctualLight("spot", "s", 0, (1.0, 1.0, 1.0), (0.1, 0.2, 0.0), (0.6, 0, -0.8), 0.8, 1.4)
FADED = replace(POINT, range=1.15)


def faded_flux(corner, light):
    """Return the flux at triangles (t, 3, 3) from a point light with a range, by the midpoint rule."""
    side = 64
    i, j = np.divmod(np.arange(side * side), side)
    up = i + j < side
    u = np.where(up, i + 1 / 3, side - i - 1 / 3) / side
    v = np.where(up, j + 1 / 3, side - j - 1 / 3) / side
    edge = corner[:, 1:] - corner[:, :1]
    place = corner[:, :1] + u[:, None] * edge[:, :1] + v[:, None] * edge[:, 1:]
    way = np.array(light.position) - place
    length = np.linalg.norm(way, axis=2)
    # Normal of a triangle, with twice its area as length.
    cross = np.cross(edge[:, 0], edge[:, 1])
    window = np.clip(1 - (length / light.range) ** 4, 0, 1)
    return float((np.einsum("tpx,tx->tp", way, cross) * window / length**3).sum() / 2 / side**2)


@pytest.mark.parametrize(
    ("kind", "estimator", "albedo", "passes"),
    [
        *(("point", "light", 0.5, 8), ("point", "mis", 0.7, 12), ("point", "bdpt", 0.5, 4)),
        *(("spot", "mis", 0.5, 16), ("area", "mis", 0.5, 8)),
        *(("faded", "light", 0.5, 8), ("faded", "mis", 0.5, 16), ("faded", "bdpt", 0.5, 6)),
    ],
)
def test_flux_in_a_closed_room(kind, estimator, albedo, passes):
    """In a closed room of any shape, here 80 triangles, mean E = flux / (area (1 - albedo))."""
    corner = icosphere(1, inward=True)
    area = areas(corner)
    emits = corner[:, :, 2].mean(axis=1) > 0.6
    flux = {"point": 4 * math.pi, "spot": spot_flux(0.8, 1.4), "area": math.pi * area[emits].sum()}
    flux = faded_flux(corner, FADED) if kind == "faded" else flux[kind]
    light = {"point": (POINT,), "spot": (SPOT,), "faded": (FADED,), "area": ()}[kind]
    scene, _ = polyhedron(corner, light, albedo, emits if kind == "area" else None)
    found = traced(
        scene, lambda k: spread_over(corner, 256, k), estimator=estimator, samples=256, passes=passes
    )
    assert_closed_form(found, flux / area.sum() / (1 - albedo))


@pytest.mark.parametrize(
    ("estimator", "albedo", "passes"),
    [("light", 0.5, 10), ("mis", 0.2, 4), ("mis", 0.6, 20), ("bdpt", 0.5, 4)],
)
def test_integrating_sphere(estimator, albedo, passes):
    """E = D + flux / (4 pi) albedo / (1 - albedo) at each point of the wall, with direct irradiance D.

    The sphere is a mesh of 20,480 triangles. The truth accounts for the mesh: the first bounce is computed
    with Lambert's formula for each triangle, and later bounces with the area of the mesh. The difference
    from a sphere is below 0.03 %.
    """
    corner = icosphere(5, inward=True)
    scene, face = polyhedron(corner, (POINT,), albedo)
    chosen = np.array([5, 9000])
    place, normal = corner[chosen].mean(axis=1), face[chosen]
    away = np.array(POINT.position) - place
    direct = (away * normal).sum(axis=1) / (away**2).sum(axis=1) ** 1.5
    even = 1 / (1 - albedo)
    round_truth = direct + albedo * even
    area = areas(corner)
    lit = solid_angle(corner, POINT.position) / area
    first = [lit @ polygon_irradiance(corner, p, n) / math.pi for p, n in zip(place, normal, strict=True)]
    flat_truth = direct + albedo * np.array(first) + albedo**2 * even * 4 * math.pi / area.sum()
    np.testing.assert_allclose(flat_truth, round_truth, rtol=3e-4)
    found = traced(scene, copies_of(place, normal), estimator=estimator, passes=passes)
    assert_closed_form(found, flat_truth)
    assert_closed_form(found, round_truth)


@pytest.mark.parametrize(
    ("light", "truth"),
    [
        (PunctualLight("point", "p", 0, (3.0, 2.0, 1.0), (0, 0, 1)), (3, 2, 1)),
        (PunctualLight("point", "p", 0, (1.0, 1.0, 1.0), (0, 1, 1)), (0.5**1.5,) * 3),
        (PunctualLight("spot", "s", 0, (4.0, 4.0, 4.0), (0, 0, 2), (0, 0, -1), 0.2, 0.4), (1, 1, 1)),
        # A point between the cones: the factor is ((cos - cos_outer) / (cos_inner - cos_outer))^2.
        (
            PunctualLight(
                "spot", "s", 0, (8.0,) * 3, (0, 0, 2), (math.sin(0.3), 0, -math.cos(0.3)), 0.2, 0.4
            ),
            (2 * ((math.cos(0.3) - math.cos(0.4)) / (math.cos(0.2) - math.cos(0.4))) ** 2,) * 3,
        ),
        (PunctualLight("directional", "d", 0, (5.0, 5.0, 5.0), direction=(0.6, 0, -0.8)), (4, 4, 4)),
        # The factor of a light with a range, at half of the range: 1 - (1 / 2)^4.
        (PunctualLight("point", "p", 0, (3.0, 2.0, 1.0), (0, 0, 1), range=2.0), (45 / 16, 15 / 8, 15 / 16)),
        (
            PunctualLight("spot", "s", 0, (4.0,) * 3, (0, 0, 2), (0, 0, -1), 0.2, 0.4, range=4.0),
            (15 / 16,) * 3,
        ),
    ],
)
@pytest.mark.parametrize("estimator", ESTIMATORS)
def test_lights_without_area_are_exact(light, truth, estimator):
    floor = Quad((-5, -5, 0), (10, 0, 0), (0, 10, 0), grey(0.5))
    scene = replace(quad_scene([floor]), lights=(light,))
    found = traced(scene, copies_of([(0, 0, 0)], copies=2), passes=2, estimator=estimator, max_bounces=0)
    assert (found.standard_error <= 1e-6 * found.mean).all()
    for c in range(3):
        assert_closed_form(found, truth[c], channel=c, rounding=1e-4)


@pytest.mark.parametrize("estimator", ["light", "bdpt"])
def test_a_point_light_over_a_square_half_in_shadow(estimator):
    """Mean E is I x (solid angle of the unshadowed part of the square, seen from the light) / area."""
    screen = Quad((-0.1, -0.2, 0.5), (0.2, 0, 0), (0, 0.3, 0), grey(0.0, double_sided=True))
    light = PunctualLight("point", "p", 0, (2.0, 2.0, 2.0), (0.1, 0.0, 1.0))
    scene = replace(quad_scene([screen]), lights=(light,))
    o, u, v = (np.array(x) for x in (screen.corner, screen.edge_u, screen.edge_v))
    hides = np.array([[o, o + u, o + u + v], [o, o + u + v, o + v]])
    truth = 2.0 * (solid_angle(SQUARE, light.position).sum() - solid_angle(hides, light.position).sum())
    found = traced(scene, lambda k: spread_over(SQUARE, 512, k), samples=512, passes=8, estimator=estimator)
    assert_closed_form(found, truth)


@pytest.mark.parametrize("estimator", ESTIMATORS)
def test_half_hidden_sky(estimator):
    # The wall is not parallel to an axis; otherwise it would hide exactly half of the strata, without noise.
    wall = Quad((-150, -500, 0), (300, 1000, 0), (0, 0, 1000), grey(0.0, double_sided=True))
    found = traced(
        quad_scene([wall]),
        copies_of([(1e-3, -3e-4, 0)]),
        sky=(1, 2, 3),
        samples=64,
        passes=32,
        estimator=estimator,
    )
    for c in range(3):
        assert_closed_form(found, math.pi / 2 * (c + 1), channel=c)


@pytest.mark.parametrize("estimator", ["mis", "bdpt"])
@pytest.mark.parametrize(("bounces", "albedo"), [(0, 0.5), (1, 0.5), (2, 0.5), (6, 0.95)])
def test_bounces_are_terms_of_a_series(bounces, albedo, estimator):
    walls = box_quads((0, 0, 0), (1, 1, 1), inward=True, material=grey(albedo, 1 / math.pi))
    where = copies_of([(0.4, 0.3, 0)])
    found = traced(quad_scene(walls), where, max_bounces=bounces, passes=16, estimator=estimator)
    assert_closed_form(found, sum(albedo**k for k in range(bounces + 1)))


# Distances of points from a wall, metres.
NEAR = np.array([0.002, 0.01, 0.05, 0.1, 0.3, 0.8])


def floor_places(x, y=0.0):
    x, y = np.broadcast_arrays(x, y)
    return copies_of(np.stack([x, y, 0 * x], axis=1))


@pytest.mark.parametrize(("height", "reach"), [(1.0, np.inf), (0.05, np.inf)])
def test_ao_beside_a_wall(height, reach):
    wall = Quad((0, -2, 0), (0, 4, 0), (0, 0, height), grey(0.5, double_sided=True))
    corners = np.array([(0, 2, 0), (0, 2, height), (0, -2, height), (0, -2, 0)], float)
    truth = [1 - polygon_irradiance(corners, (x, 0.5, 0), UP) / math.pi for x in NEAR]
    assert_closed_form(traced_ao(quad_scene([wall]), floor_places(NEAR, 0.5), reach, samples=256), truth)


@pytest.mark.parametrize(("height", "reach"), [(10.0, 0.5), (0.2, 0.5), (1.0, 0.9)])
def test_ao_beside_a_wall_within_a_distance(height, reach):
    wall = Quad((0, -2, 0), (0, 4, 0), (0, 0, height), grey(0.5, double_sided=True))
    truth = walled_ao(NEAR, height, reach)
    assert_closed_form(traced_ao(quad_scene([wall]), floor_places(NEAR), reach, samples=256), truth)


@pytest.mark.parametrize("reach", [0.5, np.inf])
def test_ao_where_two_walls_meet(reach):
    a = Quad((0, 0, 0), (0, 3, 0), (0, 0, 3), grey(0.5, double_sided=True))
    b = Quad((0, 0, 0), (3, 0, 0), (0, 0, 3), grey(0.5, double_sided=True))
    x, y = np.array([0.002, 0.01, 0.01, 0.1, 0.3, 0.45]), np.array([0.002, 0.02, 0.3, 0.1, 0.4, 0.2])
    if np.isinf(reach):
        first = np.array([(0, 3, 0), (0, 3, 3), (0, 0, 3), (0, 0, 0)], float)
        second = first[::-1, [1, 0, 2]]
        place = np.stack([x, y, 0 * x], axis=1)
        truth = 1 - (polygon_irradiance(first, place, UP) + polygon_irradiance(second, place, UP)) / math.pi
    else:
        truth = cornered_ao(x, y, reach)
    assert_closed_form(traced_ao(quad_scene([a, b]), floor_places(x, y), reach, samples=256), truth)
