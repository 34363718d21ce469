"""`pack_charts` moves charts to a smaller page and back. Charts keep their shapes and do not touch."""

from __future__ import annotations

import numpy as np

from baker.finish.packing import pack_charts


def charts():
    chart = np.full((90, 120), -1, np.int32)
    chart[3:20, 5:9] = 4
    chart[40:42, 10:100] = 7
    chart[60:88, 90:118] = 2
    chart[70, 95] = -1
    chart[0, 0] = 1
    return chart


def test_chosen_charts_come_back_where_they_were():
    chart = charts()
    chosen = np.isin(chart, (4, 7, 1))
    page = np.random.default_rng(0).random((90, 120, 3), np.float32)
    packed = pack_charts(chart, chosen)
    small = packed.take(page)
    assert small.shape[:2] == packed.shape
    assert small.shape[0] * small.shape[1] < 0.4 * chart.size
    result = np.zeros_like(page)
    packed.put(small, result)
    assert (result[chosen] == page[chosen]).all()
    assert (result[~chosen] == 0).all()


def test_charts_keep_their_shape_and_their_distance():
    chart = charts()
    packed = pack_charts(chart, chart >= 0)
    small = packed.take(chart, fill=-1)
    row, column = np.indices(chart.shape)
    rows, columns = packed.take(row), packed.take(column)
    for number in (1, 2, 4, 7):
        own = small == number
        assert own.sum() == (chart == number).sum()
        r, c = np.nonzero(own)
        assert len(np.unique(rows[own] - r)) == len(np.unique(columns[own] - c)) == 1
        # No other chart lies within 4 texels.
        for down in range(-4, 5):
            for right in range(-4, 5):
                other = np.roll(small, (down, right), axis=(0, 1))[own]
                assert ((other == number) | (other == -1)).all()
