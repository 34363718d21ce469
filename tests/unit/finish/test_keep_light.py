"""`keep_light` restores most of the light that denoising removed, in windows of texels of one chart."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from baker.finish.finish import ComponentRules, PageLayer, PagePlan, finish_page, open_finisher
from baker.finish.keep_light import keep_light

# Weighted number of texels of a full window: 5 x 5 blocks of 64 texels. The weights 1/3, 2/3, 1, 2/3, 1/3 of
# the blocks along each axis sum to 3.
WINDOW = 64 * 9.0
# Share of the missing light that is restored in a full window.
BELIEVED = WINDOW / (WINDOW + 30.0)


def _pages(size: int = 96) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
    return np.ones((size, size, 3), np.float32), np.zeros((size, size), np.int32)


def _finish(
    value: NDArray[np.float32],
    chart: NDArray[np.int32],
    error: NDArray[np.float32],
    kept: NDArray[np.bool_] | None = None,
) -> NDArray[np.float32]:
    plan = PagePlan(chart, chart >= 0, np.zeros((*chart.shape, 2), np.float32))
    layer = PageLayer(value, error, kept=kept)
    rules = ComponentRules(0.0, np.inf, (slice(0, 3),))
    with open_finisher(threads=1, dilation=0, denoise=True) as finisher:
        page, _ = finish_page(plan, [layer], rules, finisher)
    return page


@pytest.mark.parametrize("left", [0.9, 0.7, 1.1])
def test_most_of_the_light_that_the_filter_took_is_restored(left: float) -> None:
    noisy, chart = _pages()
    result = keep_light(noisy, np.float32(left) * noisy, chart, chart >= 0)
    middle = result[24:72, 24:72]
    np.testing.assert_allclose(middle, left * (1.0 + (1.0 / left - 1.0) * BELIEVED), rtol=1e-6)


def test_each_texel_changes_by_the_same_share_of_its_light() -> None:
    """The light rises by a factor of 100 across the page, but the share of missing light is constant."""
    noisy, chart = _pages()
    noisy *= np.logspace(0, 2, noisy.shape[1], dtype=np.float32)[None, :, None]
    result = keep_light(noisy, np.float32(0.9) * noisy, chart, chart >= 0)
    share = result[24:72, 24:72] / noisy[24:72, 24:72]
    np.testing.assert_allclose(share, 0.9 * (1.0 + BELIEVED / 9.0), rtol=1e-6)


def test_colours_are_kept_apart() -> None:
    noisy, chart = _pages()
    filtered = noisy * np.array([0.8, 1.0, 1.2], np.float32)
    result = keep_light(noisy, filtered, chart, chart >= 0)[48, 48]
    want = [0.8 * (1.0 + 0.25 * BELIEVED), 1.0, 1.2 * (1.0 - BELIEVED / 6.0)]
    np.testing.assert_allclose(result, want, rtol=1e-6)


def test_nothing_crosses_to_another_chart_or_to_texels_that_were_not_chosen() -> None:
    """Two charts meet at column 45, inside a block. Only in the left chart did denoising remove light."""
    noisy, chart = _pages()
    chart[:, 45:] = 1
    chosen = np.ones(chart.shape, bool)
    chosen[:10] = False
    filtered = np.where(chart[..., None] == 0, np.float32(0.5), noisy)
    result = keep_light(noisy, filtered, chart, chosen)
    np.testing.assert_array_equal(result[:, 45:], 1.0)
    np.testing.assert_array_equal(result[:10, :45], 0.5)
    assert (result[10:, :45] > 0.6).all()


def test_few_texels_restore_a_smaller_share() -> None:
    """If a window has few texels, a smaller share of its missing light is restored.

    The chart has 25 texels in each of four blocks.

    In the window around one of these blocks, the four blocks have the weights 1, 2/3, 2/3 and 4/9.
    """
    noisy, chart = _pages()
    chart[:] = -1
    chart[3:13, 3:13] = 0
    result = keep_light(noisy, np.float32(0.5) * noisy, chart, chart >= 0)
    counted = 25.0 * (1.0 + 4.0 / 3.0 + 4.0 / 9.0)
    np.testing.assert_allclose(result[chart == 0], 0.5 * (1.0 + counted / (counted + 30.0)), rtol=1e-6)
    np.testing.assert_array_equal(result[chart < 0], 0.5)


def test_black_pages_stay_black() -> None:
    noisy, chart = _pages(32)
    zero = np.zeros_like(noisy)
    np.testing.assert_array_equal(keep_light(zero, zero, chart, chart >= 0), 0.0)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_rare_bright_samples_are_not_lost(seed: int) -> None:
    """Each of the 64 samples of a texel finds the light with a small probability.

    The probability falls from 0.3 % by a factor of e^3 across the page. Without `keep_light`, 11 to 13 % of
    the page's light would be missing. The tolerance is for chart borders and for the share that is not
    restored.
    """
    chart = np.zeros((128, 128), np.int32)
    random = np.random.Generator(np.random.PCG64(seed))
    chance = 0.003 * np.exp(-3.0 * np.linspace(0.0, 1.0, 128)) * np.ones((128, 1))
    share = random.binomial(64, chance, chart.shape) / 64.0
    value = (0.1 + share / 0.003).astype(np.float32)[..., None].repeat(3, axis=2)
    error = (np.sqrt(share * (1.0 - share) / 64.0) / 0.003).astype(np.float32)
    page = _finish(value, chart, error)
    assert page.mean() == pytest.approx(value.mean(), rel=0.03)
    assert page.std() < 0.35 * value.std()


def test_kept_texels_stay_as_they_were_sampled() -> None:
    """A dark strip with a small standard error lies in bright noise. A filter would blur light into it."""
    chart = np.zeros((64, 64), np.int32)
    random = np.random.Generator(np.random.PCG64(4))
    value = np.abs(random.normal(1.0, 0.3, (64, 64, 1))).astype(np.float32).repeat(3, axis=2)
    error = np.full(chart.shape, 0.3, np.float32)
    kept = np.zeros(chart.shape, bool)
    kept[20:40, 30:32] = True
    value[kept], error[kept] = 0.02, 0.005
    page = _finish(value, chart, error, kept)
    np.testing.assert_allclose(page[kept], value[kept], rtol=1e-6)
    outside = ~kept
    assert page[outside].std() < 0.5 * value[outside].std()
    assert page[outside].mean() == pytest.approx(value[outside].mean(), rel=0.01)
