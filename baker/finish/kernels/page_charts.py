# mypy: disable-error-code="no-untyped-def"
"""Statistics of the charts of a lightmap page: largest values, mean light, bounding boxes."""

from __future__ import annotations

from baker.trace.jit import kernel, larger, smaller


@kernel
def chart_maxima(value, chart, covered, highest):
    """Set each row of `highest` to the maximum of itself and the values of the chart's covered texels.

    value : (H, W, C) float32; chart : (H, W) int32; covered : (H, W) bool
    highest : (n_charts, C) float32, changed in place
    """
    height, width, channels = value.shape
    for r in range(height):
        for c in range(width):
            if covered[r, c]:
                for j in range(channels):
                    highest[chart[r, c], j] = larger(highest[chart[r, c], j], value[r, c, j])


@kernel
def chart_sums(value, weight, chart, covered, total, count):
    """Sum the luminance of each chart's covered texels and count these texels.

    value : (H, W, C) float32; chart : (H, W) int32; covered : (H, W) bool
    weight : (C,) float32, weights of the channels in the luminance
    total : (n_charts,) float64, sums, increased in place; count : (n_charts,) int64, increased in place
    """
    height, width, channels = value.shape
    for r in range(height):
        for c in range(width):
            if covered[r, c]:
                light = 0.0
                for j in range(channels):
                    light += value[r, c, j] * weight[j]
                total[chart[r, c]] += light
                count[chart[r, c]] += 1


@kernel
def chart_boxes(chart, chosen, low, high):
    """Write the first and last row and column of each chart's chosen texels.

    chart : (H, W) int32; chosen : (H, W) bool
    low, high : (n_charts, 2) int64 outputs, first and last (row, column); on entry, `low` is at least the
        side of the page, and `high` is -1
    """
    height, width = chart.shape
    for r in range(height):
        for c in range(width):
            if chosen[r, c]:
                k = chart[r, c]
                low[k, 0], high[k, 0] = smaller(low[k, 0], r), larger(high[k, 0], r)
                low[k, 1], high[k, 1] = smaller(low[k, 1], c), larger(high[k, 1], c)
