"""Who works on the tiles of the ray stages of one bake: this process, or others."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol

from numpy.typing import NDArray

from baker.core.atlas import Atlas
from baker.core.parallel import TileRunner, run_tiles
from baker.core.scene import Scene
from baker.core.settings import BakeSettings


class Farm(Protocol):
    """Finds a runner for each stage. Whoever works gets the same bytes from the same tiles."""

    def open(self, scene: Scene, atlas: Atlas, settings: BakeSettings) -> None:
        """Take what all stages of a bake need, once."""

    def runner(self, stage: str, arrays: Mapping[str, NDArray[Any]]) -> TileRunner:
        """Return the runner of a stage; `arrays` is what earlier stages found and this one needs."""

    def close(self) -> None:
        """Forget the bake."""


class LocalFarm:
    """Works in this process."""

    def open(self, scene: Scene, atlas: Atlas, settings: BakeSettings) -> None:
        """Need nothing: the stages have it all."""

    def runner(self, stage: str, arrays: Mapping[str, NDArray[Any]]) -> TileRunner:
        """Return `run_tiles`."""
        return run_tiles

    def close(self) -> None:
        """Hold nothing."""
