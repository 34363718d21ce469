"""Closed forms of illumination that the tests hold bakes against."""

from __future__ import annotations

from typing import Any

import numpy as np


def polygon_irradiance(polygon: Any, point: Any, normal: Any) -> np.ndarray:
    """Return E / L at points (..., 3) of surfaces facing `normal` under a polygon (K, 3) of even radiance.

    E = L / 2 sum_i angle_i Gamma_i . n; the whole polygon must lie above the surface, its front is the
    side from which its corners run counter-clockwise.
    Based on: Lambert, Photometria, 1760; Arvo, Analytic methods for simulated light transport, 1995, ch. 2.
    """
    point, normal = np.asarray(point, float), np.asarray(normal, float)
    arm = np.asarray(polygon, float) - point[..., None, :]
    arm = arm / np.linalg.norm(arm, axis=-1, keepdims=True)
    after = np.roll(arm, -1, axis=-2)
    cross = np.cross(arm, after)
    length = np.linalg.norm(cross, axis=-1)
    angle = np.arctan2(length, (arm * after).sum(axis=-1))
    edge = cross / np.maximum(length, 1e-300)[..., None]
    # Counter-clockwise seen from the lit side is clockwise seen along the contour from the point.
    return np.maximum(-0.5 * (angle * (edge @ normal)).sum(axis=-1), 0.0)


def point_irradiance(light: Any, point: Any, normal: Any) -> np.ndarray:
    """Return E / I of a point light: cos / r^2."""
    arm = np.asarray(light, float) - np.asarray(point, float)
    square = (arm * arm).sum(axis=-1)
    return np.maximum(arm @ np.asarray(normal, float), 0.0) / square**1.5


def wall_open_share(distance: Any, height: float) -> np.ndarray:
    """Return the open share of a floor at `distance` from an endless wall of that height."""
    distance = np.asarray(distance, float)
    return 0.5 * (1 + distance / np.hypot(distance, height))


def limited_wall_open_share(distance: Any, reach: float) -> np.ndarray:
    """Return the open share of a floor at `distance` from an endless, tall wall for rays of length `reach`.

    Cosine-weighted directions project to a disc evenly; those that meet the wall in time are the
    disc's segment x > distance / reach.
    """
    c = np.clip(np.asarray(distance, float) / reach, 0.0, 1.0)
    return 1 - (np.arccos(c) - c * np.sqrt(1 - c * c)) / np.pi
