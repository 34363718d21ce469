"""What a worker does for a bake that is spread over many: it holds the scene and works on tiles.

The worker builds texels, ray tree and tables from scene, atlas and settings as the one that asks does, so it
gives the same bytes; only what earlier stages found has to be sent.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from baker.core.atlas import Atlas
from baker.core.parallel import Part, TileRunner
from baker.core.progress import Progress, silent
from baker.core.scene import Scene
from baker.core.settings import BakeSettings

if TYPE_CHECKING:
    from baker.pipeline.world import World

Span = tuple[int, int]
Result = list[tuple[int, int, Part]]


@dataclass
class TileWorker:
    """Works on tiles of one bake.

    Parameters
    ----------
    scene, atlas, settings : what the bake is made of
    """

    scene: Scene
    atlas: Atlas
    settings: BakeSettings
    _lock: threading.Lock = field(default_factory=threading.Lock)
    _world: World | None = None
    _made: dict[str, Any] = field(default_factory=dict)

    def work(self, stage: str, arrays: Mapping[str, NDArray[Any]], spans: list[Span]) -> Result:
        """Return what the tiles of a stage give.

        Parameters
        ----------
        stage : str
            A name in `STAGES`.
        arrays : mapping of name to array
            What earlier stages found, the same for all tiles of a stage.
        spans : list of (begin, end)
            Tiles as the stage itself cuts them.
        """
        with self._lock:
            # Once for all tiles; other threads of this worker wait for it.
            if self._world is None:
                self._world = self._build(arrays["inside"])
            if stage not in self._made:
                self._made = {stage: PREPARE[stage](self._world, arrays)}
            world, made = self._world, self._made[stage]
        found: Result = []

        def run(n: int, tile: int, work: Callable[[int, int], Part], **rest: Any) -> None:
            found.extend((begin, end, work(begin, end)) for begin, end in spans)

        STAGES[stage](self.scene, world, made, self.settings, run)
        return found

    def _build(self, inside: NDArray[np.uint16]) -> World:
        from baker.pipeline.record import Record
        from baker.pipeline.world import prepare

        world = prepare(self.scene, self.atlas, self.settings, Record(silent), inside)
        # Points kept for later stages would be those of other tiles.
        return replace(world, kept=None)


def _no_more(world: World, arrays: Mapping[str, NDArray[Any]]) -> None:
    return None


def _make_patches(world: World, arrays: Mapping[str, NDArray[Any]]) -> Any:
    from baker.radiosity.patches import build_patches

    patches = build_patches(world.texels, arrays["depth"], link=world.sides.link)
    return patches, world.sides.seen_patches(patches.patch)


def _make_image(world: World, arrays: Mapping[str, NDArray[Any]]) -> Any:
    return world.sides.seen_light(np.array(arrays["exitance"])), arrays["exact"]


def _direct(scene: Scene, world: World, made: Any, settings: BakeSettings, run: TileRunner) -> None:
    from baker.pipeline.transport import light_directly

    light_directly(scene, world, settings, silent, run)


def _form_factors(scene: Scene, world: World, made: Any, settings: BakeSettings, run: TileRunner) -> None:
    from baker.pipeline.transport import patch_rays
    from baker.radiosity.form_factors import cast_rows

    patches, seen = made
    quiet: Progress = silent
    cast_rows(
        patches,
        seen,
        world.surface,
        world.mask,
        world.table,
        world.rays.tracer,
        n_rays=patch_rays(settings),
        seed=settings.seed,
        threads=1,
        progress=quiet,
        run=run,
    )


def _gather(scene: Scene, world: World, made: Any, settings: BakeSettings, run: TileRunner) -> None:
    from baker.pipeline.transport import gather_light

    gather_light(world, made, settings, silent, run)


def _open(scene: Scene, world: World, made: Any, settings: BakeSettings, run: TileRunner) -> None:
    from baker.pipeline.transport import open_sky

    open_sky(world, settings, silent, run)


# What a stage needs beyond the world, made once, and the stage itself, for some tiles.
PREPARE: dict[str, Callable[[World, Mapping[str, NDArray[Any]]], Any]] = {
    "direct light": _no_more,
    "form factors": _make_patches,
    "final gather": _make_image,
    "ambient occlusion": _no_more,
}
STAGES: dict[str, Callable[[Scene, World, Any, BakeSettings, TileRunner], None]] = {
    "direct light": _direct,
    "form factors": _form_factors,
    "final gather": _gather,
    "ambient occlusion": _open,
}
