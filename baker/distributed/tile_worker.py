"""Computes tiles of a distributed bake in a worker.

The worker builds texels, ray tree and lookup tables from the same scene, atlas and settings as the process
that started the bake, so both have identical arrays. Apart from these inputs, only results of earlier stages
are sent to the worker.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from baker.core.atlas import Atlas
from baker.core.budget import patch_rays
from baker.core.parallel import Part
from baker.core.progress import silent
from baker.core.scene import Scene
from baker.core.settings import BakeSettings
from baker.core.stage import Stage
from baker.pipeline.prepare import PreparedScene, prepare_scene
from baker.pipeline.record import Record
from baker.pipeline.transport import (
    PartRunner,
    trace_ambient_occlusion,
    trace_direct_light,
    trace_final_gather,
)
from baker.radiosity.form_factors import cast_rows
from baker.radiosity.patches import build_patches
from baker.radiosity.sample_parts import SamplePart

Span = tuple[int, int]
Result = list[tuple[int, int, Part]]
# Results of earlier stages, arrays by name.
Arrays = Mapping[str, NDArray[Any]]
# Function that runs a prepared stage with the given runners of the parts of the entries.
StageWork = Callable[[PartRunner], object]


@dataclass
class TileWorker:
    """Computes tiles of one bake; the scene is prepared at the first call of `work`.

    Parameters
    ----------
    scene : Scene
        The baked scene.
    atlas : Atlas
        The lightmap uv of the scene.
    settings : BakeSettings
        The settings of the bake.
    """

    scene: Scene
    atlas: Atlas
    settings: BakeSettings
    _lock: threading.Lock = field(default_factory=threading.Lock)
    _prepared: PreparedScene | None = None
    _ready: tuple[Stage, StageWork] | None = None

    def work(self, stage: Stage, arrays: Arrays, spans: list[Span]) -> Result:
        """Return the results of the tiles `spans` of a stage.

        Parameters
        ----------
        stage : Stage
            A key of `STAGES`.
        arrays : mapping of str to array
            Results of earlier stages, the same for all tiles of a stage.
        spans : list of (begin, end)
            Tiles as ranges of items, end exclusive. They are tiles into which the stage divides its items.

        Returns
        -------
        list of (begin, end, part)
            One for each tile; `part` is the result of the tile.
        """
        run_stage = self._stage(stage, arrays)
        found: Result = []

        def run(n: int, tile: int, work: Callable[[int, int], Part], **rest: Any) -> None:
            found.extend((begin, end, work(begin, end)) for begin, end in spans)

        wanted = int(arrays.get("part", 0))
        run_stage(lambda part: run if part.number == wanted else _skip)
        return found

    def _stage(self, stage: Stage, arrays: Arrays) -> StageWork:
        """Return the function that runs a stage.

        Scene and stage are prepared by the first thread that needs them. Other threads wait for it.
        """
        with self._lock:
            if self._prepared is None:
                record = Record(silent)
                prepared = prepare_scene(self.scene, self.atlas, self.settings, record, arrays["outside"])
                # Remove the point cache, which is complete only if one process computes every tile.
                self._prepared = replace(prepared, job=replace(prepared.job, point_cache=None))
            if self._ready is None or self._ready[0] != stage:
                self._ready = stage, STAGES[stage](self._prepared, arrays)
            return self._ready[1]


def _skip(*arguments: Any, **rest: Any) -> None:
    """Compute no tile: the runner of parts that a task does not belong to."""


def _direct_light(prepared: PreparedScene, arrays: Arrays) -> StageWork:
    return lambda runs: trace_direct_light(prepared, runs)


def _form_factors(prepared: PreparedScene, arrays: Arrays) -> StageWork:
    patches = build_patches(prepared.texels, arrays["level"], link=prepared.sides.link)
    seen = prepared.sides.seen_patches(patches.patch)
    n_rays = patch_rays(prepared.settings)
    # Patches are not divided into parts.
    whole = SamplePart(0, 1.0, None, prepared.texels.n_front)
    return lambda runs: cast_rows(patches, seen, prepared.job.on(runs(whole)), n_rays=n_rays)


def _final_gather(prepared: PreparedScene, arrays: Arrays) -> StageWork:
    # Copy the array, because arrays of a task are read-only and `seen_light` writes to a column.
    seen = prepared.sides.seen_light(np.array(arrays["exitance"]))
    return lambda runs: trace_final_gather(prepared, seen, arrays["analytic"], runs)


def _ambient_occlusion(prepared: PreparedScene, arrays: Arrays) -> StageWork:
    return lambda runs: trace_ambient_occlusion(prepared, runs)


# Keys: stages with tiles. Values: functions that prepare the stage from the results of earlier stages.
STAGES: dict[Stage, Callable[[PreparedScene, Arrays], StageWork]] = {
    Stage.DIRECT_LIGHT: _direct_light,
    Stage.FORM_FACTORS: _form_factors,
    Stage.FINAL_GATHER: _final_gather,
    Stage.AMBIENT_OCCLUSION: _ambient_occlusion,
}
