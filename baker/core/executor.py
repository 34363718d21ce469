"""Defines the interface of executors, which run the tiles of ray stages in this process or on a cluster.

A tile is a range of texels or patches that one call of a stage's function computes.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol

from numpy.typing import NDArray

from baker.core.atlas import Atlas
from baker.core.parallel import TileRunner, run_tiles
from baker.core.scene import Scene
from baker.core.settings import BakeSettings
from baker.core.stage import Stage


class TileExecutor(Protocol):
    """Provides a tile runner for each ray stage. A bake gives the same bytes with every executor."""

    def open(self, scene: Scene, atlas: Atlas, settings: BakeSettings) -> None:
        """Receive the data that all ray stages of a bake share; called once before the first of them."""

    def runner(self, stage: Stage, arrays: Mapping[str, NDArray[Any]]) -> TileRunner:
        """Return the runner of a stage; `arrays` are the results of earlier stages that this stage reads."""

    def close(self) -> None:
        """Release the data of the bake."""


class LocalTileExecutor:
    """Runs tiles on the threads of this process."""

    def open(self, scene: Scene, atlas: Atlas, settings: BakeSettings) -> None:
        """Do nothing, because the data are already in this process."""

    def runner(self, stage: Stage, arrays: Mapping[str, NDArray[Any]]) -> TileRunner:
        """Return `run_tiles`."""
        return run_tiles

    def close(self) -> None:
        """Do nothing."""
