"""Selects one of the cameras of a scene file."""

from __future__ import annotations

from collections.abc import Sequence

from baker.core.errors import SettingsError
from baker.core.scene import Camera

# Largest number of cameras that an error message lists.
_LISTED = 12


def named_camera(cameras: Sequence[Camera], text: str) -> Camera:
    """Return the camera with a name or an index.

    Parameters
    ----------
    cameras : sequence of Camera
        Cameras of the file, in its order.
    text : str
        A name, or an index from 0. If both exist, the camera with this name is returned.

    Returns
    -------
    Camera
        One of `cameras`.

    Raises
    ------
    SettingsError
        If no camera has that name or index, or if several cameras have the name. The message lists the first
        cameras.
    """
    found = [camera for camera in cameras if camera.name == text]
    if len(found) == 1:
        return found[0]
    if not found and text.isdecimal() and int(text) < len(cameras):
        return cameras[int(text)]
    if not cameras:
        message = "the file has no camera of its own; give seven numbers, PX,PY,PZ,TX,TY,TZ,FOV"
        raise SettingsError(message, object="camera")
    listed = ", ".join(f"{number} (named '{camera.name}')" for number, camera in enumerate(cameras[:_LISTED]))
    more = f" and {len(cameras) - _LISTED} more (see baker inspect)" if len(cameras) > _LISTED else ""
    what = (
        f"{len(found)} cameras are named '{text}'; say which by its number"
        if found
        else f"no camera '{text}'"
    )
    raise SettingsError(f"{what}; those of the file are {listed}{more}", object="camera")
