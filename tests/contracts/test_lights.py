"""Contract of every kind of light, and the closed form of its irradiance."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import map_coordinates

from baker.core.light_kind import LIGHT_KINDS, kind_of, kinds_by_gltf_type
from baker.core.scene import PunctualLight
from baker.io.gltf.json import JsonObject

POSITION, DIRECTION = np.array([0.3, 2.0, -0.4]), np.array([0.48, -0.8, 0.36])
INNER, OUTER = 0.3, 0.8


def toward(point):
    """Return the vectors from points to the light, their lengths, and the cosines to the light's axis."""
    way = POSITION - point
    length = np.linalg.norm(way, axis=-1)
    return way, length, -(way @ DIRECTION) / length


def point_truth(point, normal):
    way, length, _ = toward(point)
    return np.maximum((way * normal).sum(-1), 0) / length**3


def spot_truth(point, normal):
    _, _, axis = toward(point)
    share = np.clip((axis - np.cos(OUTER)) / (np.cos(INNER) - np.cos(OUTER)), 0, 1)
    return point_truth(point, normal) * share**2


def directional_truth(point, normal):
    return np.maximum(-(normal @ DIRECTION), 0)


# {kind: closed form of E}. For a new kind add a line here, and its parameters, if any, to `PARAMETERS`.
TRUTH = {"point": point_truth, "spot": spot_truth, "directional": directional_truth}
PARAMETERS = {}


def light_of(kind, **more):
    more["parameters"] = PARAMETERS.get(kind, {})
    return PunctualLight(kind, kind, 0, (1, 1, 1), tuple(POSITION), tuple(DIRECTION), INNER, OUTER, **more)


POSITIONED = [name for name in LIGHT_KINDS.names() if LIGHT_KINDS.get(name).has_position]
RANGED = [name for name in POSITIONED if "range" in LIGHT_KINDS.get(name).describe(light_of(name, range=2.0))]


def points(n=60, seed=0):
    rng = np.random.default_rng(seed)
    origin = rng.uniform(-2, 2, (n, 16, 3))
    normal = rng.normal(size=(n, 16, 3))
    return np.float32(origin), np.float32(normal / np.linalg.norm(normal, axis=-1, keepdims=True))


def fill(kind, origin, normal, light=None):
    ray = np.full((*origin.shape[:2], 4), np.nan, np.float32)
    weight = np.full(origin.shape[:2], np.nan, np.float32)
    before = origin.copy(), normal.copy()
    light = light or light_of(kind)
    assert kind_of(light).fill(light, origin, normal, ray, weight) is None
    assert (origin == before[0]).all()
    assert (normal == before[1]).all()
    return ray, weight


def test_every_kind_has_a_closed_form():
    assert LIGHT_KINDS.names() == sorted(TRUTH)


@pytest.mark.parametrize("name", sorted(TRUTH))
def test_a_record_agrees_with_what_its_light_does(name):
    """A change of position, range, direction or cone changes E if and only if `describe` returns it."""
    kind, light, (origin, normal) = LIGHT_KINDS.get(name), light_of(name), points()
    assert kind.name == name
    assert kind.gltf_type is None or kinds_by_gltf_type()[kind.gltf_type] is kind
    assert kind.unit == ("cd" if kind.has_position else "lx")
    before = fill(name, origin, normal, light)[1]
    assert before.max() > 0
    changes = {
        "position": (-0.7, 1.5, 0.2),
        "range": 2.0,
        "direction": (0.6, -0.8, 0.0),
        "inner_cone": 0.5,
        "outer_cone": 0.9,
    }
    for changed, value in changes.items():
        other = replace(light, **{changed: value})
        described = kind.describe(other)
        after = fill(name, origin, normal, other)[1]
        assert (after != before).any() == (changed in described), changed
        assert described.get(changed, value) == value
    assert kind.has_position == ("position" in kind.describe(light))
    assert kind.has_direction == ("direction" in kind.describe(light))
    assert kind.describe(light).keys() <= {*changes, *light.parameters}


@pytest.mark.parametrize("name", sorted(TRUTH))
@pytest.mark.parametrize("range_", [math.inf, 2.5])
def test_what_is_written_is_read(name, range_):
    light = replace(light_of(name), range=range_)
    kind = LIGHT_KINDS.get(name)
    fields = kind.read(JsonObject(kind.write(light), "lights[0]", "a.gltf"), np.eye(3))
    default = {"range": math.inf, "inner_cone": 0.0, "outer_cone": math.pi / 4}
    assert kind.describe(replace(light, **default | dict(fields))) == kind.describe(light)


def interpolated(profile, away, cosine):
    """Return the relative intensity of a tabulated profile for directions (..., 3)."""
    rows, columns = profile.table.shape
    low = profile.min_cosine
    row = np.clip((cosine - low) / (1 - low), 0, 1) * (rows - 1)
    side = np.cross(profile.axis, profile.tangent)
    azimuth = np.arctan2(away @ side, away @ np.array(profile.tangent))
    column = azimuth / (2 * np.pi) % 1 * columns
    closed = np.concatenate([profile.table, profile.table[:, :1]], axis=1)
    return map_coordinates(closed, [row, column], order=1) * (cosine >= low)


@pytest.mark.parametrize("name", sorted(TRUTH))
@pytest.mark.parametrize("range_", [math.inf, 2.0])
def test_the_profile_for_the_path_tracer_is_the_same_light(name, range_):
    """The equations of `EmissionProfile`, evaluated in NumPy, agree with `fill` of the bake."""
    light = replace(light_of(name), range=range_)
    origin, normal = points()
    expected = fill(name, origin, normal, light)[1]
    profile = kind_of(light).emission(light)
    if profile.position is None:
        found = np.maximum(-(normal.astype(float) @ np.array(profile.axis)), 0)
    else:
        away = origin.astype(float) - np.array(profile.position)
        length = np.linalg.norm(away, axis=-1)
        cosine = (away @ np.array(profile.axis)) / length
        share = np.ones_like(cosine)
        if profile.cone_scale is not None:
            share = np.clip((cosine - profile.min_cosine) * profile.cone_scale, 0, 1) ** 2
        if profile.table is not None:
            share = interpolated(profile, away / length[..., None], cosine)
        window = np.maximum(1 - (length**2 * profile.inverse_range) ** 2, 0)
        found = np.maximum(-(away * normal).sum(axis=-1), 0) / length**3 * share * window
    np.testing.assert_allclose(found, expected, rtol=3e-5, atol=1e-6)
    assert (expected > 0).sum() > 20


@pytest.mark.parametrize("name", POSITIONED)
@pytest.mark.parametrize("inner", [0.0, 0.3, OUTER])
def test_power_is_the_flux_or_a_bound_of_it(name, inner):
    """`power` is 1 to 4 times the flux, which is the integral of E over a unit sphere around the light."""
    light = replace(light_of(name), inner_cone=inner)
    n = 4000 * 16
    z, turn = 1 - (2 * np.arange(n) + 1) / n, np.arange(n) * np.pi * (3 - 5**0.5)
    way = np.stack([np.sqrt(1 - z * z) * np.cos(turn), np.sqrt(1 - z * z) * np.sin(turn), z], axis=1)
    origin, normal = np.float32(POSITION + way).reshape(-1, 16, 3), np.float32(-way).reshape(-1, 16, 3)
    flux = 4 * np.pi * fill(name, origin, normal, light)[1].mean(dtype=float)
    power = kind_of(light).power(light, 1.0)
    # The quadrature has an error of at most 0.5 %.
    assert 0.995 * flux < power < 4 * flux
    if name == "point" or (name == "spot" and inner == OUTER):
        np.testing.assert_allclose(power, flux, rtol=5e-3)


@pytest.mark.parametrize("kind", RANGED)
@pytest.mark.parametrize("reach", [2.0, 3.0, 1e6])
def test_a_range_fades_the_light_out(kind, reach):
    origin, normal = points()
    _, weight = fill(kind, origin, normal, replace(light_of(kind), range=reach))
    _, length, _ = toward(origin.astype(float))
    window = np.clip(1 - (length / reach) ** 4, 0, 1)
    truth = TRUTH[kind](origin.astype(float), normal.astype(float)) * window
    np.testing.assert_allclose(weight, truth, rtol=3e-5, atol=1e-6)
    assert (weight > 0).sum() > 20
    assert (weight[length > reach] == 0).all()


@pytest.mark.parametrize("kind", sorted(TRUTH))
def test_unoccluded_irradiance_equals_the_closed_form(kind):
    origin, normal = points()
    ray, weight = fill(kind, origin, normal)
    truth = TRUTH[kind](origin.astype(float), normal.astype(float))
    np.testing.assert_allclose(weight, truth, rtol=2e-5, atol=1e-6)
    assert (weight > 0).sum() > 20
    assert np.isfinite(ray).all()
    # Light from below the horizon of a point gives no irradiance.
    behind = (ray[..., :3].astype(float) * normal).sum(-1) < -1e-6
    assert behind.sum() > 100
    assert (weight[behind] == 0).all()


@pytest.mark.parametrize("kind", sorted(TRUTH))
def test_rays_end_just_before_the_light(kind):
    origin, normal = points(seed=1)
    ray, _ = fill(kind, origin, normal)
    if not LIGHT_KINDS.get(kind).has_position:
        np.testing.assert_allclose(ray[..., :3], np.broadcast_to(-DIRECTION, origin.shape), atol=1e-6)
        assert (ray[..., 3] > 1e20).all()
        return
    end = origin + ray[..., 3:].astype(float) * ray[..., :3]
    distance = np.linalg.norm(end - POSITION, axis=-1)
    length = np.linalg.norm(POSITION - origin, axis=-1)
    assert (distance < 1e-4 * length).all()
    assert (ray[..., 3] < 1).all()


@pytest.mark.parametrize("kind", sorted(TRUTH))
def test_a_candela_a_metre_and_a_lux(kind):
    """A light of 1 cd at 1 m, or of 1 lx, directly above a point gives 1 lx, for every kind."""
    light = replace(light_of(kind), position=(0, 1, 0), direction=(0, -1, 0), inner_cone=0.2, outer_cone=0.5)
    up = np.zeros((1, 16, 3), np.float32)
    up[..., 1] = 1
    _, weight = fill(kind, np.zeros((1, 16, 3), np.float32), up, light)
    np.testing.assert_allclose(weight, 1, rtol=1e-6)


@pytest.mark.parametrize("kind", sorted(TRUTH))
def test_no_points_and_points_at_the_light(kind):
    """An empty array of points, and a point at the position of the light, give finite results."""
    none = np.zeros((0, 16, 3), np.float32)
    assert fill(kind, none, none)[1].shape == (0, 16)
    at = np.float32(np.tile(POSITION, (1, 16, 1)))
    normal = points(1)[1]
    # The light gets the float32 position of the points, so light and points coincide exactly.
    ray, weight = fill(kind, at, normal, replace(light_of(kind), position=tuple(map(float, at[0, 0]))))
    assert np.isfinite(ray).all()
    assert np.isfinite(weight).all()


def test_the_fall_off_of_a_spot():
    origin = np.zeros((1, 16, 3), np.float32)
    normal = np.zeros((1, 16, 3), np.float32)
    angle = np.array([0, 0.1, 0.29, 0.31, 0.4, 0.5, 0.6, 0.7, 0.79, 0.81, 1.0, 1.5, 2.0, 3.0, 3.1, 0.3])
    # The points lie on a unit sphere around the light and face the light. So E is the cone's fall-off times 1
    # lx.
    axis, side = DIRECTION, np.cross(DIRECTION, [0, 1, 0])
    side = side / np.linalg.norm(side)
    way = np.cos(angle)[:, None] * axis + np.sin(angle)[:, None] * side
    origin[0], normal[0] = POSITION + way, -way
    _, weight = fill("spot", origin, normal)
    share = np.clip((np.cos(angle) - np.cos(OUTER)) / (np.cos(INNER) - np.cos(OUTER)), 0, 1) ** 2
    np.testing.assert_allclose(weight[0], share, atol=1e-5)
    assert (weight[0][angle <= INNER] > 0.9999).all()
    assert (weight[0][angle > OUTER] == 0).all()
    # If the inner cone equals the outer cone, the cone has a sharp edge, without a division by zero.
    light = PunctualLight("spot", "", 0, (1, 1, 1), tuple(POSITION), tuple(DIRECTION), OUTER, OUTER)
    _, sharp = fill("spot", origin, normal, light)
    np.testing.assert_allclose(sharp[0][angle < OUTER - 0.02], 1, atol=1e-5)
    assert (sharp[0][angle > OUTER] == 0).all()
