"""Patches: each texel is in one patch, a patch has one chart and one side, and areas are preserved."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from tiny_scenes import Quad, box_quads, grey, quad_world

from baker.core.budget import MAX_PATCHES
from baker.radiosity.patches import build_patches


@pytest.fixture(scope="module")
def texels():
    quads = box_quads((0, 0, 0), (2, 1, 1), inward=True)
    quads += [Quad((0.5, 0.2, 0.5), (0.5, 0, 0), (0, 0.5, 0.3), grey(double_sided=True))]
    return quad_world(quads, 48, inset=0.3).texels


def cylinder_texels(size=64):
    """Return the texels of one chart around a cylinder, whose normals rotate along the columns."""
    row, column = np.divmod(np.arange(size * size), size)
    angle = 2 * np.pi * column / size
    rng = np.random.default_rng(0)
    keep = rng.random(size * size) < 0.9
    pixel = (row * size + column)[keep]
    normal = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)[keep]
    n = len(pixel)
    return SimpleNamespace(
        resolution=size,
        pixel=pixel.astype(np.int64),
        normal=normal.astype(np.float32),
        chart=np.zeros(n, np.int32),
        back=np.zeros(n, bool),
        area=(rng.random(n) * (rng.random(n) < 0.95)).astype(np.float32),
    )


def assert_sound(patches, texels):
    n = len(texels.pixel)
    np.testing.assert_array_equal(np.sort(patches.member), np.arange(n))
    assert patches.first[0] == 0
    assert patches.first[-1] == n
    assert (np.diff(patches.first) > 0).all()
    assert patches.n == len(patches.first) - 1 == patches.patch.max() + 1
    assert patches.area.sum() == pytest.approx(texels.area.sum(dtype=float), rel=1e-6)
    size, block = texels.resolution, patches.block
    rest = texels.pixel % (size * size)
    place = np.stack([texels.pixel // (size * size), rest // size // block, rest % size // block], axis=1)
    for p in range(patches.n):
        own = patches.member[patches.first[p] : patches.first[p + 1]]
        assert (np.diff(own) > 0).all()
        assert (patches.patch[own] == p).all()
        for column in (texels.chart, texels.back, place):
            assert (column[own] == column[own[0]]).all()
        assert (texels.normal[own] @ texels.normal[own[0]]).min() > 0.2
        weight = np.maximum(texels.area[own], 1e-12).astype(float)
        assert patches.area[p] == pytest.approx(weight.sum())
        running = patches.cumulative[patches.first[p] : patches.first[p + 1]]
        # In patches of tiny area, cumulative areas are inaccurate by rounding.
        if weight.sum() > 1e-6:
            np.testing.assert_allclose(running, np.cumsum(weight) / weight.sum(), atol=1e-4)
    # Patches are numbered in the order of their first texel.
    assert (np.diff(patches.member[patches.first[:-1]]) > 0).all()


def test_blocks_of_one_texel(texels):
    patches = build_patches(texels)
    assert patches.block == 1
    assert patches.n == texels.n
    assert_sound(patches, texels)
    assert patches.n <= MAX_PATCHES


@pytest.mark.parametrize("most", [600, 200, 60, 1])
def test_blocks_grow_until_they_are_few_enough(texels, most):
    patches = build_patches(texels, max_patches=most)
    assert_sound(patches, texels)
    # There are seven charts, one of them with a back, so there are at least 8 patches.
    assert patches.n <= max(most, 8)
    assert (patches.block == 256) == (most == 1)
    # Blocks of half the size would give more than `most` patches.
    if patches.block > 1:
        assert build_patches(texels, max_patches=patches.n).block <= patches.block
        finer = len(
            np.unique(
                texels.pixel // 48 // (patches.block // 2) * 48 + texels.pixel % 48 // (patches.block // 2)
            )
        )
        assert finer > most or patches.n == 8


@pytest.mark.parametrize("most", [4096, 300, 40])
def test_turning_normals_split_blocks(most):
    texels = cylinder_texels()
    patches = build_patches(texels, max_patches=most)
    assert_sound(patches, texels)
    assert patches.n >= min(8, most)


def test_means_use_the_given_weights(texels):
    patches = build_patches(texels, max_patches=100)
    value = np.random.default_rng(1).random((texels.n, 3), np.float32)
    mean = patches.mean(value, texels.area)
    assert mean.shape == (patches.n, 3)
    assert mean.dtype == np.float64
    for p in range(0, patches.n, 7):
        own = patches.patch == p
        np.testing.assert_allclose(
            mean[p], np.average(value[own], axis=0, weights=texels.area[own]), rtol=1e-6
        )
    np.testing.assert_allclose((mean * patches.area[:, None]).sum(axis=0), texels.area @ value, rtol=1e-5)
    np.testing.assert_array_equal(patches.mean(value, np.zeros(texels.n, np.float32)), 0)


def test_no_texels():
    nothing = SimpleNamespace(
        resolution=16,
        pixel=np.zeros(0, np.int64),
        normal=np.zeros((0, 3), np.float32),
        chart=np.zeros(0, np.int32),
        back=np.zeros(0, bool),
        area=np.zeros(0, np.float32),
    )
    patches = build_patches(nothing)
    assert patches.n == 0
    assert patches.first.tolist() == [0]
    assert patches.mean(np.zeros((0, 3), np.float32), np.zeros(0, np.float32)).shape == (0, 3)
