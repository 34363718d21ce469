"""The output folder of a bake that is given as a path or a result."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from baker.core.errors import InputError

if TYPE_CHECKING:
    from baker.core.lightmap import BakeResult


def folder_of(bake: str | Path | BakeResult) -> Path:
    """Return the output folder of a bake.

    Raises
    ------
    InputError
        If a bake is only in memory.
    """
    if isinstance(bake, str | Path):
        return Path(bake)
    if bake.out is None:
        raise InputError("the bake is only in memory; write it with baker.save first")
    return bake.out
