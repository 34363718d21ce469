"""One file adds a kind of light for all commands; a light of an unknown kind is an error in all commands."""

from __future__ import annotations

import importlib
import json
import sys
from dataclasses import replace

import numpy as np
import pytest
import test_lights
from tiny_scenes import Quad, box_quads, grey, quad_scene, world_of

import baker.lights.kinds
from baker.checks.context import CheckContext
from baker.checks.in_bake import bake_warnings
from baker.checks.run import check_scene
from baker.checks.settings import CheckSettings
from baker.core.errors import InputError
from baker.core.light_kind import LIGHT_KINDS, kind_of, kinds_by_gltf_type
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

from baker.core.light_kind import LIGHT_KINDS, EmissionProfile, LightKind


def moonlight(light, origin, normal, ray, weight):
    ray[..., :3], ray[..., 3] = -np.float32(light.direction), 1e30
    weight[:] = np.maximum(-(normal @ np.float32(light.direction)), 0)


MOON = LIGHT_KINDS.register("moon")(
    LightKind(
        name="moon", unit="lx", has_position=False, has_direction=True, gltf_type="moon", plausible_max=0.3,
        read=lambda json, world_from_light: {}, write=lambda light: {},
        describe=lambda light: {"direction": light.direction}, fill=moonlight,
        emission=lambda light: EmissionProfile(None, light.direction), power=lambda light, disc: disc,
    )
)
'''
BEACON = '''
"""A beacon: I(w) = I max(c, 0)^n (1 - s^2 (1 - cos(phi - 0.7)) / 2), with a parameter n of its own.

c and s are cosine and sine of the angle to its axis, phi the azimuth.
"""

import math

import numpy as np

from baker.core.light_kind import LIGHT_KINDS, EmissionProfile, LightKind

# Between entries of the table, linear interpolation is off by less than 2e-5.
COSINES, AZIMUTHS = 1024, 512


def frame(light):
    axis = np.array(light.direction)
    tangent = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    tangent /= np.linalg.norm(tangent)
    return axis, tangent, np.cross(axis, tangent)


def fall_off(cosine, azimuth, sharpness):
    cosine = np.clip(cosine, 0, 1)
    return cosine**sharpness * (1 - (1 - cosine**2) * (0.5 - 0.5 * np.cos(azimuth - 0.7)))


def beam(light, origin, normal, ray, weight):
    axis, tangent, bitangent = frame(light)
    # Shadow rays end just before the light.
    ray[..., :3], ray[..., 3] = np.array(light.position) - origin, 0.99999
    length = np.maximum(np.linalg.norm(ray[..., :3], axis=-1), 1e-10)
    away = -ray[..., :3] / length[..., None]
    azimuth = np.arctan2(away @ bitangent, away @ tangent)
    share = fall_off(away @ axis, azimuth, light.parameters["sharpness"])
    weight[:] = np.maximum(-(away * normal).sum(axis=-1), 0) / length**2 * share


def emission(light):
    cosine, azimuth = np.linspace(0, 1, COSINES)[:, None], 2 * np.pi * np.arange(AZIMUTHS) / AZIMUTHS
    table = fall_off(cosine, azimuth, light.parameters["sharpness"]).astype(np.float32)
    tangent = tuple(frame(light)[1])
    return EmissionProfile(light.position, light.direction, min_cosine=0.0, table=table, tangent=tangent)


BEACON = LIGHT_KINDS.register("beacon")(
    LightKind(
        name="beacon", unit="cd", has_position=True, has_direction=True, gltf_type="beacon",
        plausible_max=90.0,
        read=lambda json, world_from_light: {"parameters": {"sharpness": json.number("sharpness", low=0.0)}},
        write=lambda light: {"sharpness": light.parameters["sharpness"]},
        describe=lambda light: {
            "position": light.position, "direction": light.direction, **light.parameters
        },
        fill=beam, emission=emission,
        power=lambda light, disc: 2 * math.pi / (light.parameters["sharpness"] + 1),
    )
)
'''


def lit_by(*lights):
    """Return a scene of a floor with a block on it, lit by `lights`."""
    floor = Quad((-1, 0, 1), (2, 0, 0), (0, 0, -2), grey(0.5))
    block = box_quads((-0.3, 0, -0.3), (0.2, 0.4, 0.3), inward=False, material=grey(0.6))
    return replace(quad_scene([floor, *block]), lights=lights)


def shining(kind, intensity=2.0):
    return PunctualLight(kind, "night", 7, (intensity,) * 3, (0.4, 2.0, 0.3), (0.48, -0.8, 0.36))


@pytest.fixture
def add_kind(tmp_path, monkeypatch):
    """Return a function that adds one file to `baker.lights.kinds`."""
    LIGHT_KINDS.names()
    monkeypatch.setattr(baker.lights.kinds, "__path__", [*baker.lights.kinds.__path__, str(tmp_path)])
    monkeypatch.setattr(LIGHT_KINDS, "_plugins", dict(LIGHT_KINDS._plugins))
    added = []

    def add(name, text):
        (tmp_path / f"{name}.py").write_text(text)
        monkeypatch.setattr(LIGHT_KINDS, "_searched", False)
        importlib.invalidate_caches()
        added.append(name)

    yield add
    for name in added:
        sys.modules.pop(f"baker.lights.kinds.{name}", None)
        vars(baker.lights.kinds).pop(name, None)


def test_a_kind_added_by_one_file_is_taken_by_all(tmp_path, add_kind):
    """The kind "moon" gives the same bake and picture as "directional"; `verify` and `check` accept it."""
    add_kind("moon", MOON)
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


def test_a_kind_with_a_fall_off_of_its_own_is_taken_by_all(tmp_path, add_kind):
    """The bake evaluates the kind's kernel, the path tracer evaluates its table; `verify` compares them."""
    add_kind("beacon", BEACON)
    out = tmp_path / "out"
    light = replace(shining("beacon", 100.0), parameters={"sharpness": 3.0})
    bake(lit_by(light), settings=SETTINGS, out=out)
    assert json.loads((out / "bake.json").read_text())["lights"][0]["sharpness"] == 3.0
    verified = verify(out, VerifySettings(texels=200, spp=64))
    assert verified.bake.scene.lights[0].parameters == {"sharpness": 3.0}
    assert verified.passed, verified.problems
    report = check_scene(out / "scene.glb", CheckSettings(), SETTINGS)
    (finding,) = (f for f in report.findings if f.code == "light-intensity")
    assert "the beacon light has 100 cd" in finding.message

    # If the bake mirrors the azimuth of the same light, `verify` fails.
    text = BEACON.replace("away @ axis, azimuth, ", "away @ axis, -azimuth, ")
    assert text != BEACON
    mirrored = replace(LIGHT_KINDS.get("beacon"), fill=_fill_of(text))
    LIGHT_KINDS._plugins["beacon"] = mirrored
    bake(lit_by(light), settings=SETTINGS, out=out, force=True)
    assert not verify(out, VerifySettings(texels=200, spp=64)).passed


def beacon_truth(point, normal):
    """Return the closed form of E from a `BEACON` of sharpness 3, placed like the light of `test_lights`."""
    way, _, cosine = test_lights.toward(point)
    tangent = np.cross(test_lights.DIRECTION, [0, 0, 1]) / np.hypot(0.48, 0.8)
    turn = np.arctan2(-way @ np.cross(test_lights.DIRECTION, tangent), -way @ tangent)
    share = 1 - (1 - cosine**2) * np.sin((turn - 0.7) / 2) ** 2
    return test_lights.point_truth(point, normal) * np.maximum(cosine, 0) ** 3 * share


def test_the_example_keeps_the_contract(add_kind, monkeypatch):
    """The example that CONTRIBUTING.md names passes the contract tests of lights."""
    add_kind("beacon", BEACON)
    monkeypatch.setitem(test_lights.TRUTH, "beacon", beacon_truth)
    monkeypatch.setitem(test_lights.PARAMETERS, "beacon", {"sharpness": 3.0})
    test_lights.test_every_kind_has_a_closed_form()
    test_lights.test_a_record_agrees_with_what_its_light_does("beacon")
    test_lights.test_what_is_written_is_read("beacon", np.inf)
    test_lights.test_the_profile_for_the_path_tracer_is_the_same_light("beacon", np.inf)
    test_lights.test_power_is_the_flux_or_a_bound_of_it("beacon", 0.0)
    test_lights.test_unoccluded_irradiance_equals_the_closed_form("beacon")
    test_lights.test_rays_end_just_before_the_light("beacon")
    test_lights.test_a_candela_a_metre_and_a_lux("beacon")
    test_lights.test_no_points_and_points_at_the_light("beacon")


def _fill_of(text):
    names = {}
    exec(text.split("BEACON = ")[0], names)
    return names["beam"]


@pytest.mark.parametrize("estimator", ["light", "bdpt"])
def test_all_estimators_agree_on_a_tabulated_light(add_kind, estimator):
    """`light` and `bdpt` give the same mean picture as `mis`. `bdpt` also starts paths at the light."""
    add_kind("beacon", BEACON)
    light = replace(shining("beacon", 100.0), parameters={"sharpness": 3.0})
    view = RenderSettings(camera="0,1.5,3,0,0.2,0,40", width=8, height=6, spp=256)
    expected, found = (
        render(lit_by(light), view.model_copy(update={"estimator": name})).colour.mean(axis=(0, 1))
        for name in ("mis", estimator)
    )
    np.testing.assert_allclose(found, expected, rtol=0.02)


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
        f"light 'night': there is no kind of light 'laser'; known are {', '.join(LIGHT_KINDS.names())}"
    )
    # The function accepts lights of known kinds.
    REFUSERS[name](lit_by(shining("point"), shining("spot", 0.0)))


@pytest.mark.parametrize("command", ["verify", "check", "render"])
def test_a_file_with_an_unknown_kind_is_refused(command, tmp_path):
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
    with pytest.raises(InputError, match=f"'laser' is none of {', '.join(kinds_by_gltf_type())}"):
        work[command]()


@pytest.mark.parametrize("change", [{"emission": None}, {"delta": False}], ids=["shape", "area"])
def test_the_path_tracer_refuses_what_it_has_no_kernels_for(change, monkeypatch):
    odd = replace(kind_of(shining("point")), name="odd", **change)
    monkeypatch.setattr(LIGHT_KINDS, "_plugins", {**LIGHT_KINDS._plugins, "odd": odd})
    with pytest.raises(InputError, match="no kernels for odd lights"):
        reference(lit_by(shining("odd")))


def test_what_gltf_cannot_hold_is_not_written(monkeypatch):
    scene = lit_by(shining("odd"))
    odd = replace(kind_of(shining("point")), name="odd", gltf_type=None)
    monkeypatch.setattr(LIGHT_KINDS, "_plugins", {**LIGHT_KINDS._plugins, "odd": odd})
    assert None not in kinds_by_gltf_type()
    with pytest.raises(InputError, match="has no odd lights"):
        new_document(scene, unwrap_scene(scene, SETTINGS))
