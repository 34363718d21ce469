"""Distributes the tiles of one bake over a cluster."""

from __future__ import annotations

import hashlib
import pickle
import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

from numpy.typing import NDArray

from baker.core.atlas import Atlas
from baker.core.parallel import Part, TileRunner
from baker.core.progress import Progress, report
from baker.core.scene import Scene
from baker.core.settings import BakeSettings
from baker.core.stage import Stage
from baker.distributed.connection import Cluster, WorkerWatch, work_on_tiles
from baker.distributed.tile_worker import Span

# Intended number of tasks per thread and stage. More tasks balance the threads better, but each task has an
# overhead.
_TASKS_PER_THREAD = 8
# Largest number of tiles in a task. It limits the work that is repeated if a worker is lost.
_MAX_TILES = 64
# Time between two searches for finished tasks, seconds.
_POLL = 0.02


class DistributedTileExecutor:
    """Runs tiles on the workers of a cluster; implements `baker.core.executor.TileExecutor`.

    Parameters
    ----------
    cluster : Cluster
        A connected cluster.
    """

    def __init__(self, cluster: Cluster) -> None:
        self.cluster = cluster
        self._parts: tuple[Scene, Atlas, BakeSettings] | None = None
        self._key = ""
        self._sent: Any = None

    def open(self, scene: Scene, atlas: Atlas, settings: BakeSettings) -> None:
        """Send scene, atlas and settings to all workers."""
        # Do not send the source document and the path, which only writing needs.
        self._parts = (replace(scene, source=None, path=None), atlas, settings)
        self._key = hashlib.sha256(pickle.dumps(self._parts, 5)).hexdigest()
        self._sent = self.cluster.send(self._parts)

    def runner(self, stage: Stage, arrays: Mapping[str, NDArray[Any]]) -> TileRunner:
        """Return a runner that sends the tiles of a stage to the cluster."""

        def run(
            n: int,
            tile: int,
            work: Callable[[int, int], Part],
            *,
            keep: Callable[[int, int, Part], object],
            threads: int,
            stage: Stage = stage,
            progress: Progress,
            rays_per_item: float = 0.0,
        ) -> None:
            report(progress, stage, 0.0)
            spans = [(begin, min(begin + tile, n)) for begin in range(0, n, tile)]
            _Stage(self.cluster, self._submitter(stage, dict(arrays))).run(
                spans, n, keep, stage, progress, rays_per_item
            )

        return run

    def close(self) -> None:
        """Release the scene in this process. Workers keep their prepared scene until the next bake."""
        self._parts = self._sent = None

    def _submitter(self, stage: Stage, arrays: dict[str, NDArray[Any]]) -> Callable[[list[Span], bool], Any]:
        sent = self.cluster.send(arrays)

        def submit(spans: list[Span], again: bool) -> Any:
            nonlocal sent
            if again:
                # Send the data again, because they were lost together with a worker.
                self._sent, sent = self.cluster.send(self._parts), self.cluster.send(arrays)
            return self.cluster.submit(work_on_tiles, self._key, self._sent, stage, sent, spans)

        return submit


class _Stage:
    """Submits the tasks of one stage and collects their results."""

    def __init__(self, cluster: Cluster, submit: Callable[[list[Span], bool], Any]) -> None:
        self.cluster = cluster
        self.submit = submit

    def run(
        self,
        spans: list[Span],
        n: int,
        keep: Callable[[int, int, Part], object],
        stage: Stage,
        progress: Progress,
        rays_per_item: float,
    ) -> None:
        slots = max(sum(self.cluster.workers().values()), 1)
        size = max(min(-(-len(spans) // (_TASKS_PER_THREAD * slots)), _MAX_TILES), 1)
        tasks = [(spans[k : k + size]) for k in range(0, len(spans), size)]
        pending = {self.submit(task, False): task for task in tasks}
        watch, start, done = WorkerWatch(self.cluster), time.perf_counter(), 0
        while pending:
            for task in self.cluster.finished(list(pending)):
                part_of = pending.pop(task)
                try:
                    result = self.cluster.result(task)
                except KeyError:
                    pending[self.submit(part_of, True)] = part_of
                    continue
                for begin, end, part in result:
                    keep(begin, end, part)
                    done += end - begin
            elapsed = max(time.perf_counter() - start, 1e-9)
            rate = f"{done * rays_per_item / elapsed / 1e6:.1f} Mrays/s" if rays_per_item else ""
            report(progress, stage, done / max(n, 1), rate)
            watch.check()
            time.sleep(_POLL)
