"""Estimates the peak memory of a bake; parses and formats sizes such as "8G"."""

from __future__ import annotations

import re
from pathlib import Path

from baker.core.errors import SettingsError
from baker.core.settings import BakeSettings
from baker.io.load import load_for_bake
from baker.pipeline.memory_check import estimate_peak_of

_UNITS = {"": 1, "K": 2**10, "M": 2**20, "G": 2**30, "T": 2**40}


def parse_size(text: str) -> int:
    """Return the number of bytes of a text such as "8G", "512M" or "1.5GiB"; units are powers of 1024.

    Raises
    ------
    SettingsError
        If the text is not a size, or the size is less than a byte.
    """
    match = re.fullmatch(r"\s*([0-9]*\.?[0-9]+)\s*([KMGT]?)(?:I?B)?\s*", text.upper())
    size = 0 if match is None else int(float(match.group(1)) * _UNITS[match.group(2)])
    if size <= 0:
        raise SettingsError(f"`memory` is no size like 8G or 512M (was '{text}')", object="memory")
    return size


def size_words(size: int) -> str:
    """Return a size in bytes as text with at most three significant digits, such as "1.5G"."""
    for unit in ("T", "G", "M", "K"):
        if size >= _UNITS[unit]:
            return f"{size / _UNITS[unit]:.3g}{unit}"
    return str(size)


def estimate_peak(path: Path, settings: BakeSettings) -> int:
    """Estimate the peak memory of a bake of this scene, bytes.

    Parameters
    ----------
    path : Path
        The scene file, which is read for the estimate.
    settings : BakeSettings

    Raises
    ------
    InputError
        If the scene cannot be read.
    """
    return estimate_peak_of(load_for_bake(path, settings), settings)
