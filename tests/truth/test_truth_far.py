"""A room far from the origin is baked, verified, checked, rendered and compared as one at the origin."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scenes import SceneBuilder

from baker.checks.context import CheckContext
from baker.comparison.compare import compare
from baker.core.settings import make_settings
from baker.pathtracer.camera import look_at
from baker.pathtracer.estimators import PassOptions
from baker.pathtracer.irradiance import ambient_occlusion_pass
from baker.pathtracer.point_estimate import new_estimate
from baker.pathtracer.radiance import radiance_pass
from baker.pathtracer.scene import build_reference
from baker.pipeline.bake import bake
from baker.verification.verify import VerifySettings, verify

# Translation of the far room, metres; multiples of powers of two, so that float32 positions stay exact.
FAR = np.array([131_072.0, 0.0, -65_536.0])
SETTINGS = make_settings({
    "resolution": 64, "uv": "keep", "padding": 2, "threads": 2, "samples": 32, "denoise": False,
    "channels": ["irradiance", "ao"],
})  # fmt: skip


def room(at=None):
    """Return a scene of a lit room with a crate; `at` is the translation of its nodes."""
    builder = SceneBuilder(64)
    white = builder.material(0.6)
    builder.box((-1, 0, -1), (1, 2, 1), white, 12, inward=True)
    builder.box((-0.5, 0.0, -0.5), (-0.25, 0.5, -0.25), white, 6)
    builder.quad((0.2, 1.9, 0.2), (0.25, 0, 0), (0, 0, 0.25), builder.material(0.0, 20.0), (3, 3))
    builder.light("point", 0.5, position=(0.5, 1.0, -0.5), range=3.0)
    scene = builder.build()
    if at is None:
        return scene
    matrix = np.eye(4)
    matrix[:3, 3] = at
    light = scene.lights[0]
    return replace(
        scene,
        instances=tuple(replace(i, world_from_object=matrix) for i in scene.instances),
        lights=(replace(light, position=tuple(np.array(light.position) + at)),),
    )


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    """Bake the room at the origin and at `FAR`, and return folders and results."""
    place = tmp_path_factory.mktemp("far")
    found = {"near": place / "near", "far": place / "far"}
    found["results"] = [
        bake(scene, settings=SETTINGS, out=found[name])
        for name, scene in (("near", room()), ("far", room(FAR)))
    ]
    return found


def test_the_maps_are_the_same(folders):
    near, far = folders["results"]
    for name in ("irradiance", "ao"):
        one, two = near.lightmaps[name].value, far.lightmaps[name].value
        assert one.max() > 0
        # The origin of the far bake differs from `FAR`, so its coordinates are rounded differently.
        covered = near.status == 1
        away = np.abs(one - two)[covered] / one[covered].mean()
        assert np.median(away) < 1e-4, name
        assert np.quantile(away, 0.99) < 0.02, name


def test_the_reference_finds_the_far_bake_right_and_says_where(folders):
    found = verify(folders["far"], VerifySettings(texels=200, spp=64))
    figures = found.channels["irradiance"].metrics
    assert abs(figures["bias"]) < 0.03
    for entry in found.worst:
        assert np.abs(np.array(entry["position"]) - FAR - (0, 1, 0)).max() <= 1.001


def test_check_sees_the_light_where_it_is():
    near, far = (CheckContext(scene, SETTINGS).levels for scene in (room(), room(FAR)))
    np.testing.assert_allclose(far.irradiance.mean(), near.irradiance.mean(), rtol=1e-3)


@pytest.mark.parametrize("estimator", ["mis", "bdpt"])
def test_pictures_are_taken_from_cameras_in_the_world(estimator):
    camera = look_at((0.9, 1.0, 0.9), (-0.3, 0.7, -0.3), 70.0)
    seen = []
    for at in (np.zeros(3), FAR):
        moved = replace(camera, position=tuple(np.array(camera.position) + at))
        with build_reference(room(at if at.any() else None), threads=2) as reference:
            estimate = new_estimate(16 * 16, 3, 16)
            radiance_pass(reference, estimate, moved, 16, 16, options=PassOptions(estimator))
        seen.append(estimate.mean)
    assert seen[0].mean() > 0.01
    np.testing.assert_allclose(seen[1].mean(), seen[0].mean(), rtol=0.01)


def test_diff_finds_the_far_surface(folders):
    found = compare(folders["far"], folders["far"])
    assert found.unmatched == 0
    assert found.channels["irradiance"].metrics["max"] == 0
    moved = compare(folders["near"], folders["far"])
    assert moved.channels["irradiance"].metrics["median"] < 1e-3


@pytest.mark.parametrize("around", ["nothing", "sky", "terrain", "centimetres"])
def test_a_wall_of_a_centimetre_shades_the_floor_whatever_is_around(around):
    """AO is (1 + d / sqrt(d^2 + h^2)) / 2 at a distance d from a long wall of height h in any scene."""
    unit = 100.0 if around == "centimetres" else 1.0
    at = {"terrain": (900.0, 0.0, -700.0), "centimetres": (3e4, 0.0, 5e4)}.get(around, (0.0, 0.0, 0.0))
    h, builder = 0.01 * unit, SceneBuilder(64)
    black = builder.material(0.0)
    x, y, z = at
    floor = builder.quad((x, y, z - h), (0, 0, 2 * h), (3 * h, 0, 0), black, (4, 16))
    builder.quad((x, y, z - 50 * h), (0, h, 0), (0, 0, 100 * h), black, (2, 2))
    if around == "sky":
        builder.box((-1e5, -1e5, -1e5), (1e5, 1e5, 1e5), black, 2, inward=True)
    if around == "terrain":
        builder.quad((-5000, -30, -5000), (0, 0, 1e4), (1e4, 0, 0), black, (2, 2))
    result = builder.bake(channels=["ao"], ao_distance=str(0.5 * unit), ao_samples=4096, samples=16)
    found = floor.values(result, "ao")[:, 1:3, 0].mean(axis=1)
    wide = 3 * h / 16
    d = (np.arange(16)[:, None] + (np.arange(64) + 0.5) / 64) * wide
    truth = (0.5 * (1 + d / np.hypot(d, h))).mean(axis=1)
    # The tolerance is for the noise of 8192 rays, whose standard deviation is at most 0.0055, and for the
    # ends of the wall, which are 50 heights away.
    np.testing.assert_allclose(found, truth, atol=0.012)


def test_the_reference_sees_the_same_wall_below_a_sky_of_100_km():
    h, builder = 0.01, SceneBuilder(64)
    black = builder.material(0.0)
    builder.quad((0, 0, -h), (0, 0, 2 * h), (3 * h, 0, 0), black, (4, 16))
    builder.quad((0, 0, -50 * h), (0, h, 0), (0, 0, 100 * h), black, (2, 2))
    builder.box((-1e5, -1e5, -1e5), (1e5, 1e5, 1e5), black, 2, inward=True)
    d = np.array([0.1, 0.5, 1.0, 2.0]) * h
    place = np.stack([d, 0 * d, 0 * d], axis=1)[:, None]
    up = np.tile([0.0, 1.0, 0.0], (len(d), 1, 1))
    with build_reference(builder.build(), threads=2) as reference:
        estimate = new_estimate(len(d), 1, 256)
        for _ in range(16):
            ambient_occlusion_pass(reference, estimate, place, up, up, distance=0.5)
    np.testing.assert_allclose(estimate.mean[:, 0], 0.5 * (1 + d / np.hypot(d, h)), atol=0.02)
