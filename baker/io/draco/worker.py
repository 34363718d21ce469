"""The child process that decodes Draco meshes.

The process receives messages (`baker.core.messages`) on stdin and answers on stdout. It limits its own memory
and processor time, so that a broken mesh ends this process only.
"""

from __future__ import annotations

import signal
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from baker.core.messages import read_message, write_message
from baker.core.parent_death import end_with_parent

# Types of attributes in Draco files. DracoPy returns integers in wider types, with equal values.
_TYPES = {1: np.int8, 2: np.uint8, 3: np.int16, 4: np.uint16, 6: np.uint32, 9: np.float32}


def main() -> None:
    """Decode meshes until stdin ends."""
    # Ignore Ctrl-C, which signals the whole process group. This process ends with its parent.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    end_with_parent(int(sys.argv[1]))
    while (message := read_message(sys.stdin.buffer)) is not None:
        _limit(int(message["memory"]), int(message["seconds"]))
        write_message(sys.stdout.buffer, **_decode(message["data"].tobytes()))


def _decode(data: bytes) -> dict[str, NDArray[Any]]:
    """Return the faces as "faces", and attributes as "attribute_ID"; nothing if the data is no mesh."""
    import DracoPy

    try:
        mesh = DracoPy.decode(data)
    except (DracoPy.FileTypeException, ValueError, RuntimeError, MemoryError, OverflowError):
        return {}
    if not isinstance(mesh, DracoPy.DracoMesh):
        return {}
    found: dict[str, NDArray[Any]] = {"faces": np.asarray(mesh.faces, np.uint32)}
    for attribute in mesh.attributes:
        value = np.asarray(attribute["data"])
        kind = _TYPES.get(int(attribute["data_type"]), value.dtype)
        found[f"attribute_{int(attribute['unique_id'])}"] = value.astype(kind, copy=False)
    return found


def _limit(memory: int, seconds: int) -> None:
    """Limit further memory, bytes, and further processor time, seconds; only on Linux.

    On other systems, only the time limit of the parent process applies.
    """
    if sys.platform == "linux":
        import resource

        pages = int(Path("/proc/self/statm").read_text("ascii").split()[0])
        _, hard = resource.getrlimit(resource.RLIMIT_AS)
        resource.setrlimit(resource.RLIMIT_AS, (pages * resource.getpagesize() + memory, hard))
        _, hard = resource.getrlimit(resource.RLIMIT_CPU)
        resource.setrlimit(resource.RLIMIT_CPU, (int(time.process_time()) + 1 + seconds, hard))


if __name__ == "__main__":
    main()
