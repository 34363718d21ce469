"""For emissive textures with many repeats, the work is limited. The power is nearly that without a limit."""

from __future__ import annotations

import numpy as np
import pytest
from tiny_scenes import Quad, quad_world

from baker.core.scene import Material, Texture
from baker.kernels.emitters import CLUSTER, SHARE
from baker.kernels.textures import PackImage, pack_textures
from baker.lights import emissive_texture
from baker.lights.emissive import MOST_PARTS, build_emitters
from baker.lights.emissive_texture import FEW_CROSSED, MOST_CROSSED, EmissiveTextures, cut
from baker.lights.texture_levels import fair_limit

SQUARE = np.array([[[0, 0], [1, 0], [1, 1]], [[0, 0], [1, 1], [0, 1]]], float)


def sparks(*size):
    image = np.ones((*size, 4), np.float32)
    image[..., :3] = np.random.default_rng(0).random((*size, 3)) ** 8
    return image


@pytest.fixture
def calls(monkeypatch):
    """Return a list that gets one tuple for each kernel call.

    The tuple has the number of texel lines that the edges of triangles cross, and the number of triangles.
    """
    found = []
    real = emissive_texture.uv_means

    def counted(uv, pixels, w, h, *rest):
        found.append((float((np.abs(uv - uv[:, [1, 2, 0]]) * [w, h]).sum()), len(uv)))
        real(uv, pixels, w, h, *rest)

    monkeypatch.setattr(emissive_texture, "uv_means", counted)
    return found


def check_work(calls):
    crossed, triangles = np.array(calls).sum(axis=0)
    assert 0 < crossed <= MOST_CROSSED + FEW_CROSSED * triangles
    # Each call is short, because signals are handled between calls.
    assert max(c for c, _ in calls) < 0.3 * MOST_CROSSED


def test_many_quads_with_many_repeats(calls):
    image = sparks(512, 512)
    emitter = Material(base_colour=(0, 0, 0, 1), emission=(1, 1, 1), emission_texture=Texture(image))
    place = [(0.4 * (k % 15), 1.5, 0.4 * (k // 15)) for k in range(225)]
    world = quad_world([Quad(p, (0.15, 0, 0), (0, 0, 0.15), emitter) for p in place])
    shading = world.shading._replace(emission_uv=world.shading.emission_uv * np.float32(10))
    calls.clear()
    emitters = build_emitters(world.geometry, shading)
    check_work(calls)
    power = np.pi * 225 * 0.15**2 * image[..., :3].mean(dtype=float)
    assert emitters.power.sum() == pytest.approx(power, rel=1e-3)
    # The power of each single quad is correct, too.
    share = emitters.row[:, SHARE] * emitters.power[emitters.row[:, CLUSTER].astype(int)]
    own = np.bincount(emitters.triangle // 2, share, 225)
    np.testing.assert_allclose(own, power / 225, rtol=1e-2)


@pytest.mark.parametrize("nearest", [False, True])
@pytest.mark.parametrize(
    ("repeats", "size", "wrap"),
    [
        ((3e4, 3e4), (256, 256), ("repeat", "mirror")),
        ((1e20, 1.0), (37, 101), ("repeat", "repeat")),
        # v covers only some rows of the texture, so the resolution along v is not reduced.
        ((1e5, 0.3), (37, 101), ("repeat", "clamp")),
        ((0.3, 1e6), (37, 101), ("mirror", "repeat")),
    ],
)
def test_one_quad_with_very_many_repeats(calls, repeats, size, wrap, nearest):
    pack = pack_textures([PackImage(sparks(*size), wrap, nearest)])

    def power(scale, most):
        textures = EmissiveTextures(pack, np.zeros(2, int), np.ones((2, 3)), SQUARE * scale)
        parts = cut(textures, np.ones(2), np.zeros(2), most)
        return parts.inside[:, 2] ** 2 @ parts.mean

    # 2 repeats have the same mean as any even number of repeats.
    truth = power(np.where(np.array(repeats) > 2, 2.0, repeats), 0)
    calls.clear()
    np.testing.assert_allclose(power(repeats, MOST_PARTS), truth, rtol=1e-3)
    check_work(calls)


def test_the_fair_limit_reduces_only_the_largest_demands():
    wanted = np.array([5.0, 1.0, 90.0, 40.0])
    assert fair_limit(wanted, 200.0) == np.inf
    limit = fair_limit(wanted, 50.0)
    assert limit == pytest.approx(22.0)
    assert np.minimum(wanted, limit).sum() == pytest.approx(50.0)
