"""Draws the plots of the HTML report as inline SVG: errors by light level, and the histogram of z-scores."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from baker.core.readable import number, percent

# Size of a plot and its margins (left, right, top, bottom), pixels.
_WIDTH, _HEIGHT = 480, 220
_LEFT, _RIGHT, _TOP, _BOTTOM = 62, 12, 12, 42
# Colours of the curves and of the axes.
_ERROR, _NOISE, _BIAS, _AXIS = "#b00020", "#999999", "#2b5f9e", "#555555"


def level_plot(rows: list[dict[str, Any]]) -> str:
    """Return a plot with one point for each light level: x is the level's light, y are its errors.

    A light level is a group of texels with similar light. The text is empty for fewer than two levels.

    Parameters
    ----------
    rows : list of dict
        Rows of the table `levels` of one channel. Groups of the darkest texels are not drawn.

    Returns
    -------
    str
        HTML figure.
    """
    rows = [row for row in rows if row["light"] > 0 and not row["level"].startswith("the darkest")]
    if len(rows) < 2:
        return ""
    rows = sorted(rows, key=lambda row: row["light"])
    light = [math.log10(row["light"]) for row in rows]
    left, right = light[0], max(light[-1], light[0] + 1e-3)
    tops = [max(row["typical"], row["typical_noise"], row["bias"] + row["bias_se"]) for row in rows]
    high = max(0.01, 1.1 * float(max(tops)))
    low = min(0.0, 1.1 * float(min(row["bias"] - row["bias_se"] for row in rows)))

    def x(value: float) -> float:
        return _LEFT + (value - left) / (right - left) * (_WIDTH - _LEFT - _RIGHT)

    def y(value: float) -> float:
        return _TOP + (high - value) / (high - low) * (_HEIGHT - _TOP - _BOTTOM)

    def curve(name: str, colour: str, dash: str = "") -> str:
        points = " ".join(f"{x(at):.1f},{y(row[name]):.1f}" for at, row in zip(light, rows, strict=True))
        style = f' stroke-dasharray="{dash}"' if dash else ""
        return f'<polyline points="{points}" fill="none" stroke="{colour}" stroke-width="2"{style}/>'

    bars = "".join(
        f'<path d="M{x(at):.1f} {y(row["bias"] - row["bias_se"]):.1f}V{y(row["bias"] + row["bias_se"]):.1f}"'
        f' stroke="{_BIAS}"/><circle cx="{x(at):.1f}" cy="{y(row["bias"]):.1f}" r="3" fill="{_BIAS}"/>'
        for at, row in zip(light, rows, strict=True)
    )
    body = "".join(_tick_y(value, y(value)) for value in _steps(low, high))
    body += "".join(_tick_x(10.0**at, x(at)) for at in _spread(light))
    body += curve("typical_noise", _NOISE, "5 4") + curve("typical", _ERROR) + bars
    caption = (
        f'error against light level: <b style="color:{_ERROR}">typical error of a texel</b>,'
        f' <b style="color:{_NOISE}">part of it that is noise of path tracing (dashed)</b>,'
        f' <b style="color:{_BIAS}">mean error with its standard error (dots)</b>'
    )
    return _figure(body, caption, "error against light level")


def _steps(low: float, high: float) -> list[float]:
    """Return at most five round values between two numbers, in equal steps."""
    raw = (high - low) / 4
    power = 10.0 ** math.floor(math.log10(raw))
    step = next(power * m for m in (1, 2, 5, 10) if power * m >= raw)
    return [k * step for k in range(math.ceil(low / step), math.floor(high / step) + 1)]


def _spread(light: list[float]) -> list[float]:
    """Return up to five of the light levels."""
    chosen = np.unique(np.linspace(0, len(light) - 1, min(len(light), 5)).round().astype(int))
    return [light[int(i)] for i in chosen]


def _tick_y(value: float, at: float) -> str:
    return (
        f'<path d="M{_LEFT} {at:.1f}H{_WIDTH - _RIGHT}" stroke="{"#888" if value == 0 else "#ddd"}"/>'
        f'<text x="{_LEFT - 6}" y="{at + 4:.1f}" text-anchor="end">{percent(value)}</text>'
    )


def _tick_x(value: float, at: float) -> str:
    bottom = _HEIGHT - _BOTTOM
    return (
        f'<path d="M{at:.1f} {bottom}v4" stroke="{_AXIS}"/>'
        f'<text x="{at:.1f}" y="{bottom + 18}" text-anchor="middle">{number(value)}</text>'
    )


def _figure(body: str, caption: str, label: str) -> str:
    middle = (_LEFT + _WIDTH - _RIGHT) / 2
    axis = f'<text x="{middle}" y="{_HEIGHT - 6}" text-anchor="middle">light of the level</text>'
    return (
        f'<figure><svg width="{_WIDTH}" height="{_HEIGHT}" font-size="12" fill="{_AXIS}" role="img"'
        f' aria-label="{label}">{body}{axis}</svg><figcaption>{caption}</figcaption></figure>'
    )


def histogram_plot(histogram: dict[str, list[float]]) -> str:
    """Return a plot of the histogram of z-scores, with the normal distribution of a bake without errors."""
    counts, edges = np.array(histogram["counts"]), np.array(histogram["edges"])
    if not counts.sum():
        return ""
    middle = 0.5 * (edges[1:] + edges[:-1])
    normal = np.exp(-0.5 * middle**2) / np.sqrt(2 * np.pi) * (edges[1] - edges[0]) * counts.sum()
    top = max(float(counts.max()), float(normal.max()))
    bars = "".join(
        f'<rect x="{20 * i}" y="{160 - high:.1f}" width="18" height="{high:.1f}" fill="#4a7fb5"/>'
        for i, high in enumerate(150 * counts / top)
    )
    line = " ".join(f"{20 * i + 9},{160 - 150 * n / top:.1f}" for i, n in enumerate(normal))
    caption = "error in standard errors of the reference, -6 to 6; line: what noise alone would give"
    return (
        f'<figure><svg width="480" height="162">{bars}'
        f'<polyline points="{line}" fill="none" stroke="#b00020"/></svg>'
        f"<figcaption>{caption}</figcaption></figure>"
    )
