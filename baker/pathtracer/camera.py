"""A pinhole camera: rays through its pixels, and its description on a command line."""

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

# Columns of a camera as kernels take it: position, right, up, forward, tangent of half the vertical field of
# view, pixels across and down.
EYE, RIGHT, UP, FORWARD, TAN_HALF_FOV, PIXELS_ACROSS, PIXELS_DOWN = 0, 3, 6, 9, 12, 13, 14
CAMERA_COLUMNS = 15


def parse_camera(text: str) -> Camera:
    """Return the camera of a description.

    Parameters
    ----------
    text : str
        "PX,PY,PZ,TX,TY,TZ,FOV": position, target, vertical field of view in degrees.

    Returns
    -------
    Camera
        With +Y up.

    Raises
    ------
    SettingsError
        If the text is not of this form, or position and target are equal.
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
    """Return a camera at `position` towards `target` with +Y up; fov in degrees.

    Raises
    ------
    SettingsError
        If target and position are equal, or their distance is too large.
    """
    length = math.dist(target, position)
    if not length > 0:
        raise SettingsError("position and target are the same point; move one", object="camera")
    if not math.isfinite(length):
        raise SettingsError("position and target are too far apart", object="camera")
    forward = np.subtract(target, position) / length
    # For a view along +Y or -Y, -Z is up in the picture.
    hint = np.array([0.0, 1.0, 0.0]) if abs(forward[1]) < 0.99999 else np.array([0.0, 0.0, -1.0])
    right = np.cross(forward, hint)
    right /= np.linalg.norm(right)
    up = np.cross(right, forward)
    x, y, z = (tuple(float(v) for v in axis) for axis in (right, up, forward))
    return Camera("camera", -1, position, x, y, z, math.radians(fov))  # type: ignore[arg-type]


def camera_columns(
    camera: Camera, position: Sequence[float] | NDArray[np.float64], width: int, height: int
) -> NDArray[np.float64]:
    """Return a camera as kernels take it.

    Parameters
    ----------
    camera : Camera
        Its position is not used.
    position : (3,) sequence of float
        Metres, relative to the geometry's origin.
    width : int
        Pixels.
    height : int
        Pixels.

    Returns
    -------
    (15,) float64
        See the column names.
    """
    axes = [*camera.right, *camera.up, *camera.forward]
    return np.array([*position, *axes, math.tan(0.5 * camera.fov), width, height])


def camera_rays(
    camera: Camera, width: int, height: int, pixel: NDArray[np.int64], samples: int, seed: int, number: int
) -> NDArray[np.float64]:
    """Return unit directions through pixels, evenly distributed over each pixel's square.

    Parameters
    ----------
    camera : Camera
        Its position is not used.
    width : int
        Pixels.
    height : int
        Pixels.
    pixel : (n,) int64
        row * width + column, row 0 on top.
    samples : int
        Directions of each pixel in this pass: a lattice, shifted at random for each pixel and pass.
    seed : int
        Of the shifts.
    number : int
        The pass.

    Returns
    -------
    (n, samples, 3) float64
        Unit, world.
    """
    lens = camera_columns(camera, camera.position, width, height)
    direction = np.zeros((len(pixel), samples, 3))
    _fill(lens, width, height, pixel, _salt(seed, 2 * number), _salt(seed, 2 * number + 1), direction)
    return direction


@kernel
def _fill(lens, width, height, pixel, first, second, direction):  # type: ignore[no-untyped-def]
    """Write unit directions to `direction` (n, samples, 3).

    lens : (15,) float64, see the column names
    pixel : (n,) int64; first, second : uint64, salts
    """
    high = lens[TAN_HALF_FOV]
    for i in range(len(pixel)):
        row, column = pixel[i] // width, pixel[i] % width
        u, v = _uniform(pixel[i], first), _uniform(pixel[i], second)
        for k in range(direction.shape[1]):
            # Kronecker lattice of the plastic number (Roberts 2018): even for any count.
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
    """Return a salt for the random numbers of a seed and pass."""
    word = (seed * 0x9E3779B1 + number * 0x85EBCA77 + 1) & 0xFFFFFFFF
    # An array: arithmetic on single numbers warns of overflow.
    return np.uint64(int(hash_u32(np.array([word], np.uint32))[0]) << 17)


@inner
def _uniform(pixel, salt):  # type: ignore[no-untyped-def]
    """Return a uniform number of a pixel."""
    return np.float64(mix64(np.uint64(pixel + 1) * np.uint64(0x9E3779B97F4A7C15) ^ salt) >> np.uint64(11)) * (
        1.0 / 9007199254740992.0
    )
