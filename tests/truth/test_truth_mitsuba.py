"""Pictures and irradiance of the project's scenes agree with Mitsuba 3 within the standard errors of both.

pip install -e '.[mitsuba]' && pytest -m mitsuba
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from ztest import critical

from baker.io.load import load_scene
from baker.pathtracer.estimators import PassOptions
from baker.pathtracer.first_hit import first_hits
from baker.pathtracer.irradiance import irradiance_pass
from baker.pathtracer.point_estimate import new_estimate
from baker.pathtracer.radiance import radiance_pass
from baker.pathtracer.scene import build_reference

pytestmark = pytest.mark.mitsuba
ROOT = Path(__file__).parents[2]
SCENES = ["cornell", "interior", "hall"]
WIDTH, HEIGHT, BLOCK, BATCHES = 32, 24, 4, 12


@pytest.fixture(scope="module")
def mi():
    import mitsuba

    mitsuba.set_variant("scalar_rgb")
    sys.path.insert(0, str(ROOT / "benchmarks"))
    yield mitsuba
    sys.path.remove(str(ROOT / "benchmarks"))


def opened(name, **change):
    """Return a scene and its `Reference` for the path tracer, with flat normals and Lambertian materials."""
    from mitsuba_scene import flat

    scene = replace(load_scene(ROOT / "assets" / f"{name}.glb"), **change)
    return scene, flat(build_reference(scene, lambertian=True, threads=2))


def batches(values):
    """Return the mean over axis 0 and its standard error."""
    return values.mean(axis=0), values.std(axis=0, ddof=1) / np.sqrt(len(values))


def compare(ours, theirs, least):
    """Compare the results (mean, error) of both programs, value by value and summed over all values."""
    # The second term avoids a division by 0 where neither program has noise.
    error = np.hypot(ours[1], theirs[1]) + 1e-9 * theirs[0].max()
    z = (ours[0] - theirs[0]) / error
    assert np.abs(z).max() < critical(z.size, BATCHES - 1)
    # Use the green channel for the sum, because the colours have the same paths.
    total = (ours[0] - theirs[0])[..., 1].sum()
    spread = np.sqrt((error[..., 1] ** 2).sum())
    assert abs(total) < critical(1, BATCHES - 1) * spread
    assert spread < least * theirs[0][..., 1].sum()


@pytest.mark.parametrize("estimator", ["mis", "bdpt"])
@pytest.mark.parametrize("name", SCENES)
def test_pictures(mi, name, estimator):
    from mitsuba_scene import mitsuba_camera, mitsuba_scene

    scene, reference = opened(name)
    camera = scene.cameras[0]
    with reference:
        theirs = mitsuba_scene(scene, reference, sensor=mitsuba_camera(camera, WIDTH, HEIGHT))
        path = mi.load_dict({"type": "path", "max_depth": -1, "rr_depth": 8})
        shape = (BATCHES, HEIGHT // BLOCK, BLOCK, WIDTH // BLOCK, BLOCK, 3)
        seen = [np.array(mi.render(theirs, integrator=path, spp=96, seed=1 + k)) for k in range(BATCHES)]
        expected = batches(np.stack(seen).astype(float).reshape(shape).mean(axis=(2, 4)))
        own = []
        for k in range(BATCHES):
            options = PassOptions(estimator, seed=k)
            estimate = new_estimate(WIDTH * HEIGHT, 3, 32)
            for _ in range(2):
                radiance_pass(reference, estimate, camera, WIDTH, HEIGHT, options=options)
            own.append(estimate.mean)
    compare(batches(np.stack(own).reshape(shape).mean(axis=(2, 4))), expected, 0.01)


@pytest.mark.parametrize("name", SCENES)
def test_irradiance(mi, name):
    from mitsuba_scene import mitsuba_scene

    # Mitsuba's irradiance meter does not sample lights without area, so use emitters only.
    scene, reference = opened(name, lights=())
    camera, side, n_places = scene.cameras[0], 0.02, 64
    with reference:
        # Place small squares on visible surfaces that are flat and free of other objects.
        x, y = np.meshgrid((-0.5, 0.1, 0.6), (0.45, -0.1, -0.6))
        high = np.tan(0.5 * camera.fov)
        way = np.array(camera.forward) + high * (
            x.reshape(-1, 1) * np.array(camera.right) + y.reshape(-1, 1) * np.array(camera.up)
        )
        hits = first_hits(reference, np.array(camera.position), way / np.linalg.norm(way, axis=1)[:, None])
        flat = [i for i in np.flatnonzero(hits.lit) if _clear(reference, hits, i, side)]
        assert len(flat) >= 3
        expected, own = [], []
        sensors = {}
        place = np.zeros((len(flat), n_places, 3))
        normal = np.zeros_like(place)
        rng = np.random.default_rng(1)
        for k, i in enumerate(flat):
            n = hits.face_normal[i]
            a = np.cross(n, (0, 1, 0) if abs(n[1]) < 0.9 else (1, 0, 0))
            a /= np.linalg.norm(a)
            b = np.cross(n, a)
            centre = hits.position[i] + 1e-4 * n
            matrix = np.eye(4)
            matrix[:3, :4] = np.stack([0.5 * side * a, 0.5 * side * b, n, centre], axis=1)
            sensors[f"square{k}"] = {
                "type": "rectangle", "to_world": mi.ScalarTransform4f(matrix.tolist()),
                "sensor": {
                    "type": "irradiancemeter",
                    "film": {
                        "type": "hdrfilm", "width": 1, "height": 1, "rfilter": {"type": "box"},
                        "pixel_format": "rgb", "component_format": "float32",
                    },
                },
            }  # fmt: skip
            u = rng.uniform(-0.5, 0.5, (n_places, 2)) * side
            place[k] = centre + u[:, :1] * a + u[:, 1:] * b
            normal[k] = n
        theirs = mitsuba_scene(scene, reference, **sensors)
        path = mi.load_dict({"type": "path", "max_depth": -1, "rr_depth": 8})
        for seed in range(BATCHES):
            seen = [
                np.array(mi.render(theirs, sensor=k, integrator=path, spp=20_000, seed=seed)).reshape(3)
                for k in range(len(flat))
            ]
            expected.append(seen)
            estimate = new_estimate(len(flat), 3, n_places)
            for _ in range(128):
                irradiance_pass(reference, estimate, place, normal, normal, options=PassOptions(seed=seed))
            own.append(estimate.mean)
    compare(batches(np.array(own)), batches(np.array(expected, float)), 0.02)


def _clear(reference, hits, i, side):
    """Return whether the square around hit i lies on one plane and no other surface is close above it."""
    n = hits.face_normal[i]
    a = np.cross(n, (0, 1, 0) if abs(n[1]) < 0.9 else (1, 0, 0))
    a /= np.linalg.norm(a)
    corner = hits.position[i] + side * np.array(
        [[s * a + t * np.cross(n, a)] for s in (-1, 1) for t in (-1, 1)]
    )
    above = corner.reshape(-1, 3) + 0.01 * n
    for point in above:
        below = first_hits(reference, point, -n[None])
        if not below.lit[0] or abs(below.depth[0] - 0.01) > 1e-5 or below.face_normal[0] @ n < 0.99999:
            return False
    return True
