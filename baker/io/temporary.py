"""Creates and finds the temporary folders that output is written to before it is moved to its final path.

The folder for an output `out` is `.{out.name}.baker-{process}-{random hex digits}` beside it, or, if `out` is
a folder that cannot be moved, `.baker-{process}-{random hex digits}` inside it. The old files that the output
replaces are kept in a folder of the same name with the suffix `-old` until the new files are in place.
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
    """A temporary folder that exists.

    Attributes
    ----------
    path : Path
    process : int
        Id of the process that created it.
    old : bool
        Whether it contains the old files that the output replaces.
    """

    path: Path
    process: int
    old: bool


def temporary_path(out: Path, *, inside: bool = False) -> Path:
    """Return an unused path for a temporary folder beside `out` (absolute) or, if `inside`, in `out`."""
    suffix = f".baker-{os.getpid()}-{secrets.token_hex(4)}"
    return out / suffix if inside else out.with_name(f".{out.name}{suffix}")


def old_path(temporary: Path) -> Path:
    """Return the folder for the old files that the files in `temporary` replace."""
    return temporary.with_name(temporary.name + "-old")


def temporaries(out: Path) -> list[Temporary]:
    """List the temporary folders that any process has left for an output.

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
    """Yield a temporary path to write to; at the end of the `with` block, that file replaces `path`.

    Parameters
    ----------
    path : Path
        The file to replace; its parents are created. It is unchanged if the block ends with an exception.
    what : str
        Kind of file, for the error message: "picture".

    Yields
    ------
    Path
        A path with the same name in a temporary folder beside `path`. If `path` is a device or a pipe, it is
        yielded itself.

    Raises
    ------
    ResourceError
        If the file cannot be written.
    """
    try:
        target = path.resolve()
        if target.exists() and not target.is_file():
            # Write directly to a device or a pipe instead of replacing it by a file.
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
        # Name the final path in the message, because the temporary file that the error names is removed.
        raise ResourceError(error.message, file=str(path)) from error


def write_atomically(path: Path, data: bytes, what: str) -> None:
    """Write a file atomically: after an error, the old file is unchanged; see `atomic_path`.

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
