"""A kind of light is one file: a new one is taken everywhere, an unknown one is refused everywhere."""

from __future__ import annotations

import importlib
import json
import sys
from dataclasses import replace

import numpy as np
import pytest
from tiny_scenes import Quad, box_quads, grey, quad_scene, world_of

import baker.lights.families
from baker.checks.context import CheckContext
from baker.checks.in_bake import bake_warnings
from baker.checks.run import check_scene
from baker.checks.settings import CheckSettings
from baker.core import light_kind
from baker.core.errors import InputError
from baker.core.light_kind import LIGHT_KINDS, kind_of
from baker.core.scene import PunctualLight
from baker.core.settings import make_settings
from baker.io.gltf.build_document import new_document
from baker.pathtracer.scene import build_reference
from baker.pipeline.bake import bake
from baker.radiosity.direct import direct_light
from baker.rendering.render import render
from baker.rendering.settings import RenderSettings
from baker.topology.solids import lights_and_cameras
from baker.uv.unwrap import unwrap_scene
from baker.verification.settings import VerifySettings
from baker.verification.verify import verify

SETTINGS = make_settings({"resolution": 64, "samples": 16, "denoise": False})
OCCLUSION = make_settings({"resolution": 64, "samples": 16, "denoise": False, "channels": ("ao",)})
MOON = '''
"""Moonlight: parallel light, weak."""

import numpy as np

from baker.core.light_kind import LIGHT_KINDS, Distribution, LightKind


def moonlight(light, origin, normal, ray, weight):
    ray[..., :3], ray[..., 3] = -np.float32(light.direction), 1e30
    weight[:] = np.maximum(-(normal @ np.float32(light.direction)), 0)


MOON = LIGHT_KINDS.register("moon")(
    LightKind("moon", "lx", True, Distribution.PARALLEL, "moon", 0.3, moonlight, lambda light, disc: disc)
)
'''


def lit_by(*lights):
    """A floor with a block on it, below lights."""
    floor = Quad((-1, 0, 1), (2, 0, 0), (0, 0, -2), grey(0.5))
    block = box_quads((-0.3, 0, -0.3), (0.2, 0.4, 0.3), inward=False, material=grey(0.6))
    return replace(quad_scene([floor, *block]), lights=lights)


def shining(kind, intensity=2.0):
    return PunctualLight(kind, "night", 7, (intensity,) * 3, (0.4, 2.0, 0.3), (0.48, -0.8, 0.36))


@pytest.fixture
def moon(tmp_path, monkeypatch):
    """Add one file to `baker.lights.families`."""
    LIGHT_KINDS.names()
    (tmp_path / "moon.py").write_text(MOON)
    monkeypatch.setattr(baker.lights.families, "__path__", [*baker.lights.families.__path__, str(tmp_path)])
    monkeypatch.setattr(LIGHT_KINDS, "_plugins", dict(LIGHT_KINDS._plugins))
    monkeypatch.setattr(LIGHT_KINDS, "_searched", False)
    importlib.invalidate_caches()
    yield
    sys.modules.pop("baker.lights.families.moon", None)
    vars(baker.lights.families).pop("moon", None)


@pytest.mark.usefixtures("moon")
def test_a_kind_added_by_one_file_is_taken_by_all(tmp_path):
    """Baked, written, read, verified, rendered and checked, with the numbers of the sun that it is."""
    out = tmp_path / "out"
    found = bake(lit_by(shining("moon")), settings=SETTINGS, out=out)
    same = bake(lit_by(shining("directional")), settings=SETTINGS)
    light, expected = (result.lightmaps["irradiance"].value for result in (found, same))
    assert expected.max() > 1.5
    np.testing.assert_allclose(light, expected, rtol=1e-5, atol=1e-6)

    entry = json.loads((out / "bake.json").read_text())["lights"][0]
    assert (entry["kind"], entry["unit"]) == ("moon", "lx")
    assert "position" not in entry
    assert "direction" in entry

    verified = verify(out, VerifySettings(texels=200, spp=64))
    assert verified.bake.scene.lights[0].kind == "moon"
    assert verified.passed, verified.problems

    view = RenderSettings(camera="0,1.5,3,0,0.2,0,40", width=32, height=24, spp=8)
    picture, sunlit = (render(lit_by(shining(kind)), view).colour for kind in ("moon", "directional"))
    assert picture.max() > 0.1
    np.testing.assert_array_equal(picture, sunlit)

    report = check_scene(out / "scene.glb", CheckSettings(), SETTINGS)
    (finding,) = (f for f in report.findings if f.code == "light-intensity")
    assert "the moon light has 2 lx" in finding.message


def laser():
    return lit_by(shining("point"), shining("laser", 0.0))


def reference(scene):
    with build_reference(scene, sky=(0.0, 0.0, 0.0), threads=1):
        pass


def direct(scene):
    world = world_of(scene, unwrap_scene(scene, SETTINGS))
    direct_light(world.job(), scene.lights, world.sampling(16, 16))


REFUSERS = {
    "bake": lambda scene: bake(scene, settings=SETTINGS),
    "bake of ao": lambda scene: bake(scene, settings=OCCLUSION),
    "render": lambda scene: render(scene, RenderSettings(camera="0,1,2,0,0,0,50", width=8, height=8, spp=2)),
    "direct light": direct,
    "path tracer": reference,
    "checks": lambda scene: CheckContext(scene, SETTINGS),
    "checks of a bake": lambda scene: bake_warnings(scene, SETTINGS),
    "solids": lights_and_cameras,
    "glTF": lambda scene: new_document(scene, unwrap_scene(scene, SETTINGS)),
}


@pytest.mark.parametrize("name", REFUSERS)
def test_an_unknown_kind_is_an_error_also_of_a_light_that_is_off(name):
    with pytest.raises(InputError) as caught:
        REFUSERS[name](laser())
    assert str(caught.value) == (
        "light 'night': 'laser' is no known kind of light; known are directional, point, spot"
    )
    # The same call with a known kind is no error.
    REFUSERS[name](lit_by(shining("point"), shining("spot", 0.0)))


@pytest.mark.parametrize("judge", ["verify", "check", "render"])
def test_a_file_with_an_unknown_kind_is_refused(judge, tmp_path):
    out = tmp_path / "out"
    bake(lit_by(shining("point")), settings=SETTINGS, out=out)
    path = out / "scene.glb"
    data = path.read_bytes()
    assert data.count(b'"point"') == 1
    path.write_bytes(data.replace(b'"point"', b'"laser"'))
    work = {
        "verify": lambda: verify(out, VerifySettings(texels=10, spp=2)),
        "check": lambda: check_scene(path, CheckSettings(), SETTINGS),
        "render": lambda: render(path, RenderSettings(camera="0,1,2,0,0,0,50", width=8, height=8, spp=2)),
    }
    with pytest.raises(InputError, match="'laser' is none of directional, point, spot"):
        work[judge]()


@pytest.mark.parametrize(
    "change", [{"distribution": "a distribution without kernels"}, {"delta": False}], ids=["shape", "area"]
)
def test_the_path_tracer_refuses_what_it_has_no_kernels_for(change, monkeypatch):
    odd = replace(kind_of(shining("point")), name="odd", **change)
    monkeypatch.setattr(LIGHT_KINDS, "_plugins", {**LIGHT_KINDS._plugins, "odd": odd})
    with pytest.raises(InputError, match="no kernels for odd lights"):
        reference(lit_by(shining("odd")))


def test_what_gltf_cannot_hold_is_not_written(monkeypatch):
    scene = lit_by(shining("odd"))
    odd = replace(kind_of(shining("point")), name="odd", gltf_type=None)
    monkeypatch.setattr(LIGHT_KINDS, "_plugins", {**LIGHT_KINDS._plugins, "odd": odd})
    assert None not in light_kind.kinds_by_gltf_type()
    with pytest.raises(InputError, match="has no odd lights"):
        new_document(scene, unwrap_scene(scene, SETTINGS))
