"""Computes closed forms of irradiance and ambient occlusion, with which tests compare bakes."""

from __future__ import annotations

from typing import Any

import numpy as np


def polygon_irradiance(polygon: Any, point: Any, normal: Any) -> np.ndarray:
    """Return E / L at points (..., 3) with a common normal, from a polygon (K, 3) of radiance L.

    E = L / 2 sum_i angle_i Gamma_i . n, where angle_i is the angle that edge i subtends at the point and
    Gamma_i the unit normal of the plane through edge i and the point. The polygon must be wholly above the
    horizon of the points. Its corners run counter-clockwise seen from its front.
    Based on: Lambert, Photometria, 1760; Arvo, Analytic methods for simulated light transport, 1995.
    """
    point, normal = np.asarray(point, float), np.asarray(normal, float)
    arm = np.asarray(polygon, float) - point[..., None, :]
    arm = arm / np.linalg.norm(arm, axis=-1, keepdims=True)
    after = np.roll(arm, -1, axis=-2)
    cross = np.cross(arm, after)
    length = np.linalg.norm(cross, axis=-1)
    angle = np.arctan2(length, (arm * after).sum(axis=-1))
    edge = cross / np.maximum(length, 1e-300)[..., None]
    # The sign is negative because the corners run counter-clockwise as seen from the point.
    return np.maximum(-0.5 * (angle * (edge @ normal)).sum(axis=-1), 0.0)


def point_irradiance(light: Any, point: Any, normal: Any) -> np.ndarray:
    """Return E / I of a point light: cos / r^2."""
    arm = np.asarray(light, float) - np.asarray(point, float)
    square = (arm * arm).sum(axis=-1)
    return np.maximum(arm @ np.asarray(normal, float), 0.0) / square**1.5


def wall_ao(distance: Any, height: float) -> np.ndarray:
    """Return the AO of a floor at `distance` from an infinitely long wall of `height`."""
    distance = np.asarray(distance, float)
    return 0.5 * (1 + distance / np.hypot(distance, height))


def limited_wall_ao(distance: Any, reach: float) -> np.ndarray:
    """Return the AO of a floor at `distance` from an infinite wall, for rays of length `reach`.

    Cosine-weighted directions are uniform in their projection to the unit disc. Rays that hit the wall within
    `reach` are the disc's segment x > distance / reach.
    """
    c = np.clip(np.asarray(distance, float) / reach, 0.0, 1.0)
    return 1 - (np.arccos(c) - c * np.sqrt(1 - c * c)) / np.pi


def solid_angle(triangle: Any, point: Any) -> np.ndarray:
    """Return the solid angles (t,) of triangles (t, 3, 3) seen from a point.

    Based on: van Oosterom and Strackee, The solid angle of a plane triangle, 1983.
    """
    a, b, c = (np.asarray(triangle, float)[:, k] - np.asarray(point, float) for k in range(3))
    la, lb, lc = (np.linalg.norm(x, axis=1) for x in (a, b, c))
    volume = np.abs((a * np.cross(b, c)).sum(axis=1))
    below = la * lb * lc + (a * b).sum(axis=1) * lc + (a * c).sum(axis=1) * lb + (b * c).sum(axis=1) * la
    return 2 * np.arctan2(volume, below)


def spot_flux(inner: float, outer: float) -> float:
    """Return the flux, lm, of a glTF spot light of one candela.

    Between the cones, the fall-off is ((cos - cos_o) / (cos_i - cos_o))^2, whose integral over cos is
    (cos_i - cos_o) / 3.
    """
    ci, co = np.cos(inner), np.cos(outer)
    return float(2 * np.pi * ((1 - ci) + (ci - co) / 3))


def parallel_squares() -> float:
    """Return the form factor of two unit squares that face each other one unit apart."""
    x = np.sqrt(2.0)
    return float(2 / np.pi * (np.log(2 / np.sqrt(3)) + 2 * x * np.arctan(1 / x) - 2 * np.arctan(1.0)))


def perpendicular_squares() -> float:
    """Return the form factor of two perpendicular unit squares with a common edge."""
    return (1 - parallel_squares()) / 4


def walled_ao(distance: Any, height: float, reach: float) -> np.ndarray:
    """Return the AO of a floor at `distance` from an endless wall of `height`, for rays of length `reach`.

    Cosine-weighted directions are uniform in their projection to the unit disc. A ray (x, y, z) hits the
    plane of the wall after a length of distance / x, at height z distance / x. So the ray is blocked if x >
    distance / reach and (x / a)^2 + y^2 > 1, with a = distance / hypot(distance, height).
    """
    distance = np.asarray(distance, float)
    a = distance / np.hypot(distance, height)
    c = np.clip(distance / reach, 0.0, 1.0)

    def segment(cut: Any) -> Any:
        return np.arccos(cut) - cut * np.sqrt(1 - cut * cut)

    return 1 - (segment(c) - a * segment(np.minimum(c / a, 1.0))) / np.pi


def cornered_ao(x: Any, y: Any, reach: float) -> np.ndarray:
    """Return the AO of a floor at distances x and y from two infinite walls at a right angle.

    Blocked directions are two segments of the unit disc. Their area is the sum of both, minus their overlap.
    """
    c, d = np.asarray(x, float) / reach, np.asarray(y, float) / reach

    def segment(cut: Any) -> Any:
        cut = np.minimum(cut, 1.0)
        return np.arccos(cut) - cut * np.sqrt(1 - cut * cut)

    # The overlap is the area with x > c and y > d, that is, the integral of sqrt(1 - x^2) - d over x > c.
    end = np.sqrt(np.maximum(1 - d * d, 0.0))
    both = 0.5 * (
        np.arcsin(end) + end * d - np.arcsin(np.minimum(c, 1)) - c * np.sqrt(np.maximum(1 - c * c, 0))
    )
    both = np.where(c * c + d * d < 1, both - d * (end - c), 0.0)
    return 1 - (segment(c) + segment(d) - both) / np.pi
