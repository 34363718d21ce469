"""Picks one of a file's own cameras."""

from __future__ import annotations

from collections.abc import Sequence

from baker.core.errors import SettingsError
from baker.core.scene import Camera

# Cameras told in an error before the rest is only counted.
_TOLD = 12


def named_camera(cameras: Sequence[Camera], text: str) -> Camera:
    """Return the camera of a name, or of a place in the file's order, from 0.

    Parameters
    ----------
    cameras : sequence of Camera
        As `baker inspect` lists them.
    text : str
        A name counts before a number.

    Raises
    ------
    SettingsError
        If there is none of that name or number, or several have the name; it lists what there is.
    """
    found = [camera for camera in cameras if camera.name == text]
    if len(found) == 1:
        return found[0]
    if not found and text.isdecimal() and int(text) < len(cameras):
        return cameras[int(text)]
    if not cameras:
        message = "the file has no camera of its own; give seven numbers, PX,PY,PZ,TX,TY,TZ,FOV"
        raise SettingsError(message, object="camera")
    told = ", ".join(f"{number} '{camera.name}'" for number, camera in enumerate(cameras[:_TOLD]))
    more = f" and {len(cameras) - _TOLD} more (see baker inspect)" if len(cameras) > _TOLD else ""
    what = (
        f"{len(found)} cameras are named '{text}'; say which by its number"
        if found
        else f"no camera '{text}'"
    )
    raise SettingsError(f"{what}; the file has {told}{more}", object="camera")
