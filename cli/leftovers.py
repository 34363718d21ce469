"""Removes what a bake that was ended hard left beside its output folder."""

from __future__ import annotations

import shutil
from pathlib import Path


def remove_leftovers(out: str, process: int) -> None:
    """Remove the temporary siblings of `out` that the process `process` made.

    Parameters
    ----------
    out : str
        Output folder, absolute.
    process : int
        Id of the process that wrote; another process's folders are left alone.

    Notes
    -----
    The writer names them `.{name}.baker-{process}-...`. A folder ending in `-old` is the previous bake,
    moved aside for the instant of the swap: it goes back if the new one has not taken its place.
    """
    target = Path(out)
    prefix = f".{target.name}.baker-{process}"
    try:
        siblings = sorted(path for path in target.parent.iterdir() if path.name.startswith(prefix))
    except OSError:
        return
    for path in siblings:
        if path.name.endswith("-old") and not target.exists():
            path.rename(target)
        elif path.is_dir():
            shutil.rmtree(path, ignore_errors=True)
        else:
            path.unlink(missing_ok=True)
