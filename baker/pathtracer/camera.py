"""Computes rays through the pixels of a pinhole camera, and parses the text form of a camera."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from baker.core.errors import SettingsError
from baker.core.scene import Camera
from baker.kernels.sampling import hash_u32
from baker.pathtracer.rng import mix64
from baker.trace.jit import inner, kernel

# Columns of a camera in kernels: position, metres (3); unit directions right, up and forward (3 each);
# tangent of half the vertical field of view; width and height of the picture, pixels.
EYE, RIGHT, UP, FORWARD, TAN_HALF_FOV, PIXELS_ACROSS, PIXELS_DOWN = 0, 3, 6, 9, 12, 13, 14
CAMERA_COLUMNS = 15


def parse_camera(text: str) -> Camera:
    """Return the camera that a text describes.

    Parameters
    ----------
    text : str
        "PX,PY,PZ,TX,TY,TZ,FOV": position and target, metres, world; vertical field of view, degrees.

    Returns
    -------
    Camera
        A camera at the position, directed at the target, with +Y up.

    Raises
    ------
    SettingsError
        If the text does not have this form, a number is not finite, the field of view is not between 0 and
        180 degrees, or `look_at` raises.
    """
    try:
        px, py, pz, tx, ty, tz, fov = (float(part) for part in text.split(","))
    except ValueError:
        message = "seven numbers are needed: position x,y,z, target x,y,z, vertical field of view in degrees"
        raise SettingsError(f"'{text[:60]}' is no camera; {message}", object="camera") from None
    if not all(math.isfinite(v) for v in (px, py, pz, tx, ty, tz)):
        raise SettingsError(f"'{text[:60]}' holds a number that is not finite", object="camera")
    if not 0 < fov < 180:
        raise SettingsError("the field of view must be above 0 and below 180 degrees", object="camera")
    return look_at((px, py, pz), (tx, ty, tz), fov)


def look_at(position: tuple[float, float, float], target: tuple[float, float, float], fov: float) -> Camera:
    """Return a camera at `position`, directed at `target`, with +Y up.

    position, target : metres, world; fov : vertical field of view, degrees

    Raises
    ------
    SettingsError
        If target and position are equal, or their distance is not finite.
    """
    length = math.dist(target, position)
    if not length > 0:
        raise SettingsError("position and target are the same point; move one", object="camera")
    if not math.isfinite(length):
        raise SettingsError("position and target are too far apart", object="camera")
    forward = np.subtract(target, position) / length
    # If the view is nearly along +Y or -Y, use -Z as the up direction of the picture.
    hint = np.array([0.0, 1.0, 0.0]) if abs(forward[1]) < 0.99999 else np.array([0.0, 0.0, -1.0])
    right = np.cross(forward, hint)
    right /= np.linalg.norm(right)
    up = np.cross(right, forward)
    x, y, z = (tuple(float(v) for v in axis) for axis in (right, up, forward))
    return Camera("camera", -1, position, x, y, z, math.radians(fov))  # type: ignore[arg-type]


def camera_columns(
    camera: Camera, position: Sequence[float] | NDArray[np.float64], width: int, height: int
) -> NDArray[np.float64]:
    """Return a camera in the layout that kernels take.

    Parameters
    ----------
    camera : Camera
        Axes and field of view; its position is not used.
    position : (3,) sequence of float
        Position of the camera, metres, relative to the geometry's origin.
    width : int
        Width of the picture, pixels.
    height : int
        Height of the picture, pixels.

    Returns
    -------
    (15,) float64
        Columns `EYE` to `PIXELS_DOWN`.
    """
    axes = [*camera.right, *camera.up, *camera.forward]
    return np.array([*position, *axes, math.tan(0.5 * camera.fov), width, height])


def camera_rays(
    camera: Camera, width: int, height: int, pixel: NDArray[np.int64], samples: int, seed: int, number: int
) -> NDArray[np.float64]:
    """Return unit directions of camera rays, evenly distributed over the square of each of n pixels.

    Parameters
    ----------
    camera : Camera
        Axes and field of view.
    width : int
        Width of the picture, pixels.
    height : int
        Height of the picture, pixels.
    pixel : (n,) int64
        Numbers of the pixels: row * width + column, row 0 on top.
    samples : int
        Number of directions through each pixel. They form a lattice in the pixel's square. The lattice is
        shifted at random for each pixel and pass.
    seed : int
        Seed of the shifts.
    number : int
        Number of the pass.

    Returns
    -------
    (n, samples, 3) float64
        Unit directions, world.
    """
    lens = camera_columns(camera, camera.position, width, height)
    direction = np.zeros((len(pixel), samples, 3))
    _fill(lens, width, height, pixel, _salt(seed, 2 * number), _salt(seed, 2 * number + 1), direction)
    return direction


@kernel
def _fill(lens, width, height, pixel, first, second, direction):  # type: ignore[no-untyped-def]
    """Write unit directions through n pixels to `direction` (n, samples, 3) float64.

    lens : (15,) float64, see `camera_columns`; pixel : (n,) int64, see `camera_rays`
    first, second : uint64, salts of the horizontal and of the vertical shift of the lattice
    """
    high = lens[TAN_HALF_FOV]
    for i in range(len(pixel)):
        row, column = pixel[i] // width, pixel[i] % width
        u, v = _uniform(pixel[i], first), _uniform(pixel[i], second)
        for k in range(direction.shape[1]):
            # Kronecker lattice of the plastic number (Roberts 2018): evenly distributed for any number of
            # samples.
            x = (k * 0.7548776662466927 + u) % 1.0
            y = (k * 0.5698402909980532 + v) % 1.0
            x = (2.0 * (column + x) / width - 1.0) * high * width / height
            y = (1.0 - 2.0 * (row + y) / height) * high
            square = 0.0
            for a in range(3):
                direction[i, k, a] = lens[FORWARD + a] + x * lens[RIGHT + a] + y * lens[UP + a]
                square += direction[i, k, a] * direction[i, k, a]
            scale = 1.0 / math.sqrt(square)
            for a in range(3):
                direction[i, k, a] *= scale


def _salt(seed: int, number: int) -> np.uint64:
    """Return a hash of (seed, number), which is an argument of `_uniform`."""
    word = (seed * 0x9E3779B1 + number * 0x85EBCA77 + 1) & 0xFFFFFFFF
    # Hash an array, because NumPy scalars warn of overflow.
    return np.uint64(int(hash_u32(np.array([word], np.uint32))[0]) << 17)


@inner
def _uniform(pixel, salt):  # type: ignore[no-untyped-def]
    """Return a random number, uniform in [0, 1), from a pixel's number and a salt."""
    return np.float64(mix64(np.uint64(pixel + 1) * np.uint64(0x9E3779B97F4A7C15) ^ salt) >> np.uint64(11)) * (
        1.0 / 9007199254740992.0
    )
