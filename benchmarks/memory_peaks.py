"""Prints a table of the peak memory of bakes, estimated by `baker/core/budget.py` and measured.

    python benchmarks/memory_peaks.py

Each bake runs in a separate process, whose largest resident memory Linux reports. All bakes together take
some minutes. `tests/unit/core/test_budget.py` compares estimate and measurement for small bakes.
"""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

from baker.core.budget import MIB
from baker.core.settings import make_settings
from baker.jobs.memory import estimate_peak

ROOT = Path(__file__).parents[1]
CASES: list[tuple[str, dict[str, Any]]] = [
    ("cornell", {"resolution": 512, "samples": 16}),
    ("cornell", {"resolution": 512, "samples": 256, "bounces": 1}),
    ("interior", {"resolution": 512, "samples": 16}),
    ("hall", {"resolution": 512, "samples": 16}),
    ("cornell", {"resolution": 256, "samples": 8, "density": 100}),
    ("cornell", {"resolution": 1024, "samples": 16}),
    ("cornell", {"resolution": 1024, "samples": 16, "channels": "ao", "denoise": False}),
    ("hall", {"resolution": 1024, "samples": 8}),
    ("hall", {"resolution": 2048, "samples": 16}),
]
BAKE = """
import json, sys
from baker.core.settings import make_settings
from baker.pipeline.bake import bake

bake(sys.argv[1], settings=make_settings(json.loads(sys.argv[2])))
print(open("/proc/self/status").read())
"""


def measured_peak(scene: Path, values: dict[str, Any]) -> int:
    """Bake a scene in a new process and return its largest resident memory, bytes."""
    command = [sys.executable, "-c", BAKE, str(scene), json.dumps(values)]
    status = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    found = re.search(r"VmHWM:\s*(\d+) kB", status)
    assert found is not None, "this system does not report VmHWM"
    return 1024 * int(found[1])


def main() -> None:
    """Print the table."""
    print("| scene | settings | measured, MiB | estimate, MiB | ratio |")
    print("|---|---|---|---|---|")
    for name, values in CASES:
        scene = ROOT / "assets" / f"{name}.glb"
        peak, estimate = measured_peak(scene, values), estimate_peak(scene, make_settings(values))
        words = " ".join(f"{key}={value}" for key, value in values.items())
        figures = f"{peak / MIB:.0f} | {estimate / MIB:.0f} | {estimate / peak:.2f}"
        print(f"| {name} | {words} | {figures} |", flush=True)


if __name__ == "__main__":
    main()
