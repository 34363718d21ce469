"""Makes the pictures of the HTML report: maps, errors of compared texels, windows around the worst texels.

Maps are shown as value / (value + middle), sRGB-encoded. middle is the median of the reference over the lit
texels that are compared, or over the lit texels of a window.
"""

from __future__ import annotations

import base64

import numpy as np
from numpy.typing import NDArray

from baker.io.html import escaped
from baker.io.png import encode_png, srgb_levels
from baker.metrics.error_metrics import dark_floor, relative_error
from baker.verification.verify import ChannelCheck, VerifyReport

# Pages are subsampled so that their images have less than twice this width, texels.
_SHOWN = 512
# Relative error at the yellow end of the colour scale.
_HOT = 0.10


def page_pictures(found: VerifyReport, name: str, check: ChannelCheck) -> str:
    """Return, for each page, an image of the map and an image of the errors of the compared texels."""
    size = found.bake.atlas.resolution
    step = max(size // _SHOWN, 1)
    usual = _usual(check.reference)
    error = relative_error(check.value, check.reference, dark_floor(check.reference))
    text = ""
    for page in range(found.bake.maps[name].shape[0]):
        stored = found.bake.maps[name][page][::step, ::step]
        text += _figure(_shown(stored, usual), f"{name}, page {page}", 1)
        heat = np.full((*stored.shape[:2], 3), 24, np.uint8)
        mine = found.pixel // (size * size) == page
        row, column = np.divmod(found.pixel[mine] % (size * size), size)
        # Draw a square of 3 x 3 pixels for each texel, in order of increasing error.
        for i in np.argsort(error[mine], kind="stable"):
            y, x = row[i] // step, column[i] // step
            heat[max(y - 1, 0) : y + 2, max(x - 1, 0) : x + 2] = _heat(float(error[mine][i]))
        text += _figure(heat, f"error of the compared texels: blue 0, yellow {_HOT:.0%} and more", 1)
    return text


def _heat(error: float) -> tuple[int, int, int]:
    t = min(error / _HOT, 1.0)
    return int(40 + 215 * t), int(60 + 160 * t * t), int(200 * (1 - t))


def _usual(value: NDArray[np.float64]) -> float:
    """Return the median over n of the positive colour means of `value` (n, C); 1 if there are none."""
    mean = value.mean(axis=1)
    return float(np.median(mean[mean > 0])) if (mean > 0).any() else 1.0


def _shown(image: NDArray[np.float32], middle: float) -> NDArray[np.uint8]:
    value = np.maximum(image, 0.0)
    mapped = value / (value + max(middle, 1e-9))
    return srgb_levels(np.broadcast_to(mapped, (*image.shape[:2], 3)).astype(np.float32))


def _figure(pixels: NDArray[np.uint8], caption: str, zoom: int) -> str:
    data = base64.b64encode(encode_png(np.ascontiguousarray(pixels))).decode("ascii")
    width = pixels.shape[1] * zoom
    picture = f'<img width="{width}" alt="{escaped(caption)}" src="data:image/png;base64,{data}">'
    return f"<figure>{picture}<figcaption>{escaped(caption)}</figcaption></figure>"


def crop_pictures(found: VerifyReport) -> str:
    """Return the stored map, the reference and the FLIP error of each window, as HTML."""
    if not found.crops:
        return ""
    text = "<h2>Around the worst texels</h2>"
    for crop in found.crops:
        middle = _usual(crop.reference.reshape(-1, crop.reference.shape[2]).astype(np.float64))
        where = f"{crop.channel}, page {crop.page}, rows from {crop.row}, columns from {crop.column}"
        text += "<div>" + _figure(_shown(crop.stored, middle), f"stored: {where}", 8)
        text += _figure(_shown(crop.reference, middle), "path-traced", 8)
        shade = np.repeat((np.clip(crop.error, 0, 1) * 255).astype(np.uint8)[..., None], 3, axis=2)
        text += _figure(shade, f"FLIP, mean {crop.flip:.3f}", 8) + "</div>"
    return text
