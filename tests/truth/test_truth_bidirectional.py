"""In pictures of mixed scenes, estimators agree, mirrored light is correct, and `bdpt` reduces variance."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from inner import compiled
from mixed_scenes import ROOM_CAMERA, YARD_CAMERA, glossy, glossy_room, open_yard
from tiny_scenes import Quad, box_quads, grey, quad_scene
from ztest import critical

import baker.pathtracer.bidirectional_pass as bidirectional_pass
from baker.core.scene import PunctualLight
from baker.pathtracer.bsdf import bsdf_eval
from baker.pathtracer.camera import look_at
from baker.pathtracer.estimators import PassOptions
from baker.pathtracer.irradiance import irradiance_pass
from baker.pathtracer.point_estimate import new_estimate
from baker.pathtracer.radiance import radiance_pass
from baker.pathtracer.scene import build_reference

(bsdf_eval,) = compiled(bsdf_eval)
SIZE = 12


def picture(scene, camera, estimator, passes, *, sky=(0, 0, 0), samples=16, size=SIZE, threads=2, **how):
    """Return mean and standard error, each (size, size, 3), of a picture, and its number of rays."""
    with build_reference(scene, sky=sky, threads=threads) as reference:
        estimate = new_estimate(size * size, 3, samples)
        for _ in range(passes):
            radiance_pass(reference, estimate, camera, size, size, options=PassOptions(estimator, **how))
    shape = (size, size, 3)
    return estimate.mean.reshape(shape), estimate.standard_error.reshape(shape), estimate.rays


def blocks(found, side):
    """Return mean and standard error of the green channel over blocks of side x side pixels."""
    n = SIZE // side
    mean, error = (x[..., 1].reshape(n, side, n, side) for x in found[:2])
    return mean.mean(axis=(1, 3)), np.sqrt((error**2).sum(axis=(1, 3))) / side**2


# {estimator: number of passes, which gives the mean of the picture a standard error below 4 %}.
ROOM_PASSES = {
    "uniform": 220, "cosine": 160, "stratified": 160, "light": 40, "bsdf": 100, "mis": 40, "mis-power": 40,
    "bdpt": 40,
}  # fmt: skip


def test_all_estimators_agree_on_mirrors_lobes_and_textures():
    found = {
        name: blocks(picture(glossy_room(), ROOM_CAMERA, name, passes), SIZE)
        for name, passes in ROOM_PASSES.items()
    }
    pairs = [(a, b) for i, a in enumerate(ROOM_PASSES) for b in list(ROOM_PASSES)[:i]]
    bound = critical(len(pairs))
    for a, b in pairs:
        away = abs(found[a][0] - found[b][0]).item()
        assert away < bound * math.hypot(found[a][1].item(), found[b][1].item()), f"{a} and {b}"
    for name, (mean, error) in found.items():
        assert error.item() < 0.04 * mean.item(), f"{name} is too noisy to tell"


@pytest.mark.parametrize("max_bounces", [None, 0, 1])
@pytest.mark.parametrize("sky", [(0, 0, 0), (0.3, 0.4, 0.5)])
def test_mis_and_bdpt_agree_outdoors(sky, max_bounces):
    how = {"sky": sky, "max_bounces": max_bounces}
    one = blocks(picture(open_yard(), YARD_CAMERA, "mis", 50, **how), 4)
    other = blocks(picture(open_yard(), YARD_CAMERA, "bdpt", 50, **how), 4)
    z = (one[0] - other[0]) / np.hypot(one[1], other[1])
    assert np.abs(z).max() < critical(6 * z.size)
    assert np.hypot(one[1], other[1]).sum() < 0.05 * one[0].sum()


def test_mis_and_bdpt_agree_in_each_part_of_a_room():
    one = blocks(picture(glossy_room(), ROOM_CAMERA, "mis", 120), 4)
    other = blocks(picture(glossy_room(), ROOM_CAMERA, "bdpt", 80), 4)
    z = (one[0] - other[0]) / np.hypot(one[1], other[1])
    assert np.abs(z).max() < critical(z.size)


def mirrored_light():
    """Return a floor beside a perfect mirror under a point light, and a camera that sees only the floor."""
    floor = Quad((-2, -2, 0), (4, 0, 0), (0, 4, 0), glossy((0.6, 0.6, 0.6), 0.0, 1.0))
    mirror = Quad((1, 2, 0), (0, -4, 0), (0, 0, 3), glossy((1.0, 1.0, 1.0), 1.0, 0.0))
    light = PunctualLight("point", "p", 0, (1.0, 1.0, 1.0), (0.4, 0.1, 0.8))
    return replace(quad_scene([floor, mirror]), lights=(light,)), look_at((0, -0.4, 1.5), (0.1, 0.1, 0), 46.0)


def test_a_light_behind_a_mirror_lights_as_its_image_does():
    # Only paths that start at the light carry light from the mirror to the floor. A path that starts at the
    # eye never hits a point light.
    scene, camera = mirrored_light()
    mean, error, _ = picture(scene, camera, "bdpt", 180, size=4, samples=1024)
    # Closed form: radiance of the floor from the light and its mirror image, averaged over each pixel.
    fine = (np.arange(64) + 0.5) / 64 * 2 - 1
    x, y = np.meshgrid(fine, -fine)
    high = math.tan(0.5 * camera.fov)
    way = np.array(camera.forward) + high * (x[..., None] * camera.right + y[..., None] * np.array(camera.up))
    eye = np.array(camera.position)
    place = eye - way * (eye[2] / way[..., 2:])
    row, value = np.zeros((5, 16)), np.zeros(3)
    row[:, 0] = (0.6, 0.6, 0.6, 0.0, 1.0)
    light = np.zeros((64, 64))
    for position in ((0.4, 0.1, 0.8), (1.6, 0.1, 0.8)):
        to_light = np.array(position) - place
        square = (to_light**2).sum(axis=-1)
        to_light /= np.sqrt(square)[..., None]
        to_eye = -way / np.linalg.norm(way, axis=-1, keepdims=True)
        for i in np.ndindex(64, 64):
            bsdf_eval(row, 0, *to_eye[i], *to_light[i], value)
            light[i] += value[0] / square[i]
    truth = light.reshape(4, 16, 4, 16).mean(axis=(1, 3))
    z = (mean[..., 0] - truth) / error[..., 0]
    assert np.abs(z).max() < critical(z.size, 179)
    away, noise = mean[..., 0].mean() / truth.mean() - 1, np.linalg.norm(error[..., 0]) / truth.sum()
    assert abs(away) < min(3 * noise, 0.002)
    assert 3 * noise < 0.002
    # The mirror image contributes about a sixth of the light, so the comparison tests it.
    alone, _, _ = picture(scene, camera, "mis", 4, size=4, samples=64)
    assert alone.mean() < 0.9 * truth.mean()


def gap_room():
    """Return two rooms joined by a gap. One room has an emitter that faces the ceiling."""
    walls = box_quads((0, 0, 0), (4, 2, 2), inward=True, material=grey(0.7))
    screen = [
        Quad((2, 0, 0), (0, 0.95, 0), (0, 0, 2), grey(0.7, double_sided=True)),
        Quad((2, 1.05, 0), (0, 0.95, 0), (0, 0, 2), grey(0.7, double_sided=True)),
    ]
    emitter = Quad((1.4, 0.85, 1.9), (0.3, 0, 0), (0, 0.3, 0), grey(0, 20.0))
    return quad_scene([*walls, *screen, emitter])


def test_bdpt_has_less_variance_behind_a_gap():
    position = np.random.default_rng(4).uniform((2.2, 0.2, 0), (3.8, 1.8, 0), (128, 1, 3))
    up = np.broadcast_to((0.0, 0.0, 1.0), position.shape).copy()
    cost, mean = {}, {}
    for name in ("mis", "bdpt"):
        with build_reference(gap_room(), lambertian=True, threads=2) as reference:
            estimate = new_estimate(128, 3, 16)
            for _ in range(40):
                irradiance_pass(reference, estimate, position, up, up, options=PassOptions(name))
        mean[name] = estimate.mean[:, 0], estimate.standard_error[:, 0]
        cost[name] = (estimate.standard_error[:, 0] ** 2).mean() * estimate.rays
    away = abs(mean["mis"][0].sum() - mean["bdpt"][0].sum())
    assert away < critical(1) * math.sqrt((mean["mis"][1] ** 2).sum() + (mean["bdpt"][1] ** 2).sum())
    assert cost["bdpt"] < 0.6 * cost["mis"]


def test_bdpt_has_less_variance_on_a_caustic():
    # A small emitter over a mirror lights the wall above; paths from the eye rarely find it.
    quads = [
        Quad((0, 0, 0), (1, 0, 0), (0, 1, 0), glossy((0.95, 0.95, 0.95), 1.0, 0.0)),
        Quad((0, 1, 0), (1, 0, 0), (0, 0, 1), glossy((0.7, 0.7, 0.7), 0.0, 1.0)),
        Quad((0.45, 0.4, 0.6), (0, 0.05, 0), (0.05, 0, 0), grey(0.0, 50.0)),
    ]
    camera = look_at((0.5, -1.5, 0.9), (0.5, 1.0, 0.7), 12.0)
    found = {name: picture(quad_scene(quads), camera, name, 30) for name in ("mis", "bdpt")}
    one, other = blocks(found["mis"], SIZE), blocks(found["bdpt"], SIZE)
    assert abs(one[0] - other[0]) < critical(1) * np.hypot(one[1], other[1])
    cost = {name: (error**2).mean() * rays for name, (_, error, rays) in found.items()}
    assert cost["bdpt"] < 0.1 * cost["mis"]


def test_same_bytes_whatever_the_threads_and_blocks(monkeypatch):
    light = PunctualLight("point", "p", 0, (0.4, 0.4, 0.4), (0.4, 1.6, 1.2))
    how = {"size": 48, "samples": 2}
    one = picture(glossy_room((light,)), ROOM_CAMERA, "bdpt", 2, threads=1, **how)
    monkeypatch.setattr(bidirectional_pass, "_BLOCK", 1024)
    other = picture(glossy_room((light,)), ROOM_CAMERA, "bdpt", 2, threads=3, **how)
    assert one[0].tobytes() == other[0].tobytes()
    assert one[1].tobytes() == other[1].tobytes()
