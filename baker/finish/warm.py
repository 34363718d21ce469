"""Compiles the finishing kernels in a second process while the first bake after an install traces rays.

Numba keeps compiled kernels on disk, so what this process compiles, the bake finds. It is run as
`python -m baker.finish.warm` and does nothing but finish a small page.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np

from baker.core.progress import Progress, report, silent

STAGE = "compile"
_SIZE = 48
_LOOK = 0.1


def start() -> subprocess.Popen[bytes] | None:
    """Start compiling in the background, if the kernels are not on disk yet."""
    from baker.kernels.page_guard import hold_to_samples

    folder = Path(hold_to_samples._cache.cache_path)  # type: ignore[attr-defined]
    if any(folder.glob("page_guard.hold_to_samples-*.nbi")):
        return None
    command = [sys.executable, "-m", "baker.finish.warm"]
    silence = subprocess.DEVNULL
    return subprocess.Popen(command, stdin=silence, stdout=silence, stderr=silence)


def finish(process: subprocess.Popen[bytes] | None, progress: Progress) -> None:
    """Wait for the background compilation; if it failed, the kernels are compiled where they are used."""
    while process is not None:
        try:
            process.wait(_LOOK)
        except subprocess.TimeoutExpired:
            report(progress, STAGE, 0.5, "first run only")
        else:
            process = None


def stop(process: subprocess.Popen[bytes] | None) -> None:
    """End the background compilation."""
    if process is not None and process.poll() is None:
        process.kill()
        process.wait()


def main() -> None:
    """Finish a page of two charts, one of them with a buried texel, in colour and in grey."""
    from baker.finish.finish import PagePlan, finish_page

    chart = np.full((_SIZE, _SIZE), -1, np.int32)
    chart[4:20, 4:40] = 0
    chart[24:40, 4:40] = 1
    valid = chart >= 0
    valid[30, 20] = False
    plan = PagePlan(chart, valid, np.full((_SIZE, _SIZE, 2), 0.1, np.float32))
    noise = np.random.Generator(np.random.PCG64(0))
    for components in (3, 1):
        value = noise.random((_SIZE, _SIZE, components), np.float32)
        error = np.full((_SIZE, _SIZE), 0.3, np.float32)
        finish_page(plan, [(value, error)], upper=1.0, denoise=True, dilation=4, threads=1, progress=silent)


if __name__ == "__main__":
    main()
