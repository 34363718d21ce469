"""Defines the base class of results, which show one line in consoles and a table in notebooks."""

from __future__ import annotations

import base64
import struct
import zlib
from typing import Any

import numpy as np
from numpy.typing import NDArray

from baker.core.printable import printable

# Longest side of a picture in a notebook, pixels.
THUMBNAIL = 256


class Result:
    """Base class of the return values of the Python API.

    A subclass overrides `summary`, `to_dict` and, if it has a picture, `picture`. `repr` shows the summary in
    one line. A notebook shows the summary as a table, with the picture scaled down below it.
    """

    def summary(self) -> dict[str, Any]:
        """Return the names and values that `repr` and notebooks show, the most important first."""
        return {}

    def picture(self) -> NDArray[np.float32] | None:
        """Return a picture (H, W), (H, W, 1) or (H, W, 3) with linear values; None if there is no picture."""
        return None

    def to_dict(self) -> dict[str, Any]:
        """Return the result as JSON-serialisable values: numbers, strings, lists and dicts."""
        raise NotImplementedError

    def __repr__(self) -> str:
        rows = ", ".join(f"{name} {_words(value)}" for name, value in self.summary().items())
        return printable(f"<{type(self).__name__}: {rows}>")

    def _repr_html_(self) -> str:
        # Import here, because commands make no HTML, and the module has a large table.
        from html import escape

        rows = "".join(
            f"<tr><th style='text-align:left'>{escape(str(name))}</th>"
            f"<td>{escape(printable(_words(value)))}</td></tr>"
            for name, value in self.summary().items()
        )
        picture = self.picture()
        shown = "" if picture is None or not picture.size else f"<img alt='' src='{picture_uri(picture)}'>"
        return f"<b>{escape(type(self).__name__)}</b><table>{rows}</table>{shown}"


class Metrics:
    """Mixin for dataclasses with a dict `metrics`. It lets each metric also be read as an attribute."""

    metrics: dict[str, Any]

    @property
    def figures(self) -> dict[str, Any]:
        """Return `metrics`, another name for the same dict."""
        return self.metrics

    def __getattr__(self, name: str) -> Any:
        metrics = self.__dict__.get("metrics", {})
        if name in metrics:
            return metrics[name]
        raise AttributeError(f"'{type(self).__name__}' object has no attribute '{name}'")

    def __dir__(self) -> list[str]:
        return sorted({*super().__dir__(), *self.metrics})


def picture_uri(linear: NDArray[np.float32]) -> str:
    """Return a small PNG of a picture as a data URI.

    Parameters
    ----------
    linear : (H, W), (H, W, 1) or (H, W, 3) float32
        A picture of one component is clipped to 0 to 1 and not sRGB-encoded. Each component x of a colour
        picture becomes x / (x + m), sRGB-encoded, with m the median brightness of the pixels that are not
        black. The brightness of a pixel is the mean of R, G and B. If all pixels are black, m = 1.

    Returns
    -------
    str
        "data:image/png;base64,..."; an image of at most `THUMBNAIL` pixels a side. Larger pictures are
        reduced by leaving out rows and columns.
    """
    value = np.asarray(linear, np.float32)
    value = value[..., None] if value.ndim == 2 else value
    step = max(1, -(-max(value.shape[:2]) // THUMBNAIL))
    value = np.nan_to_num(value[::step, ::step], posinf=0.0, neginf=0.0)
    if value.shape[2] == 1:
        level = np.repeat(value, 3, axis=2)
    else:
        luminance = value.mean(axis=2)
        lit = luminance[luminance > 0]
        middle = float(np.median(lit)) if lit.size else 1.0
        tone = np.maximum(value, 0) / (np.maximum(value, 0) + middle)
        level = np.where(tone <= 0.0031308, 12.92 * tone, 1.055 * tone ** (1 / 2.4) - 0.055)
    pixels = np.rint(np.clip(level, 0, 1) * 255).astype(np.uint8)
    return "data:image/png;base64," + base64.b64encode(_png(pixels)).decode("ascii")


def _png(pixels: NDArray[np.uint8]) -> bytes:
    """Return the PNG file of pixels (H, W, 3) uint8. This package must not import `baker.io.png`."""
    height, width = pixels.shape[:2]
    rows = np.zeros((height, 1 + 3 * width), np.uint8)
    rows[:, 1:] = pixels.reshape(height, -1)

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    head = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    body = chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(rows.tobytes())) + chunk(b"IEND", b"")
    return b"\x89PNG\r\n\x1a\n" + body


def _words(value: Any) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:.4g}" if isinstance(value, float) else str(value)
