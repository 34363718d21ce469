"""The path tracer against closed forms, and its estimators against each other."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from closed_forms import limited_wall_open_share, polygon_irradiance, wall_open_share
from scenes import icosphere
from tiny_scenes import Quad, box_quads, grey, quad_scene
from ztest import critical

from baker.core.scene import Instance, Material, Mesh, PunctualLight, Scene
from baker.reference.irradiance import irradiance_pass, new_estimate, openness_pass
from baker.reference.view import build_reference

UP = (0.0, 0.0, 1.0)
ESTIMATORS = ["uniform", "cosine", "stratified", "light", "bsdf", "mis", "mis-power", "bdpt"]


def traced(scene, points, *, normal=UP, passes=16, estimator="mis", sky=(0, 0, 0), samples=64, **how):
    """Return mean and standard error (n, 3) of path-traced irradiance at points that face one way."""
    position = np.array(points, float).reshape(-1, 1, 3)
    up = np.broadcast_to(np.array(normal, float), position.shape).copy()
    with build_reference(scene, sky=sky, lambertian=True, threads=how.pop("threads", 2)) as reference:
        estimate = new_estimate(len(position), 3, samples)
        for _ in range(passes):
            irradiance_pass(reference, estimate, position, up, up, estimator=estimator, **how)
    return estimate.mean, estimate.standard_error


def agree(mean, error, truth, *, within=0.002):
    """Check the mean over points: noise small enough to tell, within three standard errors and 0.2 %."""
    truth = np.broadcast_to(truth, mean.shape)
    # Points share no random numbers: their mean is a far sharper test than any of them. Colours do.
    mean, error, truth = (x.reshape(len(mean), -1)[:, 0] for x in (mean, error, truth))
    noise = np.sqrt((error**2).sum()) / len(error)
    assert noise < 0.5 * within * truth.mean(), "too noisy to tell"
    assert abs(mean.mean() - truth.mean()) < 3 * noise + 1e-6 * truth.mean()
    assert abs(mean.mean() / truth.mean() - 1) < within


@pytest.mark.parametrize(
    ("estimator", "albedo", "passes"),
    [
        *(("uniform", 0.2, 16), ("uniform", 0.5, 24), ("cosine", 0.5, 16), ("cosine", 0.8, 48)),
        *(("mis", 0.2, 16), ("mis", 0.5, 16), ("mis", 0.8, 48), ("mis", 0.95, 64)),
        *(("bdpt", 0.2, 12), ("bdpt", 0.8, 20)),
    ],
)
def test_furnace(estimator, albedo, passes):
    # Every wall emits 1 / pi: E = 1 / (1 - albedo) everywhere.
    walls = box_quads((0, 0, 0), (1, 2, 3), inward=True, material=grey(albedo, 1 / math.pi))
    points = np.random.default_rng(1).uniform((0.1, 0.1, 0), (0.9, 1.9, 0), (256, 3))
    mean, error = traced(quad_scene(walls), points, estimator=estimator, passes=passes)
    agree(mean, error, 1 / (1 - albedo))


@pytest.mark.parametrize("estimator", ESTIMATORS)
def test_parallel_square(estimator):
    lamp = Quad((-0.5, 0.5, 1), (1, 0, 0), (0, -1, 0), grey(0, 2.0))
    corners = [(-0.5, 0.5, 1), (0.5, 0.5, 1), (0.5, -0.5, 1), (-0.5, -0.5, 1)]
    points = [(0, 0, 0), (0.6, 0.2, 0), (-1, 0.7, 0)]
    truth = [polygon_irradiance(corners, p, UP) * 2.0 for p in points]
    mean, error = traced(quad_scene([lamp]), points, estimator=estimator, passes=64, samples=256)
    z = (mean[:, 0] - truth) / (error[:, 0] + 1e-7)
    assert (error[:, 0] < 0.03 * np.array(truth)).all()
    assert np.abs(z).max() < critical(len(ESTIMATORS) * 3, 63)


def test_perpendicular_square():
    lamp = Quad((0, -0.5, 0), (0, 1, 0), (0, 0, 1), grey(0, 1.0))
    corners = [(0, 0.5, 0), (0, 0.5, 1), (0, -0.5, 1), (0, -0.5, 0)]
    points = [(0.3, 0.1, 0), (1.0, -0.4, 0)]
    truth = np.array([polygon_irradiance(corners, p, UP) for p in points])
    mean, error = traced(quad_scene([lamp]), points, passes=96, samples=1024)
    agree(mean[:, 0], error[:, 0], truth)


def sphere_scene(light, albedo=0.5, level=3):
    corners = icosphere(level, inward=True)
    n = len(corners)
    flat = corners.reshape(-1, 3).astype(np.float32)
    face = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    face /= np.linalg.norm(face, axis=1, keepdims=True)
    zero = np.zeros(n, np.int32)
    mesh = Mesh(
        "sphere", flat, np.repeat(face, 3, axis=0).astype(np.float32),
        np.arange(3 * n, dtype=np.int32).reshape(n, 3), zero, zero,
        np.zeros(3 * n, np.int32), np.arange(3 * n, dtype=np.int32),
    )  # fmt: skip
    material = Material(base_colour=(albedo, albedo, albedo, 1.0))
    scene = Scene("sphere", None, (mesh,), (material,), (Instance(0, "sphere", 0, np.eye(4)),))
    centre = corners.mean(axis=1)
    return replace(scene, lights=(light,)), centre, face


def test_integrating_sphere_with_a_point_light():
    light = PunctualLight("point", "lamp", 0, (1.0, 1.0, 1.0), (0.3, 0.0, 0.0))
    scene, centre, face = sphere_scene(light)
    corner = scene.meshes[0].position.reshape(-1, 3, 3)
    side = corner[:, 1:] - corner[:, :1]
    area = 0.5 * np.linalg.norm(np.cross(side[:, 0], side[:, 1]), axis=1)
    position, up = centre[:, None].astype(float), face[:, None].astype(float)
    with build_reference(scene, lambertian=True, threads=2) as reference:
        estimate = new_estimate(len(position), 3)
        for _ in range(16):
            irradiance_pass(reference, estimate, position, up, up)
    # Flux is conserved: the mean over the wall is flux / area / (1 - albedo), whatever the shape.
    mean = (estimate.mean[:, 0] * area).sum() / area.sum()
    assert mean == pytest.approx(4 * math.pi / area.sum() / 0.5, rel=0.004)
    # Indirect light inside a sphere is the same everywhere.
    away = np.array(light.position) - centre
    square = (away**2).sum(axis=1)
    direct = (away * face).sum(axis=1) / square**1.5
    indirect = estimate.mean[:, 0] - direct
    truth = (direct * area).sum() / area.sum()
    assert indirect.mean() == pytest.approx(truth, rel=0.01)
    assert indirect.std() < 0.06 * truth


@pytest.mark.parametrize(
    ("light", "truth"),
    [
        (PunctualLight("point", "p", 0, (3.0, 2.0, 1.0), (0, 0, 1)), (3, 2, 1)),
        (PunctualLight("point", "p", 0, (1.0, 1.0, 1.0), (0, 1, 1)), (0.5**1.5,) * 3),
        (PunctualLight("spot", "s", 0, (4.0, 4.0, 4.0), (0, 0, 2), (0, 0, -1), 0.2, 0.4), (1, 1, 1)),
        (PunctualLight("directional", "d", 0, (5.0, 5.0, 5.0), direction=(0.6, 0, -0.8)), (4, 4, 4)),
    ],
)
@pytest.mark.parametrize("estimator", ["bsdf", "mis", "bdpt"])
def test_lights_without_area_are_exact(light, truth, estimator):
    floor = Quad((-5, -5, 0), (10, 0, 0), (0, 10, 0), grey(0.5))
    scene = replace(quad_scene([floor]), lights=(light,))
    mean, _ = traced(scene, [(0, 0, 0)], passes=2, estimator=estimator)
    np.testing.assert_allclose(mean[0], truth, rtol=1e-4)


@pytest.mark.parametrize("estimator", ["mis", "bdpt"])
def test_half_hidden_sky(estimator):
    wall = Quad((0, -500, 0), (0, 1000, 0), (0, 0, 1000), grey(0.0, double_sided=True))
    mean, error = traced(
        quad_scene([wall]), [(1e-3, 0, 0)], sky=(1, 2, 3), passes=64, samples=256, estimator=estimator
    )
    agree(mean, error, np.pi / 2 * np.array([[1, 2, 3]]))


@pytest.mark.parametrize("estimator", ["mis", "bdpt"])
def test_bounces_are_terms_of_a_series(estimator):
    walls = box_quads((0, 0, 0), (1, 1, 1), inward=True, material=grey(0.5, 1 / math.pi))
    for bounces in range(3):
        points = np.full((256, 3), (0.4, 0.3, 0))
        mean, error = traced(quad_scene(walls), points, max_bounces=bounces, passes=32, estimator=estimator)
        agree(mean, error, sum(0.5**k for k in range(bounces + 1)))


@pytest.mark.parametrize("reach", [0.5, np.inf])
def test_openness_beside_a_wall(reach):
    height = 1.0
    wall = Quad((0, -500, 0), (0, 1000, 0), (0, 0, height), grey(0.5, double_sided=True))
    distance = np.array([0.1, 0.3, 0.8])
    truth = wall_open_share(distance, height) if np.isinf(reach) else limited_wall_open_share(distance, reach)
    position = np.stack([distance, 0 * distance, 0 * distance], axis=1)[:, None]
    up = np.broadcast_to(np.array(UP), position.shape).copy()
    with build_reference(quad_scene([wall]), threads=2) as reference:
        estimate = new_estimate(3, 1, 256)
        for _ in range(64):
            openness_pass(reference, estimate, position, up, up, distance=reach)
    np.testing.assert_allclose(estimate.mean[:, 0], truth, atol=0.002)


def room():
    walls = box_quads((0, 0, 0), (2, 2, 2), inward=True, material=grey(0.6))
    lamp = Quad((0.7, 1.3, 1.9), (0.6, 0, 0), (0, -0.6, 0), grey(0, 5.0))
    block = box_quads((0.3, 0.3, 0), (0.8, 0.8, 0.6), inward=False, material=grey(0.4))
    scene = quad_scene([*walls, lamp, *block])
    return replace(scene, lights=(PunctualLight("point", "p", 0, (0.3, 0.3, 0.3), (1.6, 0.4, 1.0)),))


def test_estimators_agree_pairwise():
    points = np.random.default_rng(2).uniform((1.0, 1.0, 0), (1.9, 1.9, 0), (16, 3))
    found = {name: traced(room(), points, estimator=name, passes=24, samples=64) for name in ESTIMATORS}
    pairs = [(a, b) for i, a in enumerate(ESTIMATORS) for b in ESTIMATORS[:i]]
    bound = critical(len(pairs), 23 * 16)
    for a, b in pairs:
        difference = (found[a][0] - found[b][0])[:, 0].sum()
        error = math.sqrt((found[a][1][:, 0] ** 2 + found[b][1][:, 0] ** 2).sum())
        assert abs(difference) < bound * error, f"{a} and {b}"
    # The test can see one percent with all those that aim at lamps.
    assert np.sqrt((found["mis"][1] ** 2).sum()) < 0.01 * found["mis"][0].sum()


@pytest.mark.parametrize("power", ["mis", "mis-power"])
@pytest.mark.parametrize(("half", "height"), [(0.5, 0.1), (0.05, 1.9), (0.5, 0.6)])
def test_mis_is_never_much_worse_than_either_part(power, half, height):
    # A large lamp close by favours rays by chance, a small one far away aiming. Half of it is hidden: without
    # any variance of either part there is nothing to compare.
    lamp = Quad((-half, half, height), (2 * half, 0, 0), (0, -2 * half, 0), grey(0, 1.0))
    screen = Quad((0, -2, 0.9 * height), (4, 0, 0), (0, 4, 0), grey(0, double_sided=True))
    points = np.random.default_rng(3).uniform((-0.1, -0.1, 0), (0.1, 0.1, 0), (256, 3)) * (half, 1, 1)
    variance = {}
    for name in (power, "light", "bsdf"):
        scene = quad_scene([lamp, screen])
        _, error = traced(scene, points, estimator=name, passes=128, samples=4, stratify=False)
        variance[name] = float((error**2).mean())
    assert variance[power] <= 1.1 * min(variance["light"], variance["bsdf"])


def test_same_bytes_on_any_number_of_threads():
    points = np.random.default_rng(2).uniform((0.1, 0.1, 0), (1.9, 1.9, 0), (300, 3))
    one, _ = traced(room(), points, passes=2, samples=4, threads=1)
    two, _ = traced(room(), points, passes=2, samples=4, threads=3)
    assert one.tobytes() == two.tobytes()
