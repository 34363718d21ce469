"""Records the state of an output path before a command writes to it, and cleans up after a kill."""

from __future__ import annotations

import json
import os
from pathlib import Path

from baker.io.bake.recovery import recover


def survey(out: str) -> bytes:
    """Record the state of an output path before a command writes to it.

    Parameters
    ----------
    out : str
        Output folder or file. It need not exist.

    Returns
    -------
    bytes
        One line for `restore`: the path, and its parent folders that do not exist yet.
    """
    target = Path(os.path.realpath(out))
    missing = [str(parent) for parent in target.parents if not parent.exists()]
    note = {"out": str(target), "missing": missing}
    return json.dumps(note).encode() + b"\n"


def restore(note: bytes) -> None:
    """Restore the old content of an output path, and remove temporary files and new folders that are empty.

    Parameters
    ----------
    note : bytes
        The line that `survey` returned.
    """
    before = json.loads(note)
    target = Path(before["out"])
    recover(target)
    for parent in map(Path, before["missing"]):
        try:
            parent.rmdir()
        except OSError:
            return  # the folder is not empty, or was never created
