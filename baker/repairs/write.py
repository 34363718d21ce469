"""Writes a fixed scene to a file, either completely or not at all."""

from __future__ import annotations

import os
from pathlib import Path

from baker.core.errors import ResourceError, SettingsError
from baker.io.output_path import resolved_output
from baker.io.protected_files import check_outputs
from baker.io.temporary import write_atomically
from baker.repairs.read_back import check_readable


def check_fixed(out: Path, scene: Path, *, force: bool = False) -> None:
    """Check that a fixed scene can be written to `out`, before the scene is fixed.

    Parameters
    ----------
    out : Path
        The GLB file to write.
    scene : Path
        The input file, which is never overwritten.
    force : bool
        Whether an existing file may be replaced.

    Raises
    ------
    SettingsError
        If the name does not end in .glb, or `out` is a folder. If `out` exists, and `force` is False or
        `check_outputs` refuses it. If `resolved_output` refuses `out`.
    ResourceError
        If the nearest existing parent is not a writable folder.
    """
    if out.suffix.lower() != ".glb":
        raise SettingsError("a fixed scene is a GLB; name a file that ends in .glb", file=str(out))
    if out.is_dir():
        raise SettingsError("this is a folder; name a .glb file", file=str(out))
    if out.exists():
        check_outputs({"out": out}, [scene])
        if not force:
            raise SettingsError("the file exists; name another one, or add `force=True`", file=str(out))
    parent = next(p for p in resolved_output(out).parents if p.exists())
    if not parent.is_dir() or not os.access(parent, os.W_OK | os.X_OK):
        raise ResourceError("nothing can be written there; name another place", file=str(out))


def write_fixed(out: Path, data: bytes, scene: Path, *, allow_outside: bool = False) -> None:
    """Write a fixed scene atomically, after it was read back.

    Parameters
    ----------
    out : Path
        The file to write.
    data : bytes
        The content, a GLB.
    scene : Path
        The scene file that was fixed.
    allow_outside : bool
        Whether the scene may refer to files outside its folder.

    Raises
    ------
    InputError
        If the fixed scene cannot be baked because of a defect of `scene` that is not fixed.
    ResourceError
        If the fixed scene cannot be read back for another reason, or the file cannot be written. In every
        case an existing file is unchanged.
    """
    check_readable(out, data, scene, allow_outside=allow_outside)
    write_atomically(out, data, "fixed scene")
