"""Denoised synthetic pages are compared with their noise-free light, inside charts and at chart borders."""

from __future__ import annotations

import sys
import types

import finish_pages as pages
import numpy as np
import pytest

from baker.core.errors import Cancelled, ResourceError
from baker.finish import oidn
from baker.finish.denoise import FITTED, denoise_page, denoiser_name, surround_charts
from baker.finish.finish import ComponentRules, PageLayer, PagePlan, finish_page, open_finisher
from baker.finish.kernels import page_guard
from baker.finish.kernels.page_guard import hold_to_samples
from baker.finish.noise import estimate_error
from baker.finish.oidn import LightmapDenoiser

LIGHT = ComponentRules(0.0, np.inf, (slice(0, 3),))
COLOUR = np.array([1.0, 0.85, 0.6], np.float32)


@pytest.fixture(scope="module")
def lit():
    value, chart, _ = pages.make_page(pages.contact)
    return value * COLOUR, chart


def with_noise(value, share, seed=0):
    grains = np.random.default_rng(seed).gamma(share**-2, share**2, value.shape[:2])
    return (value * grains[..., None]).astype(np.float32)


def wrong(value, truth, mask):
    return float(np.sqrt(np.mean((value[mask] / truth[mask] - 1.0) ** 2)))


def rings(chart):
    """Return two masks of covered texels: those within 2 texels of an empty texel, and the other ones."""
    distance = pages.squared_distance(chart < 0)
    return (chart >= 0) & (distance <= 4), (chart >= 0) & (distance > 4)


@pytest.mark.parametrize(
    ("share", "inner_gain", "border_gain"), [(0.05, 2.5, 1.3), (0.2, 4.0, 2.0), (0.4, 5.0, 2.5)]
)
@pytest.mark.parametrize("known_error", [False, True])
def test_noise_falls_inside_and_on_chart_borders(lit, share, inner_gain, border_gain, known_error):
    truth, chart = lit
    noisy = with_noise(truth, share)
    error = (share * truth @ np.float32([0.2126, 0.7152, 0.0722])).astype(np.float32) if known_error else None
    clean = denoise_page(noisy, chart >= 0, chart, standard_error=error, denoiser=LightmapDenoiser(2))
    border, inner = rings(chart)
    assert wrong(clean, truth, inner) * inner_gain < wrong(noisy, truth, inner)
    assert wrong(clean, truth, border) * border_gain < wrong(noisy, truth, border)
    # If the texels between the charts were black in the denoiser's input, the outermost ring of texels would
    # become 10 to 17 % too dark.
    assert abs(np.mean(clean[border] / truth[border]) - 1.0) < 0.015 + 0.07 * share


def test_a_converged_page_stays_what_it_is(lit):
    truth, chart = lit
    clean = denoise_page(truth, chart >= 0, chart)
    assert wrong(clean, truth, chart >= 0) < 0.002
    exact = denoise_page(truth, chart >= 0, chart, standard_error=np.zeros(chart.shape, np.float32))
    np.testing.assert_array_equal(exact, truth)


def test_a_nearly_converged_page_gets_no_worse(lit):
    truth, chart = lit
    for share in (0.005, 0.01):
        noisy = with_noise(truth, share)
        error = (share * truth[..., 1]).astype(np.float32)
        # Without a standard error, the noise estimate contains some curvature of the contact shadow.
        for standard_error, most in ((error, 1.05), (None, 1.25)):
            clean = denoise_page(noisy, chart >= 0, chart, standard_error=standard_error)
            for part in rings(chart):
                assert wrong(clean, truth, part) < most * wrong(noisy, truth, part)


def test_an_upper_bound_is_lowered_to_the_noise_that_is_seen(lit):
    truth, chart = lit
    noisy = with_noise(truth, 0.05)
    error = (0.05 * truth @ np.float32([0.2126, 0.7152, 0.0722])).astype(np.float32)

    def clean(standard_error, **more):
        return denoise_page(noisy, chart >= 0, chart, standard_error=standard_error, **more)

    right, lowered = clean(FITTED * error), clean(6 * error, bound=True)
    covered = chart >= 0
    assert wrong(lowered, right, covered) < 0.1 * wrong(clean(6 * error), right, covered)
    # If the bound equals the true standard error, the denoiser does not lower the bound. With a bound of
    # zero, the page is not filtered.
    assert wrong(clean(error, bound=True), clean(error), covered) < 1e-3
    np.testing.assert_array_equal(clean(0 * error, bound=True), noisy)


def test_ambient_occlusion_is_filtered_as_grey_and_gaps_stay(lit):
    truth, chart = lit
    occlusion = np.ascontiguousarray(truth[..., :1] / truth.max())
    noisy = with_noise(occlusion, 0.1)
    noisy[chart < 0] = 0.125
    clean = denoise_page(noisy, chart >= 0, chart)
    assert clean.shape == noisy.shape
    assert (clean[chart < 0] == 0.125).all()
    assert wrong(clean, occlusion, chart >= 0) < 0.4 * wrong(noisy, occlusion, chart >= 0)


def test_same_bytes_for_any_threads_memory_and_run(lit):
    truth, chart = lit
    noisy = with_noise(truth, 0.2)
    first = denoise_page(noisy, chart >= 0, chart).tobytes()
    assert denoise_page(noisy, chart >= 0, chart, denoiser=LightmapDenoiser(2)).tobytes() == first
    assert denoise_page(noisy, chart >= 0, chart, denoiser=LightmapDenoiser(2, 64)).tobytes() == first


def test_surroundings_continue_a_chart_by_its_slope_and_leave_charts_alone():
    def ramp(k, x, y):
        return 1.0 + 0.02 * x + 0.01 * y

    value, chart, _ = pages.make_page(ramp)
    covered = chart >= 0
    picture = surround_charts(value, covered, chart)
    np.testing.assert_array_equal(picture[covered], value[covered])
    x = np.arange(pages.SIZE) + 0.5
    expected = ramp(0, x[None, :], x[:, None])
    distance = pages.squared_distance(covered)
    near = (distance > 0) & (distance <= 9)
    # If `surround_charts` mirrored values at the border without their slope, the error would be twice the
    # slope times the distance, up to 8 %. The tolerance is needed because the value of a partly covered texel
    # is that of the covered part's centroid, up to half a texel from the texel's centre.
    assert np.abs(picture[near, 0] / expected[near] - 1.0).max() < 0.025
    assert picture.min() > 0.0


def test_surroundings_of_a_thin_chart_fold_back_into_it():
    chart = np.full((20, 30), -1, np.int32)
    chart[9:11] = 0
    value = np.zeros((20, 30, 1), np.float32)
    value[9:11] = 3.0
    assert (surround_charts(value, chart >= 0, chart) == 3.0).all()


def test_noise_is_estimated_within_a_tenth_and_edges_are_not_noise(lit):
    truth, chart = lit
    for share in (0.02, 0.2):
        noisy = with_noise(truth, share)[..., 0]
        error = estimate_error(noisy, chart, chart >= 0)
        ratio = error[chart >= 0] / (share * truth[..., 0][chart >= 0])
        assert abs(np.median(ratio) - 1.0) < 0.1
    step = np.where(np.arange(64) < 30, 1.0, 5.0).astype(np.float32) * np.ones((64, 1), np.float32)
    assert estimate_error(step, np.zeros((64, 64), np.int32), np.ones((64, 64), bool)).max() == 0.0
    nothing = estimate_error(step, np.full((64, 64), -1, np.int32), np.zeros((64, 64), bool))
    assert (nothing == 0.0).all()


def test_the_guard_agrees_with_plain_loops(lit):
    truth, chart = lit
    noisy, guess = with_noise(truth, 0.3), (truth * 1.1).astype(np.float32)
    covered = chart >= 0
    error = (0.1 * truth[..., 1]).astype(np.float32)
    out = np.zeros_like(noisy)
    hold_to_samples(noisy, guess, chart, covered, error, out, 0, pages.SIZE)
    for r, c in np.argwhere(covered)[::53]:
        rows, columns = np.nonzero(covered & (chart == chart[r, c]))
        near = (abs(rows - r) <= 2) & (abs(columns - c) <= 2)
        rows, columns = rows[near], columns[near]
        w = 1.0 / (1.0 + (rows - r) ** 2 + (columns - c) ** 2)
        mean = w @ (noisy[rows, columns].astype(float) - guess[rows, columns]) / w.sum()
        one = np.sqrt(max(w @ error[rows, columns].astype(float) ** 2 / w.sum(), float(error[r, c]) ** 2))
        scale = guess[r, c] / (guess[r, c] @ np.array([0.2126, 0.7152, 0.0722]))
        most = page_guard.MEAN_SIGMAS * one * np.sqrt((w**2).sum()) / w.sum() * scale
        expected = guess[r, c] + np.sign(mean) * np.maximum(np.abs(mean) - most, 0.0)
        far = page_guard.TEXEL_SIGMAS * one * scale
        expected = np.clip(expected, noisy[r, c] - far, noisy[r, c] + far)
        around = noisy[rows, columns]
        expected = np.clip(expected, around.min(axis=0), around.max(axis=0))
        own_error = page_guard.OWN_ERROR if len(rows) == 25 else page_guard.OWN_ERROR_BORDER
        noise, bias = (one * scale) ** 2, (own_error * expected) ** 2
        expected = (noise * expected + bias * noisy[r, c]) / (noise + bias)
        np.testing.assert_allclose(out[r, c], expected, rtol=1e-5, atol=1e-6)


def test_cancelling_stops_the_filter_and_failures_in_progress_come_through(lit):
    truth, chart = lit
    told = []

    def stop(stage, fraction, detail=""):
        told.append((stage, fraction))
        return True

    with pytest.raises(Cancelled):
        denoise_page(truth, chart >= 0, chart, progress=stop)
    assert len(told) == 1
    assert told[0][0] == "denoise"

    def interrupt(stage, fraction, detail=""):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        denoise_page(truth, chart >= 0, chart, progress=interrupt)


def test_progress_rises_to_one(lit):
    truth, chart = lit
    told = []
    denoise_page(truth, chart >= 0, chart, progress=lambda stage, fraction, detail="": told.append(fraction))
    assert told == sorted(told)
    assert told[-1] == pytest.approx(1.0)


def test_an_empty_page_needs_no_filter_and_odd_channels_are_refused():
    value = np.full((8, 8, 3), 2.0, np.float32)
    chart = np.full((8, 8), -1, np.int32)
    np.testing.assert_array_equal(denoise_page(value, chart >= 0, chart), value)
    with pytest.raises(ValueError, match="1 or 3 channels"):
        denoise_page(value[..., :2], chart >= 0, chart)


def test_one_texel_and_one_row(lit):
    for shape in ((1, 1), (1, 40), (3, 2)):
        chart = np.zeros(shape, np.int32)
        value = np.full((*shape, 3), 2.0, np.float32)
        np.testing.assert_allclose(denoise_page(value, chart >= 0, chart), value, rtol=1e-3)


def test_the_denoiser_names_itself():
    name = denoiser_name()
    assert name["name"] == "Open Image Denoise"
    assert name["filter"] == "RTLightmap"
    assert name["version"].split(".")[0] == "2"


def test_a_missing_library_is_one_sentence(monkeypatch):
    broken = types.ModuleType("pyoidn")
    monkeypatch.setitem(sys.modules, "pyoidn", broken)
    monkeypatch.setitem(sys.modules, "pyoidn.capi", None)
    with pytest.raises(ResourceError, match="bake with `denoise=False`"):
        oidn.denoiser_name()


@pytest.mark.parametrize("dim", [1e-3, 1e-6])
def test_a_dim_chart_is_filtered_as_well_beside_bright_ones(lit, dim):
    """Scaling the light of one chart down by up to 1e6 hardly changes its relative error after filtering."""
    truth, chart = lit
    noisy = with_noise(truth, 0.2)
    error = (0.2 * truth @ np.float32([0.2126, 0.7152, 0.0722])).astype(np.float32)
    alike = denoise_page(noisy, chart >= 0, chart, standard_error=error)
    scale = np.where(chart == 0, dim, 1.0).astype(np.float32)
    unlike = denoise_page(noisy * scale[..., None], chart >= 0, chart, standard_error=error * scale)
    own = chart == 0
    assert wrong(unlike / scale[..., None], truth, own) < 1.15 * wrong(alike, truth, own)
    assert wrong(unlike / scale[..., None], truth, own) < 0.3 * wrong(noisy, truth, own)


@pytest.mark.parametrize("dim", [1.0, 1e-5])
def test_what_is_worth_filtering_depends_on_its_own_light(lit, dim):
    """A noisy chart is filtered even if it is dim. Charts without noise on the same page do not change."""
    truth, chart = lit
    own, others = chart == 0, chart > 0
    scale = np.where(own, dim, 1.0).astype(np.float32)
    noisy = np.where(own[..., None], with_noise(truth, 0.2), truth) * scale[..., None]
    error = np.where(own, 0.2 * dim * truth @ np.float32([0.2126, 0.7152, 0.0722]), 0.0).astype(np.float32)
    plan = PagePlan(chart, chart >= 0, np.zeros((*chart.shape, 2), np.float32))
    with open_finisher(threads=1, dilation=2, denoise=True) as finisher:
        page, _ = finish_page(plan, [PageLayer(noisy.astype(np.float32), error)], LIGHT, finisher)
    clean = page / scale[..., None]
    assert wrong(clean, truth, own) < 0.3 * wrong(noisy / scale[..., None], truth, own)
    # Windows contain texels of one chart only, so the charts without noise keep their exact values.
    np.testing.assert_array_equal(page[others], noisy[others].astype(np.float32))
