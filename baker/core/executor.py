"""Defines the interface of executors, which run the tiles of ray stages in this process or on a cluster."""

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
    """Provides a tile runner for each stage. All executors give the same bytes."""

    def open(self, scene: Scene, atlas: Atlas, settings: BakeSettings) -> None:
        """Receive the data that all stages of a bake share; called once before the first stage."""

    def runner(self, stage: Stage, arrays: Mapping[str, NDArray[Any]]) -> TileRunner:
        """Return the runner of a stage; `arrays` are the results of earlier stages that this stage reads."""

    def close(self) -> None:
        """Release the data of the bake."""


class LocalTileExecutor:
    """Runs tiles on the threads of this process."""

    def open(self, scene: Scene, atlas: Atlas, settings: BakeSettings) -> None:
        """Do nothing, because the stages have the data in this process."""

    def runner(self, stage: Stage, arrays: Mapping[str, NDArray[Any]]) -> TileRunner:
        """Return `run_tiles`."""
        return run_tiles

    def close(self) -> None:
        """Do nothing."""
