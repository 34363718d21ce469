"""`baker verify` with its default limits detects changed maps and faulty bakes.

The scene has two closed rooms side by side, one a thousand times brighter than the other. The reference is
the path-traced light of some texels. It is traced once and compared with every changed map. For a changed
map, `verify` would choose other texels, but the path-traced light of a texel does not depend on the map.
"""

from __future__ import annotations

import importlib
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.ndimage import binary_dilation, binary_erosion, gaussian_filter, uniform_filter
from tiny_scenes import Quad, box_quads, grey, quad_scene

from baker.core.geometry import world_geometry
from baker.core.scene import Material
from baker.core.settings import make_settings
from baker.encodings.exr import decode_exr, encode_exr
from baker.io.bake.read_bake import read_bake
from baker.lights.emissive import build_emitters
from baker.metrics.texel_area import instance_map, surface_points
from baker.pathtracer.emitters import find_emitters
from baker.pipeline.bake import bake
from baker.verification.settings import VerifySettings
from baker.verification.verify import verify

# The module `verify`; `import` would find the function of the same name.
module = importlib.import_module("baker.verification.verify")
SETTINGS = VerifySettings(texels=2400, spp=4096, time_limit=None)
BAKED = {"resolution": 128, "samples": 256, "ao_distance": "0.5"}
DIM, SIZE = 1e-3, 128


def rooms(dim_emitter=2.0 * DIM):
    red, green = Material(base_colour=(0.7, 0.2, 0.1, 1.0)), Material(base_colour=(0.2, 0.6, 0.3, 1.0))
    quads = []
    for x in (0.0, 3.0):
        walls = box_quads((x, 0, 0), (x + 2, 2.5, 2), inward=True, material=grey(0.6))
        walls[0], walls[1] = replace(walls[0], material=red), replace(walls[1], material=green)
        emitter = Quad(
            (x + 0.5, 1.6, 1.95), (1.0, 0, 0), (0, -0.8, 0), grey(0, 2.0 if x == 0 else dim_emitter)
        )
        quads += [*walls, emitter]
    quads += box_quads((0.3, 0.4, 0.2), (0.9, 1.0, 0.8), inward=False, material=grey(0.4))
    return quad_scene(quads)


@pytest.fixture(scope="module")
def sound(tmp_path_factory) -> Path:
    out = tmp_path_factory.mktemp("tampering") / "out"
    bake(rooms(), settings=make_settings(BAKED), out=out)
    return out


@pytest.fixture(scope="module")
def first(sound):
    """Return the verification of the unchanged bake, and the traced reference."""
    traced = []
    real = module._trace

    def remember(*args):
        traced.append(real(*args))
        return traced[-1]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "_trace", remember)
        found = verify(sound, SETTINGS)
    return found, traced[0]


@pytest.fixture(scope="module")
def surface(sound):
    """Return object (H, W), -1 for none, world position (H, W, 3) and status (H, W) of the page's texels."""
    stored = read_bake(sound)
    geometry = world_geometry(stored.scene, stored.atlas)
    owner = instance_map(geometry, 1, SIZE)
    pixel = np.flatnonzero(owner.reshape(-1) >= 0)
    position = np.full((SIZE * SIZE, 3), np.nan)
    position[pixel] = surface_points(geometry, pixel, SIZE, 1, 0).position[:, 0] + geometry.origin
    return owner[0], position.reshape(SIZE, SIZE, 3), stored.status[0]


def tampered(sound: Path, tmp_path: Path, pixels) -> Path:
    out = tmp_path / "out"
    shutil.copytree(sound, out)
    encode_exr(out / "irradiance_0.exr", pixels, half=True, header={})
    return out


def failed(found) -> set[str]:
    return {str(verdict.limit).split()[0].split(".")[1] for verdict in found.verdicts if verdict.failed}


def covered(surface):
    return np.isin(surface[2], (1, 4))


def one(number, factor):
    def change(pixels, surface):
        pixels[surface[0] == number] *= factor
        return pixels

    return change


def dim_room_darker(pixels, surface):
    pixels[surface[1][..., 0] > 2.5] *= 0.7
    return pixels


def exchanged(pixels, surface):
    """Exchange the light of the red and the green wall."""
    a, b = (np.nonzero(surface[0] == number) for number in (0, 1))
    n = min(len(a[0]), len(b[0]))
    one, two = (tuple(axis[:n] for axis in where) for where in (a, b))
    pixels[one], pixels[two] = pixels[two], pixels[one].copy()
    return pixels


def noise_in_the_dark(pixels, surface):
    dim = surface[1][..., 0] > 2.5
    pixels[dim] *= 1 + 0.4 * np.random.default_rng(0).standard_normal((dim.sum(), 1)).clip(-2, 2)
    return pixels


def noise_of_15(pixels, where, block=1):
    """Multiply some texels by noise of 15 %, constant over squares of `block` x `block` texels."""
    noise = np.random.default_rng(0).standard_normal((SIZE // block, SIZE // block))
    pixels[where] *= (1 + 0.15 * noise.repeat(block, 0).repeat(block, 1))[where][:, None].clip(0)
    return pixels


def darkest_tenth(pixels, surface):
    light = pixels.mean(axis=2)
    on = covered(surface)
    return on & (light < np.percentile(light[on], 10))


def below_a_thirtieth(pixels, surface):
    # The threshold is a thirtieth of the median light of the bright room.
    light = pixels.mean(axis=2)
    on = covered(surface)
    return on & (light < np.median(light[on & (surface[1][..., 0] < 2.5)]) / 30)


def one_chart_shifted(pixels, surface):
    """Shift the texels of an object, and the dilated texels around them, by one column."""
    mine = binary_dilation(surface[0] == 3, np.ones((3, 3)))
    pixels[mine] = np.roll(pixels, 1, axis=1)[mine]
    return pixels


def box_blurred(pixels, surface):
    on = covered(surface)
    count = uniform_filter(on.astype(float), 3)[..., None]
    soft = uniform_filter(pixels * on[..., None], (3, 3, 1)) / np.maximum(count, 1e-9)
    return np.where(on[..., None], soft, pixels).astype(np.float32)


def eight_bits(pixels, surface):
    """Round the dim room to steps of 1/255 of the page's largest value."""
    dim = surface[1][..., 0] > 2.5
    step = pixels.max() / 255
    pixels[dim] = np.round(pixels[dim] / step) * step
    return pixels


def black_border(pixels, surface):
    on = covered(surface)
    pixels[on & ~binary_erosion(on)] = 0
    return pixels


def leak(pixels, surface):
    """Add a thousandth of the bright room's light at the foot of the dim room's walls."""
    x, z = surface[1][..., 0], surface[1][..., 2]
    foot = (x > 2.5) & (z < 0.1) & (surface[0] != 11) & covered(surface)
    pixels[foot] += 1e-3 * pixels[(x < 2.5) & covered(surface)].mean()
    return pixels


def rounded(pixels, surface):
    top = pixels.max()
    return np.round((pixels / top) ** (1 / 2.2) * 255) ** 2.2 / 255**2.2 * top


def blurred(pixels, surface):
    weight = gaussian_filter(covered(surface).astype(float), 2)[..., None]
    soft = gaussian_filter(pixels * covered(surface)[..., None], (2, 2, 0)) / np.maximum(weight, 1e-9)
    return np.where(covered(surface)[..., None], soft, pixels)


def turned(pixels, surface):
    row, column = np.nonzero(surface[0] == 0)
    box = slice(row.min(), row.max() + 1), slice(column.min(), column.max() + 1)
    pixels[box] = pixels[box][::-1, ::-1].copy()
    return pixels


TAMPERING = {
    "doubled": (lambda p, _: 2 * p, "whole_bias"),
    "five percent brighter": (lambda p, _: 1.05 * p, "whole_bias"),
    "gamma": (lambda p, _: p ** (1 / 2.2), "exponent_error"),
    "upside down": (lambda p, _: p[::-1].copy(), "chart_noise"),
    "left and right": (lambda p, _: p[:, ::-1].copy(), "chart_noise"),
    "shifted by a texel": (lambda p, _: np.roll(p, 1, axis=0), "shifted"),
    "red and blue swapped": (lambda p, _: p[..., ::-1].copy(), "whole_colour"),
    "red of 3 %": (lambda p, _: p * np.float32([1.03, 1, 1]), "whole_colour"),
    "green of 3 %": (lambda p, _: p * np.float32([1, 1.03, 1]), "whole_colour"),
    "an object 4 % red": (one(4, np.float32([1.04, 1, 1])), "object_colour"),
    "an object 10 % darker": (one(2, 0.9), "object_bias"),
    "the dim room 30 % darker": (dim_room_darker, "region_bias"),
    "two objects exchanged": (exchanged, "object_colour"),
    "noise in the dark": (noise_in_the_dark, "region_noise"),
    "15 % of noise in the darkest tenth": (lambda p, s: noise_of_15(p, darkest_tenth(p, s)), "level_noise"),
    "15 % in blocks in the darkest tenth": (
        lambda p, s: noise_of_15(p, darkest_tenth(p, s), 4),
        "level_noise",
    ),
    "15 % of noise below a thirtieth": (lambda p, s: noise_of_15(p, below_a_thirtieth(p, s)), "level_noise"),
    "15 % in blocks below a thirtieth": (
        lambda p, s: noise_of_15(p, below_a_thirtieth(p, s), 4),
        "level_noise",
    ),
    "an object 3 % red": (one(4, np.float32([1.03, 1, 1])), "object_colour"),
    "a chart shifted by a texel": (one_chart_shifted, "shifted_charts"),
    "3 x 3 texels averaged": (box_blurred, "blurred"),
    "the dim room in 8 bits": (eight_bits, "region_bias"),
    "border texels black": (black_border, "edge_wrong_share"),
    "light leaks in at the foot of walls": (leak, "edge_bias"),
    "rounded to 8 bits": (rounded, "few_levels"),
    "blurred": (blurred, "blurred"),
    "a chart turned": (turned, "object_noise"),
    "cut off": (lambda p, s: np.minimum(p, np.percentile(p[covered(s)], 97)), "cut_off"),
    "black level": (lambda p, s: p + 0.01 * p[covered(s)].mean(), "region_bias"),
    "no dilation": (lambda p, s: np.where((s[2] == 2)[..., None], 0, p), "misfilled_share"),
}


def test_the_sound_bake_passes(first):
    found, _ = first
    assert found.passed, found.problems
    assert failed(found) == set()
    assert len(found.verdicts) > 40
    # Each room is a region. The texels of one light level of a room are a region, too. Errors are relative to
    # the light of the region.
    rows = [row for row in found.regions if row["channel"] == "irradiance"]
    light = {row["room"]: row["light"] for row in rows if row["level"] is None}
    bright, dim = light[0], light[1]
    assert min(bright, dim) / max(bright, dim) == pytest.approx(DIM, rel=0.5)
    for row in found.regions:
        assert abs(row["bias"]) < 0.03 + 4 * row["bias_se"]


@pytest.mark.parametrize("name", TAMPERING)
def test_a_tampered_map_fails(sound, first, surface, tmp_path, monkeypatch, name):
    change, figure = TAMPERING[name]
    pixels = decode_exr(sound / "irradiance_0.exr").pixels.copy()
    out = tampered(sound, tmp_path, change(pixels, surface))
    monkeypatch.setattr(module, "_trace", lambda *_: first[1])
    found = verify(out, SETTINGS)
    assert not found.passed
    assert figure in failed(found)


def test_single_wrong_texels_are_found(sound, surface, tmp_path):
    pixels = decode_exr(sound / "irradiance_0.exr").pixels.copy()
    inside = np.argwhere(binary_erosion(covered(surface), np.ones((3, 3))))
    salt = inside[np.random.default_rng(1).permutation(len(inside))[:20]]
    pixels[salt[:, 0], salt[:, 1]] = pixels.max()
    found = verify(tampered(sound, tmp_path, pixels), SETTINGS.changed(texels=200, spp=64))
    assert "wrong_suspects" in failed(found)


@pytest.mark.parametrize(
    ("scene", "settings"),
    [
        pytest.param(rooms(), {"bounces": 1}, id="the solver stopped early"),
        pytest.param(rooms(dim_emitter=0.0), {}, id="an emitter was lost"),
        pytest.param(rooms(dim_emitter=1.8 * DIM), {}, id="an emitter of 90 %"),
    ],
)
def test_a_bake_that_went_wrong_fails(sound, first, tmp_path, monkeypatch, scene, settings):
    bake(scene, settings=make_settings({**BAKED, "samples": 64, **settings}), out=tmp_path / "wrong")
    pixels = decode_exr(tmp_path / "wrong" / "irradiance_0.exr").pixels
    monkeypatch.setattr(module, "_trace", lambda *_: first[1])
    found = verify(tampered(sound, tmp_path, pixels), SETTINGS)
    assert {"region_bias", "object_bias"} <= failed(found)
    assert any("room" in problem for problem in found.problems)


def forgetful(find):
    """Return a wrapper of the emitter finder `find`. The wrapper leaves out emitters of less than 1 cd/m2."""

    def found(geometry, shading, *rest):
        emission = shading.emission.copy()
        emission[emission.max(axis=1) < 1] = 0
        return find(geometry, shading._replace(emission=emission), *rest)

    return found


@pytest.mark.parametrize("both", [False, True], ids=["the bake's", "both"])
def test_verify_detects_that_a_bake_lacks_an_emitter(tmp_path, monkeypatch, both):
    """`verify` detects an emitter that its own finder leaves out, too, because reference rays hit it."""
    monkeypatch.setattr("baker.pipeline.prepare.build_emitters", forgetful(build_emitters))
    if both:
        monkeypatch.setattr("baker.pathtracer.light_table.find_emitters", forgetful(find_emitters))
    bake(rooms(), settings=make_settings({**BAKED, "samples": 64}), out=tmp_path / "out")
    found = verify(tmp_path / "out", SETTINGS.changed(texels=300, spp=256))
    # In this bake, the dim room gets only the light of gather rays that hit the emitter.
    assert "region_bias" in failed(found)
    assert not found.passed
