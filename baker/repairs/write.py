"""Writes a fixed scene completely or not at all; replaces an existing file only with `force`."""

from __future__ import annotations

import os
from pathlib import Path

from baker.core.errors import ResourceError, SettingsError
from baker.io.temporary import write_atomically


def check_fixed(out: Path, scene: Path, *, force: bool = False) -> None:
    """Check, before the work, that a fixed scene may be written to `out`.

    Parameters
    ----------
    out : Path
        The GLB to write.
    scene : Path
        The input, which is never written over.
    force : bool
        Also replace a file that exists.

    Raises
    ------
    SettingsError
        If `out` is no GLB name, a folder, the input itself, or exists and `force` is not set.
    ResourceError
        If nothing can be written there.
    """
    if out.suffix.lower() != ".glb":
        raise SettingsError("a fixed scene is a GLB; name a file that ends in .glb", file=str(out))
    if out.is_dir():
        raise SettingsError("this is a folder; name a .glb file", file=str(out))
    if out.exists():
        if scene.exists() and out.samefile(scene):
            raise SettingsError(
                "this is the input, which is never written over; name another file", file=str(out)
            )
        if not force:
            raise SettingsError("the file exists; name another one, or add `force=True`", file=str(out))
    parent = next(p for p in out.resolve().parents if p.exists())
    if not parent.is_dir() or not os.access(parent, os.W_OK | os.X_OK):
        raise ResourceError("nothing can be written there; name another place", file=str(out))


def write_fixed(out: Path, data: bytes) -> None:
    """Write a fixed scene in one step.

    Parameters
    ----------
    out : Path
        The file.
    data : bytes
        The GLB.

    Raises
    ------
    ResourceError
        If it cannot be written; a file that was there is unchanged.
    """
    write_atomically(out, data, "fixed scene")
