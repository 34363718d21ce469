"""Runs `baker bake` as its own process and measures it from outside: seconds, processor time, memory."""

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

# Seconds between two measurements of the memory of all processes of a bake.
_LOOK = 0.05


@dataclass(frozen=True)
class Run:
    """Is what one bake took.

    Attributes
    ----------
    seconds : float
        The whole process, from its start to its end.
    cpu : float
        Processor seconds of it and all its helpers: what another load on the machine changes least.
    peak : float
        MiB resident, helpers included: the largest sum seen, at least the largest single process.
    timings, rays, solve, pages : from `bake.json`
    """

    seconds: float
    cpu: float
    peak: float
    timings: dict[str, float]
    rays: dict[str, int]
    solve: dict[str, Any]
    pages: list[dict[str, Any]]

    def plain(self) -> dict[str, Any]:
        """Return the run as plain data."""
        return asdict(self)


def bake(scene: Path, out: Path, *, flags: list[str], cache: Path) -> Run:
    """Bake `scene` to `out` in a process of its own.

    Parameters
    ----------
    flags : list of str
        Further flags of `baker bake`.
    cache : Path
        Folder for Numba's compiled kernels; an empty one makes this a first run.

    Raises
    ------
    RuntimeError
        If the bake fails; its own words are in the message.
    """
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(cache)}
    # A setting that keeps Python from storing bytecode would add its compilation to every start.
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
        # Linux counts the memory of the process that started a program as that program's, so its own
        # high-water mark is read instead where there is one.
        peak=memory.peak or usage.ru_maxrss / (2**20 if sys.platform == "darwin" else 1024),
        timings=manifest["timings"],
        rays=manifest["rays"],
        solve=manifest["solve"],
        pages=manifest["pages"],
    )


class _Memory(threading.Thread):
    """Looks again and again at the resident memory of a process and all below it (Linux only)."""

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
                    # Shared pages (libraries, memory from before a fork) count once, in the first process.
                    total += _mib(fact["RssAnon"]) + (0.0 if total else _mib(fact["RssFile"]))
                    # What was larger between two looks, in one process.
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
    """Return MiB of a line of /proc/PID/status, like " 1024 kB"."""
    return int(text.split()[0]) / 1024
