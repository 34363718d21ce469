"""The suggested exposure of a bake agrees with its definition."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scenes import SceneBuilder

from baker.pipeline import exposure
from baker.pipeline.exposure import suggested_exposure

PIXEL = np.arange(100, dtype=np.int64)
WHITE = np.ones((100, 3), np.float16)


def pages(value):
    """Return four pages of 5 x 5 grey texels. `value` has their values, page by page and row by row."""
    return np.repeat(np.float32(value), 3).reshape(4, 5, 5, 3)


def square(light, **settings):
    """Return the bake of a square of albedo 0.5 with a light of `light` lx straight above."""
    builder = SceneBuilder()
    grey = builder.material(albedo=0.5)
    builder.quad((0, 0, 0), (0, 0, 1), (1, 0, 0), grey)
    builder.light("directional", (light,) * 3, direction=(0.0, -1.0, 0.0))
    return builder.bake(denoise=False, samples=16, **settings)


def test_half_of_the_lit_texels_are_darker_than_mid_grey():
    value = np.random.default_rng(0).permutation(np.linspace(1.0, 200.0, 100))
    found = suggested_exposure(pages(value), PIXEL, WHITE)
    level = value / math.pi * found
    assert np.count_nonzero(level <= 0.18) == 50
    assert found == pytest.approx(0.18 * math.pi / np.median(value), rel=1e-3)


def test_dark_texels_and_texels_that_are_not_given_do_not_count():
    value = np.linspace(1.0, 200.0, 100)
    value[:60] = 0.0
    all_lit = suggested_exposure(pages(value), PIXEL[60:], WHITE[60:])
    assert suggested_exposure(pages(value), PIXEL, WHITE) == all_lit
    value[:60] = 1e6
    assert suggested_exposure(pages(value), PIXEL[60:], WHITE[60:]) == all_lit


def test_albedo_and_colour_count_by_luminance():
    green = pages(np.full(100, math.pi)) * np.float32([0.0, 1.0, 0.0])
    half = np.full((100, 3), 0.5, np.float16)
    assert suggested_exposure(green, PIXEL, half) == float(f"{0.18 / (0.7152 * 0.5):.4g}")


def test_blocks_do_not_change_the_result(monkeypatch):
    value = pages(np.random.default_rng(1).random(100))
    whole = suggested_exposure(value, PIXEL, WHITE)
    monkeypatch.setattr(exposure, "_BLOCK", 7)
    assert suggested_exposure(value, PIXEL, WHITE) == whole


@pytest.mark.parametrize("value", [0.0, 1e-45, 1e-38, 1e38])
def test_extreme_light_gives_a_usable_number(value):
    found = suggested_exposure(pages(np.full(100, value)), PIXEL, WHITE)
    assert 0.0 < found <= 1e30
    assert found == (1.0 if value == 0.0 else min(found, 1e30))
    assert np.isfinite(np.float32(found))


def test_without_texels_the_exposure_is_one():
    assert suggested_exposure(pages(np.ones(100)), PIXEL[:0], WHITE[:0]) == 1.0


def test_a_bake_has_the_value_of_the_closed_form(tmp_path):
    """Each texel of the square has L = 0.5 x 100 lx / pi, since no light comes back to it."""
    assert square(100.0).suggested_exposure == float(f"{0.18 * math.pi / 50.0:.4g}")
    assert square(0.0).suggested_exposure == 1.0
    assert square(100.0, channels=("ao",)).suggested_exposure is None
