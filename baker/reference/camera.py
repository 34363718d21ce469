"""A pinhole camera: its rays, and how one is described on a command line."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from baker.core.errors import SettingsError
from baker.core.scene import Camera
from baker.kernels.sampling import hash_u32


def parse_camera(text: str) -> Camera:
    """Return the camera of "PX,PY,PZ,TX,TY,TZ,FOV": position, target, vertical field of view in degrees.

    Raises
    ------
    SettingsError
        If that is not what the text says, or it looks nowhere.
    """
    try:
        px, py, pz, tx, ty, tz, fov = (float(part) for part in text.split(","))
    except ValueError:
        message = "seven numbers are needed: position x,y,z, target x,y,z, vertical field of view in degrees"
        raise SettingsError(f"'{text[:60]}' is no camera; {message}", object="--camera") from None
    if not all(math.isfinite(v) for v in (px, py, pz, tx, ty, tz)) or not 0 < fov < 180:
        raise SettingsError("the field of view must be above 0 and below 180 degrees", object="--camera")
    return look_at((px, py, pz), (tx, ty, tz), fov)


def look_at(position: tuple[float, float, float], target: tuple[float, float, float], fov: float) -> Camera:
    """Return a camera at `position` towards `target` with +Y up; fov in degrees.

    Raises
    ------
    SettingsError
        If target and position are one.
    """
    forward = np.subtract(target, position)
    length = float(np.linalg.norm(forward))
    if not length > 0:
        raise SettingsError("position and target are the same point", object="--camera")
    forward = forward / length
    # Straight up or down +Y says nothing about what is up in the picture: -Z is.
    hint = np.array([0.0, 1.0, 0.0]) if abs(forward[1]) < 0.99999 else np.array([0.0, 0.0, -1.0])
    right = np.cross(forward, hint)
    right /= np.linalg.norm(right)
    up = np.cross(right, forward)
    x, y, z = (tuple(float(v) for v in axis) for axis in (right, up, forward))
    return Camera("camera", -1, position, x, y, z, math.radians(fov))  # type: ignore[arg-type]


def camera_rays(
    camera: Camera, width: int, height: int, pixel: NDArray[np.int64], samples: int, seed: int, number: int
) -> NDArray[np.float64]:
    """Return unit directions (n, samples, 3) through pixels, spread evenly over each pixel's square.

    Parameters
    ----------
    pixel : (n,) int64
        row * width + column, row 0 on top.
    samples : int
        Directions of each pixel in this pass: a lattice, shifted at random for each pixel and pass.
    number : int
        The pass.
    """
    k = np.arange(samples)
    # Kronecker lattice of the plastic number (Roberts 2018): even for any count.
    lattice = np.stack([(k * 0.7548776662466927) % 1.0, (k * 0.5698402909980532) % 1.0], axis=1)
    shift = np.stack([_uniform(pixel, seed, 2 * number), _uniform(pixel, seed, 2 * number + 1)], axis=1)
    inside = (lattice[None] + shift[:, None]) % 1.0
    row, column = np.divmod(pixel, width)
    high = math.tan(0.5 * camera.fov)
    x = (2 * (column[:, None] + inside[..., 0]) / width - 1) * high * width / height
    y = (1 - 2 * (row[:, None] + inside[..., 1]) / height) * high
    way = (
        np.array(camera.forward) + x[..., None] * np.array(camera.right) + y[..., None] * np.array(camera.up)
    )
    unit: NDArray[np.float64] = way / np.linalg.norm(way, axis=2, keepdims=True)
    return unit


def _uniform(pixel: NDArray[np.int64], seed: int, salt: int) -> NDArray[np.float64]:
    """Return a uniform number for each pixel."""
    word = np.uint64(int(hash_u32(np.uint32((seed * 0x9E3779B1 + salt * 0x85EBCA77 + 1) & 0xFFFFFFFF))))
    x = (pixel.astype(np.uint64) + np.uint64(1)) * np.uint64(0x9E3779B97F4A7C15) + (word << np.uint64(17))
    x ^= x >> np.uint64(31)
    x *= np.uint64(0xBF58476D1CE4E5B9)
    x ^= x >> np.uint64(29)
    x *= np.uint64(0x94D049BB133111EB)
    x ^= x >> np.uint64(32)
    return (x >> np.uint64(11)).astype(np.float64) / 9007199254740992.0
