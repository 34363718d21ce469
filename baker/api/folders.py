"""Finds the output folder of a bake that is passed as a path or as a result."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from baker.api.arguments import path_of
from baker.core.errors import InputError

if TYPE_CHECKING:
    from baker.core.lightmap import BakeResult


def folder_of(bake: str | Path | BakeResult, name: str = "bake") -> Path:
    """Return the output folder of a bake; `name` is the name of the argument, for messages.

    Raises
    ------
    InputError
        If the bake was not written to a folder.
    SettingsError
        If `bake` is neither a path nor a BakeResult.
    """
    from baker.core.lightmap import BakeResult

    if not isinstance(bake, BakeResult):
        return path_of(bake, name, "an output folder or a baker.BakeResult")
    if bake.out is None:
        raise InputError("the bake is only in memory; write it with baker.save first")
    return bake.out
