"""Runs `baker bake` in a separate process and measures its duration, processor time and memory."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import threading
from dataclasses import asdict, dataclass
from pathlib import Path
from time import perf_counter
from typing import Any

# Interval at which the memory of all processes of a bake is measured, seconds.
_LOOK = 0.05


@dataclass(frozen=True)
class Run:
    """The measurements of one bake.

    Attributes
    ----------
    seconds : float
        Duration of the whole process, from its start to its end.
    cpu : float
        Processor time of the process and all its child processes, seconds. Other load on the machine affects
        it less than `seconds`.
    peak : float
        Largest resident memory, MiB: the maximum over time of the sum over all processes of the bake, or the
        peak of a single process if that is larger.
    timings, rays, solve, pages : entries of `bake.json`
    """

    seconds: float
    cpu: float
    peak: float
    timings: dict[str, float]
    rays: dict[str, int]
    solve: dict[str, Any]
    pages: list[dict[str, Any]]

    def plain(self) -> dict[str, Any]:
        """Return the measurements as a JSON-serialisable dict."""
        return asdict(self)


def bake(scene: Path, out: Path, *, flags: list[str], cache: Path) -> Run:
    """Bake `scene` to `out` in a separate process.

    Parameters
    ----------
    scene : Path
        Scene file.
    out : Path
        Output folder.
    flags : list of str
        Further flags of `baker bake`.
    cache : Path
        Folder for Numba's compiled kernels. With an empty folder, the bake compiles all kernels.

    Raises
    ------
    RuntimeError
        If the bake fails; the message contains its standard error.
    """
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(cache)}
    # Let Python store bytecode. Otherwise every process would compile all modules.
    environment.pop("PYTHONDONTWRITEBYTECODE", None)
    command = [sys.executable, "-m", "baker.cli", "bake", str(scene), "-o", str(out), "--force", "-q", *flags]
    start = perf_counter()
    with subprocess.Popen(command, env=environment, stderr=subprocess.PIPE) as child:
        memory = _Memory(child.pid)
        memory.start()
        words = child.stderr.read() if child.stderr else b""
        _, status, usage = os.wait4(child.pid, 0)
        seconds = perf_counter() - start
        child.returncode = os.waitstatus_to_exitcode(status)
        memory.stop()
    if child.returncode:
        raise RuntimeError(f"{' '.join(command)} failed: {words.decode(errors='replace').strip()}")
    manifest = json.loads((out / "bake.json").read_text(encoding="utf-8"))
    return Run(
        seconds=seconds,
        cpu=usage.ru_utime + usage.ru_stime,
        # Prefer the measured peak: on Linux, `ru_maxrss` includes the memory of this process at the fork.
        peak=memory.peak or usage.ru_maxrss / (2**20 if sys.platform == "darwin" else 1024),
        timings=manifest["timings"],
        rays=manifest["rays"],
        solve=manifest["solve"],
        pages=manifest["pages"],
    )


class _Memory(threading.Thread):
    """Measures the resident memory of a process and all its descendants at intervals (Linux only)."""

    def __init__(self, pid: int) -> None:
        super().__init__(daemon=True)
        self.peak = 0.0
        self._pid = pid
        self._over = threading.Event()

    def run(self) -> None:
        while Path("/proc/self/statm").exists() and not self._over.wait(_LOOK):
            total, waiting = 0.0, [self._pid]
            while waiting:
                folder = Path(f"/proc/{waiting.pop()}")
                try:
                    status = (folder / "status").read_text(encoding="utf-8")
                    fact = dict(line.split(":", 1) for line in status.splitlines())
                    # Add file-backed pages (libraries) of the first process only, since processes share them.
                    total += _mib(fact["RssAnon"]) + (0.0 if total else _mib(fact["RssFile"]))
                    # Include the high-water mark of each process, for peaks between two measurements.
                    self.peak = max(self.peak, _mib(fact["VmHWM"]))
                    for thread in (folder / "task").iterdir():
                        waiting += [int(word) for word in (thread / "children").read_text().split()]
                except (OSError, KeyError):
                    continue
            self.peak = max(self.peak, total)

    def stop(self) -> None:
        self._over.set()
        self.join()


def _mib(text: str) -> float:
    """Convert a value of /proc/PID/status, such as " 1024 kB", to MiB."""
    return int(text.split()[0]) / 1024
