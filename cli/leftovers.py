"""Records the state of an output before a command writes it, and restores it if the command is killed."""

from __future__ import annotations

import json
from pathlib import Path

from baker.io.bake.recovery import recover


def survey(out: str) -> bytes:
    """Return the state of an output before a command writes it, for `restore`.

    Parameters
    ----------
    out : str
        Output folder or file, which need not exist.

    Returns
    -------
    bytes
        One line: the output, and its parents that do not exist yet.
    """
    target = Path(out).resolve()
    missing = [str(parent) for parent in target.parents if not parent.exists()]
    note = {"out": str(target), "missing": missing}
    return json.dumps(note).encode() + b"\n"


def restore(note: bytes) -> None:
    """Restore the output, and remove the files and folders that the command made.

    Parameters
    ----------
    note : bytes
        One line of `survey`.
    """
    before = json.loads(note)
    target = Path(before["out"])
    recover(target)
    for parent in map(Path, before["missing"]):
        try:
            parent.rmdir()
        except OSError:
            return  # it holds something, or was never created
