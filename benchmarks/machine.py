"""Describes the machine of a measurement: date, processor, cores, memory and versions."""

from __future__ import annotations

import datetime
import os
import platform
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from baker.core.version import VERSION

PACKAGES = ("numpy", "scipy", "numba", "embreex", "xatlas", "pyoidn", "OpenEXR")


def describe() -> dict[str, str | float | int]:
    """Return {property: value} of the machine, and the versions of Python, baker and `PACKAGES`."""
    found: dict[str, str | float | int] = {
        "date": datetime.datetime.now(datetime.UTC).strftime("%Y-%m-%d"),
        "processor": _processor(),
        "cores": len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1,
        "memory_gb": _memory(),
        "system": f"{platform.system()} {platform.machine()}",
        "python": platform.python_version(),
        "baker": VERSION,
    }
    for name in PACKAGES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = "absent"
    return found


def load() -> float:
    """Return the load average of the last minute; 0 if the system does not report it."""
    return round(os.getloadavg()[0], 2) if hasattr(os, "getloadavg") else 0.0


def _processor() -> str:
    facts: dict[str, str] = {}
    path = Path("/proc/cpuinfo")
    if path.exists():
        for line in path.read_text(encoding="utf-8").splitlines():
            key, _, value = line.partition(":")
            facts.setdefault(key.strip(), value.strip())
    name = facts.get("model name") or platform.processor() or "unknown"
    if "model" in facts and "cpu family" in facts:
        # Add family and model, which identify the processor if a virtual machine reports only the vendor.
        name += f" (family {facts['cpu family']}, model {facts['model']})"
    if "avx512f" in facts.get("flags", ""):
        name += ", AVX-512"
    elif "avx2" in facts.get("flags", ""):
        name += ", AVX2"
    return name


def _memory() -> float:
    if hasattr(os, "sysconf") and "SC_PHYS_PAGES" in os.sysconf_names:
        return round(os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE") / 2**30, 1)
    return 0.0
