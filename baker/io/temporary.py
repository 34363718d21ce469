"""Temporary folders that output is written to before it is moved to its final path, and their names.

The folder for an output `out` is `.{out.name}.baker-{process}-{random hex digits}` beside it, or
`.baker-{process}-{random hex digits}` in it where `out` is a folder that cannot be moved. What the output
replaces is kept in a folder of the same name with the suffix `-old` until the new files are in place.
"""

from __future__ import annotations

import contextlib
import os
import re
import secrets
import shutil
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from baker.core.errors import ResourceError

_NAME = re.compile(r"\.baker-(\d+)-[0-9a-f]+(-old)?")


@dataclass(frozen=True)
class Temporary:
    """A temporary folder that was found.

    Attributes
    ----------
    path : Path
    process : int
        Id of the process that created it.
    old : bool
        Whether it holds the files that are being replaced.
    """

    path: Path
    process: int
    old: bool


def temporary_path(out: Path, *, inside: bool = False) -> Path:
    """Return the name of a new temporary folder for `out`, an absolute path; `inside` of it or beside it."""
    suffix = f".baker-{os.getpid()}-{secrets.token_hex(4)}"
    return out / suffix if inside else out.with_name(f".{out.name}{suffix}")


def old_path(temporary: Path) -> Path:
    """Return the folder of the files that those in `temporary` replace."""
    return temporary.with_name(temporary.name + "-old")


def temporaries(out: Path) -> list[Temporary]:
    """List the temporary folders for an output, of any process.

    Parameters
    ----------
    out : Path
        The output folder or file.

    Returns
    -------
    list of Temporary
        Sorted by name; empty if the parent folder cannot be listed.
    """
    target = out.resolve()
    found = []
    for home, prefix in ((target.parent, f".{target.name}"), (target, "")):
        with contextlib.suppress(OSError):
            for path in sorted(home.iterdir()):
                match = (
                    _NAME.fullmatch(path.name.removeprefix(prefix)) if path.name.startswith(prefix) else None
                )
                if match:
                    found.append(Temporary(path, int(match.group(1)), match.group(2) is not None))
    return found


@contextlib.contextmanager
def atomic_path(path: Path, what: str) -> Iterator[Path]:
    """Yield the path of a file to write, which replaces `path` at the end of the `with` block.

    Parameters
    ----------
    path : Path
        The file to replace; its parents are created. It is unchanged if the block ends with an exception.
    what : str
        Kind of file, for the error message: "picture".

    Yields
    ------
    Path
        A path with the same suffix, in a temporary folder beside `path`; `path` itself if that is a device.

    Raises
    ------
    ResourceError
        If it cannot be written.
    """
    try:
        target = path.resolve()
        if target.exists() and not target.is_file():
            # Write to a device or a pipe instead of replacing it.
            yield target
            return
        folder = temporary_path(target)
        target.parent.mkdir(parents=True, exist_ok=True)
        folder.mkdir()
        try:
            yield folder / path.name
            (folder / path.name).replace(target)
        finally:
            shutil.rmtree(folder, ignore_errors=True)
    except OSError as error:
        raise ResourceError(f"the {what} cannot be written ({error.strerror})", file=str(path)) from None
    except ResourceError as error:
        # Name the final path: the temporary file of the error is removed.
        raise ResourceError(error.message, file=str(path)) from error


def write_atomically(path: Path, data: bytes, what: str) -> None:
    """Write a file atomically: it is either complete or unchanged; see `atomic_path`.

    Parameters
    ----------
    path : Path
        The file; its parents are created.
    data : bytes
        Its content.
    what : str
        Kind of file, for the error message: "picture".
    """
    with atomic_path(path, what) as temporary:
        temporary.write_bytes(data)
