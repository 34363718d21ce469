# mypy: disable-error-code="no-untyped-def"
"""Kernels that limit the change of a denoised page by the standard error of its noisy samples.

1. The weighted mean difference between the noisy and the denoised page over a window of 5 x 5 texels is
   limited to `MEAN_SIGMAS` times the standard error of this mean, because a denoiser should remove noise but
   no light.
2. The change of each texel is limited to `TEXEL_SIGMAS` standard errors, and the result to the range of the
   noisy values in the window. The standard error is the texel's own, or the weighted RMS of the standard
   errors in the window if that is larger.
3. The result and the noisy value are averaged, weighted by inverse variance. So a converged page does not
   change.
"""

from __future__ import annotations

import math

import numpy as np

from baker.core.colour import LUMINANCE_WEIGHTS
from baker.trace.jit import kernel, larger, scratch, smaller

# Half side of the window, texels.
RADIUS = 2
# Largest mean difference of a window that is attributed to noise, as a multiple of the standard error of this
# mean.
MEAN_SIGMAS = 2.5
# Largest change of a texel, as a multiple of the standard error of step 2 above.
TEXEL_SIGMAS = 5.0
# Assumed relative error of the filter itself. On noise-free pages with contact shadows, 0.1 to 0.5 % was
# measured.
OWN_ERROR = 0.005
# Assumed relative error of the filter within two texels of a chart's border, where the covered part of texels
# changes in steps from row to row.
OWN_ERROR_BORDER = 0.02
_RED, _GREEN, _BLUE = LUMINANCE_WEIGHTS
_three, _range = scratch((3,), np.float64), scratch((2, 3), np.float64)


@kernel
def high_pass(luminance, chart, covered, out, first_row, end_row):
    """Convolve a page with [1 -2 1; -2 4 -2; 1 -2 1] / 6, whose result is 0 on planes.

    White noise keeps its standard deviation.

    Parameters
    ----------
    luminance : (H, W) float32
    chart : (H, W) int32
    covered : (H, W) bool
    out : (H, W) float32
        Receives the result at texels whose 3 x 3 neighbourhood is covered and in one chart. All other texels
        are unchanged.
    first_row, end_row : int
        Rows of the page to compute.

    Notes
    -----
    Immerkaer, Fast Noise Variance Estimation, 1996.
    """
    height, width = luminance.shape
    for r in range(larger(first_row, 1), smaller(end_row, height - 1)):
        for c in range(1, width - 1):
            inside = True
            total = 0.0
            for a in range(-1, 2):
                for b in range(-1, 2):
                    if not covered[r + a, c + b] or chart[r + a, c + b] != chart[r, c]:
                        inside = False
                    weight = (1.0 if a != 0 else -2.0) * (1.0 if b != 0 else -2.0)
                    total += weight * luminance[r + a, c + b]
            if inside:
                out[r, c] = total / 6.0


@kernel
def hold_to_samples(noisy, denoised, chart, covered, error, out, first_row, end_row):
    """Limit the difference between a denoised and a noisy page by the noisy page's standard error.

    Parameters
    ----------
    noisy, denoised : (H, W, 3) float32
    chart : (H, W) int32
    covered : (H, W) bool
    error : (H, W) float32
        Standard error of each noisy texel's luminance.
    out : (H, W, 3) float32, changed at covered texels of rows first_row to end_row - 1
    """
    height, width = chart.shape
    residual, extent = _three(), _range()
    for r in range(first_row, end_row):
        for c in range(width):
            if not covered[r, c]:
                continue
            # Sum weights, squared errors and differences, and find the range of values, over the window.
            sw = sww = se = 0.0
            n = 0
            for j in range(3):
                residual[j] = 0.0
                extent[0, j] = extent[1, j] = float(noisy[r, c, j])
            for rr in range(larger(r - RADIUS, 0), smaller(r + RADIUS + 1, height)):
                for cc in range(larger(c - RADIUS, 0), smaller(c + RADIUS + 1, width)):
                    if not covered[rr, cc] or chart[rr, cc] != chart[r, c]:
                        continue
                    w = 1.0 / (1.0 + float((rr - r) * (rr - r) + (cc - c) * (cc - c)))
                    n += 1
                    sw += w
                    sww += w * w
                    e = float(error[rr, cc])
                    se += w * e * e
                    for j in range(3):
                        sample = float(noisy[rr, cc, j])
                        residual[j] += w * (sample - float(denoised[rr, cc, j]))
                        extent[0, j] = smaller(extent[0, j], sample)
                        extent[1, j] = larger(extent[1, j], sample)
            # Use at least the mean error of the window, because the standard error of a texel is
            # underestimated if the texel has none of the rare bright samples.
            texel_error = math.sqrt(larger(se / sw, float(error[r, c]) ** 2))
            own_error = OWN_ERROR if n == (2 * RADIUS + 1) ** 2 else OWN_ERROR_BORDER
            mean_error = texel_error * math.sqrt(sww) / sw
            luminance = (
                _RED * float(denoised[r, c, 0])
                + _GREEN * float(denoised[r, c, 1])
                + _BLUE * float(denoised[r, c, 2])
            )
            for j in range(3):
                # Scale the error of the luminance to the channel, assuming the same relative noise.
                scale = 1.0
                if luminance > 0.0:
                    scale = smaller(larger(float(denoised[r, c, j]) / luminance, 0.0), 8.0)
                # Limit the mean difference of the window.
                believed = MEAN_SIGMAS * mean_error * scale
                mean = residual[j] / sw
                excess = larger(abs(mean) - believed, 0.0)
                value = float(denoised[r, c, j]) + (excess if mean > 0.0 else -excess)
                # Limit the change of the texel.
                far = TEXEL_SIGMAS * texel_error * scale
                own = float(noisy[r, c, j])
                value = smaller(larger(value, own - far), own + far)
                value = smaller(larger(value, extent[0, j]), extent[1, j])
                # Average with the noisy value by inverse variance.
                noise = (texel_error * scale) ** 2
                bias = (own_error * value) ** 2
                if noise + bias > 0.0:
                    value = (noise * value + bias * own) / (noise + bias)
                out[r, c, j] = value
