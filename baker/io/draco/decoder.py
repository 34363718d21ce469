"""Decodes Draco meshes in a child process, so that a broken mesh cannot crash this process."""

from __future__ import annotations

import importlib.util
import subprocess
import threading
from types import TracebackType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from baker.core.child_process import start_module
from baker.core.messages import read_message, write_message

# Limit of the decoder's memory, bytes: `_MEMORY`, and `_COPIES` for each byte of the decoded mesh, because
# the decoder copies the mesh several times. The size of the mesh counts up to `_RATIO` times the size of the
# compressed data.
_MEMORY, _COPIES, _RATIO = 1 << 30, 8, 1000
# Limit of processor time, seconds: a fixed part, and a part for each byte of compressed data (0.5 MB/s).
_SECONDS, _SECONDS_PER_BYTE = 8, 2e-6
# Limit of wall-clock time, divided by the limit of processor time. Other programs may use the processor as
# well.
_WALL = 10.0


class DracoError(Exception):
    """A mesh cannot be decoded; the message is the reason."""


class DracoMesh(NamedTuple):
    """A decoded mesh.

    Attributes
    ----------
    faces : (T, 3) uint32
    attributes : dict of int to (V, C) array
        By unique id, with the types of the file.
    """

    faces: NDArray[np.uint32]
    attributes: dict[int, NDArray[Any]]


class DracoDecoder:
    """Decodes meshes one after the other; a context manager that ends the child process."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None

    def __enter__(self) -> DracoDecoder:
        """Return the decoder; the child process starts with the first mesh."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End the child process."""
        self._stop()

    def decode(self, data: bytes, size: int) -> DracoMesh:
        """Decode a mesh.

        Parameters
        ----------
        data : bytes
            The compressed mesh.
        size : int
            Size of the decoded mesh that the file states, bytes. It may be wrong.

        Returns
        -------
        DracoMesh
            The mesh; faces refer to rows of all attributes.

        Raises
        ------
        DracoError
            If the data is no valid mesh, or takes too much time or memory.
        """
        if importlib.util.find_spec("DracoPy") is None:
            raise DracoError("decoding it needs the package DracoPy: run `pip install DracoPy`")
        memory = _MEMORY + _COPIES * min(size, _RATIO * len(data))
        seconds = _SECONDS + int(_SECONDS_PER_BYTE * len(data))
        answer = self._ask(data, memory, seconds)
        if answer is None:
            self._stop()
            raise DracoError(
                f"the decoder ended; the data is broken, or takes more than {seconds} s or "
                f"{memory / 2**30:.1f} GiB"
            )
        return _checked(answer)

    def _ask(self, data: bytes, memory: int, seconds: int) -> dict[str, NDArray[Any]] | None:
        """Return the answer of the child process, or None if it has ended."""
        if self._process is None:
            self._process = start_module("baker.io.draco.worker")
        process = self._process
        assert process.stdin is not None
        assert process.stdout is not None
        timer = threading.Timer(_WALL * seconds, process.kill)
        timer.start()
        try:
            write_message(
                process.stdin,
                data=np.frombuffer(data, np.uint8),
                memory=np.array(memory),
                seconds=np.array(seconds),
            )
            return read_message(process.stdout)
        except (OSError, ValueError):
            return None
        finally:
            timer.cancel()

    def _stop(self) -> None:
        if self._process is not None:
            self._process.kill()
            self._process.communicate()
            self._process = None


def _checked(answer: dict[str, NDArray[Any]]) -> DracoMesh:
    """Return the mesh of an answer; raise if rows and faces do not fit."""
    if "faces" not in answer:
        raise DracoError("the data is no Draco mesh")
    faces = answer.pop("faces").reshape(-1, 3)
    attributes = {int(name.partition("_")[2]): value for name, value in answer.items()}
    rows = {len(value) for value in attributes.values()}
    if len(rows) != 1 or any(value.ndim != 2 for value in attributes.values()):
        raise DracoError("its attributes have different numbers of vertices")
    if len(faces) and int(faces.max()) >= rows.pop():
        raise DracoError("a face of the compressed data has a vertex that does not exist")
    return DracoMesh(faces, attributes)
