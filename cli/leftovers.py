"""Removes what a bake that was ended hard left beside, or in, its output folder.

The writer's temporary folders are `.{name}.baker-*` beside the folder `name`, or `.baker-*` in it where it
cannot be moved; one whose name ends in `-old` holds what the new bake was about to replace.
"""

from __future__ import annotations

import json
import shutil
from pathlib import Path

from baker.io.bake.lock import OutputLock


def survey(out: str) -> bytes:
    """Return what there is before a bake, for `remove_leftovers` to know what is new.

    Parameters
    ----------
    out : str
        Output folder, which need not exist.

    Returns
    -------
    bytes
        One line: the folder, temporary folders of other runs, parents that do not exist yet.
    """
    target = Path(out).resolve()
    missing = [str(parent) for parent in target.parents if not parent.exists()]
    note = {"out": str(target), "theirs": [str(path) for path in _temporaries(target)], "missing": missing}
    return json.dumps(note).encode() + b"\n"


def remove_leftovers(note: bytes) -> None:
    """Put the output folder back as it was, and remove what the bake made.

    Parameters
    ----------
    note : bytes
        One line of `survey`.
    """
    before = json.loads(note)
    target = Path(before["out"])
    ours = [path for path in _temporaries(target) if str(path) not in before["theirs"]]
    for path in ours:
        if path.name.endswith("-old"):
            _put_back(path, target)
    for path in ours:
        shutil.rmtree(path, ignore_errors=True)
    lock = OutputLock(target)
    if lock.path.exists() and lock.acquire():
        lock.release()
    for parent in map(Path, before["missing"]):
        try:
            parent.rmdir()
        except OSError:
            return  # it holds something, or was never made


def _temporaries(target: Path) -> list[Path]:
    found = []
    for folder, prefix in ((target.parent, f".{target.name}.baker-"), (target, ".baker-")):
        if folder.is_dir():
            found += [path for path in sorted(folder.iterdir()) if path.name.startswith(prefix)]
    return found


def _put_back(aside: Path, target: Path) -> None:
    if aside.parent != target:
        if not target.exists():
            aside.rename(target)
    elif not (target / "bake.json").exists():
        # The manifest is exchanged last: without it the new files are not all there.
        for path in sorted(path for path in aside.rglob("*") if path.is_file()):
            path.replace(target / path.relative_to(aside))
