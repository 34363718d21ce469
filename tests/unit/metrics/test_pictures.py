"""Maps with few levels, clipping, blur, wrong dilation or outliers are detected in synthetic images."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from baker.metrics.dilation import misfilled_share
from baker.metrics.groups import ComparedPoints
from baker.metrics.levels import cut_off, few_levels
from baker.metrics.misalignment import is_blurred
from baker.metrics.outliers import outlier_factor, outlier_texels, steep_texels

SIZE = 96
ALL = np.ones((1, SIZE, SIZE), bool)


def hills(seed=0):
    """Return a smooth map (1, SIZE, SIZE, 3) with a shadow edge and 1 % noise, rounded to half precision."""
    rng = np.random.default_rng(seed)
    row, column = np.mgrid[:SIZE, :SIZE] / SIZE
    light = (
        1 + np.sin(5 * row) * np.cos(7 * column) * 0.5 + (column > 0.5) + 2 * np.exp(-((row * 20 - 9) ** 2))
    )
    page = light * (1 + 0.01 * rng.standard_normal(light.shape))
    return np.repeat(np.float16(page).astype(np.float32)[None, ..., None], 3, axis=3)


@pytest.mark.parametrize("curve", [1.0, 2.2])
def test_eight_bits_are_few_levels(curve):
    page = hills()
    top = page.max()
    rounded = np.round((page / top) ** (1 / curve) * 255) ** curve / 255**curve * top
    assert few_levels(np.float16(rounded).astype(np.float32), ALL)
    assert not few_levels(page, ALL)


def test_even_light_is_no_rounding():
    page = np.ones((1, SIZE, SIZE, 1), np.float32)
    page[:, ::2] = 3.0
    assert not few_levels(page, ALL)
    assert not few_levels(page[:, :0], ALL[:, :0])


def test_a_map_that_is_cut_off():
    page = hills()
    pixel = np.arange(0, SIZE * SIZE, 3)
    truth = page.reshape(-1, 3)[pixel].astype(np.float64)

    def found(maps):
        return cut_off(
            maps, ALL, ComparedPoints(truth, truth, 0 * truth, (truth, truth), pixel, 0 * truth), pixel
        )

    assert found(page) == 0
    limit = np.float32(np.percentile(page, 95))
    assert found(np.minimum(page, limit)) == pytest.approx(
        (truth[truth >= limit] / limit).mean() - 1, rel=0.01
    )


def test_blur():
    page = hills()[0, ..., 0].astype(np.float64)
    steep = steep_texels(hills(), ALL, 400)
    rng = np.random.default_rng(1)
    truth = page.reshape(-1)[steep] * (1 + 0.02 * rng.standard_normal(len(steep)))
    assert not is_blurred(page[None], ALL, steep, truth)
    for width in (1, 2):
        assert is_blurred(gaussian_filter(page, width)[None], ALL, steep, truth)
    # A map with more noise does not count as blurred.
    rough = page * (1 + 0.1 * rng.standard_normal(page.shape))
    assert not is_blurred(rough[None], ALL, steep, truth)


def test_steep_texels_lie_at_edges():
    step = np.ones((1, SIZE, SIZE, 1), np.float32)
    step[:, :, 40:] = 2.0
    assert set(steep_texels(step, ALL, 5000) % SIZE) == {39, 40}
    assert len(steep_texels(step, ALL, 7)) == 7
    assert len(steep_texels(np.ones_like(step), ALL, 7)) == 0


def test_texels_that_stand_out():
    page = hills()
    page[0, 20, 30], page[0, 50, 60, 1] = 40.0, 0.0
    page[0, 70, 80:82] = 40.0
    found = outlier_texels(page, ALL, 2)
    np.testing.assert_array_equal(found, [20 * SIZE + 30, 50 * SIZE + 60])
    # A texel next to an empty texel has the score 1, so it is no outlier. Two adjacent outliers hide each
    # other.
    hole = ALL[0].copy()
    hole[21, 30] = False
    score = outlier_factor(page[0, ..., 0].astype(np.float64), hole)
    assert score[20, 30] == 1
    assert score[70, 80] < 1.1


def test_filled_texels_are_like_their_neighbours():
    page = hills()
    covered = ALL.copy()
    covered[:, :, 48:] = False
    assert misfilled_share(page, covered, ~covered) == 0
    page[:, :, 48:] = 0
    assert misfilled_share(page, covered, ~covered) > 0.9
    page[:, :, 48:] = 50
    assert misfilled_share(page, covered, ~covered) == 1
    assert misfilled_share(page, ~ALL, ALL) == 0
