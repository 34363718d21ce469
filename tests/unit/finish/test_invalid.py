"""`fill_invalid` gives the same values on small pages as plain loops over rings of neighbours."""

from __future__ import annotations

import finish_pages as pages
import numpy as np
import pytest

from baker.finish.invalid import fill_invalid


def random_page(seed: int, height: int = 23, width: int = 31):
    rng = np.random.default_rng(seed)
    chart = np.repeat(np.repeat(rng.integers(-1, 4, (6, 8)), 4, 0), 4, 1)[:height, :width].astype(np.int32)
    valid = (chart >= 0) & (rng.random(chart.shape) < 0.2)
    return rng.random((height, width, 3), dtype=np.float32), chart, valid


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_agrees_with_plain_loops_where_a_chart_hangs_together(seed):
    value, chart, valid = random_page(seed)
    filled, n_hopeless = fill_invalid(value, chart, valid)
    slow, known = pages.slow_rings(value, chart, valid)
    assert known.sum() > 3 * valid.sum()
    # Both functions sum in float64 and store float32, so values differ by at most one float32 rounding.
    np.testing.assert_allclose(filled[known], slow[known], rtol=3e-7)
    assert n_hopeless == 0
    np.testing.assert_array_equal(filled[valid], value[valid])
    np.testing.assert_array_equal(filled[chart < 0], value[chart < 0])


def test_no_value_crosses_into_another_chart_and_nan_does_not_survive():
    chart = np.zeros((12, 12), np.int32)
    chart[:, 6:] = 1
    valid = np.zeros(chart.shape, bool)
    valid[:, [0, 11]] = True
    value = np.full((12, 12, 1), np.nan, np.float32)
    value[:, 0] = 1.0
    value[:, 11] = 100.0
    filled, _ = fill_invalid(value, chart, valid)
    assert (filled[:, :6] == 1.0).all()
    assert (filled[:, 6:] == 100.0).all()


def test_each_side_of_a_strip_inside_geometry_keeps_its_own_light():
    chart = np.zeros((20, 21), np.int32)
    valid = np.ones(chart.shape, bool)
    valid[:, 7:14] = False
    value = np.zeros((20, 21, 1), np.float32)
    value[:, :7] = 5.0
    filled, _ = fill_invalid(value, chart, valid)
    assert (filled[:, 7:10] == 5.0).all()
    assert (filled[:, 11:] == 0.0).all()


def test_a_chart_without_any_valid_texel_keeps_its_numbers_and_is_counted():
    chart = np.full((5, 9), -1, np.int32)
    chart[1:4, 1:4] = 0
    chart[1:4, 5:8] = 3
    valid = chart == 0
    value = np.ones((5, 9, 3), np.float32)
    value[chart == 3] = 7.0
    value[2, 6] = np.nan
    filled, n_hopeless = fill_invalid(value, chart, valid)
    assert n_hopeless == 9
    assert filled[2, 6].tolist() == [0.0, 0.0, 0.0]
    assert (filled[chart == 3] == 7.0).sum() == 8 * 3
    assert (filled[chart != 3] == 1.0).all()


def test_a_cut_off_piece_takes_the_mean_of_its_chart():
    chart = np.array([[0, 0, -1, 0]], np.int32)
    value = np.array([[[1.0], [3.0], [0.0], [9.0]]], np.float32)
    filled, n_hopeless = fill_invalid(value, chart, np.array([[True, True, False, False]]))
    assert filled[0, :, 0].tolist() == [1.0, 3.0, 0.0, 2.0]
    assert n_hopeless == 0


def test_an_empty_page_and_mismatched_arrays():
    value = np.zeros((4, 4, 3), np.float32)
    empty = np.full((4, 4), -1, np.int32)
    filled, n_hopeless = fill_invalid(value, empty, np.zeros((4, 4), bool))
    assert n_hopeless == 0
    assert (filled == 0.0).all()
    with pytest.raises(ValueError, match="valid must cover"):
        fill_invalid(value, empty, np.zeros((4, 5), bool))
    with pytest.raises(ValueError, match="value must be"):
        fill_invalid(value[..., 0], empty, np.zeros((4, 4), bool))
    with pytest.raises(ValueError, match="chart must be"):
        fill_invalid(value, empty.astype(np.int64), np.zeros((4, 4), bool))
