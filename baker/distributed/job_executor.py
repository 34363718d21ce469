"""Runs whole bakes on a cluster: sends scenes to workers, receives pages, and writes output folders."""

from __future__ import annotations

import time
from dataclasses import replace
from typing import Any

from baker.core.lightmap import BakeResult
from baker.core.scene import Scene
from baker.core.settings import BakeSettings
from baker.core.stage import Stage
from baker.distributed.connection import Cluster, WorkerWatch, worker_threads
from baker.io.bake.write_bake import check_out, write_bake
from baker.io.load import load_for_bake
from baker.jobs.executor import Event
from baker.jobs.jobs_file import Job
from baker.jobs.worker import describe
from baker.pipeline.bake import bake


class DistributedJobExecutor:
    """Runs whole bakes on the workers of a cluster; implements `baker.jobs.executor.JobExecutor`.

    The number of slots is the number of workers when the object is made.

    Parameters
    ----------
    cluster : Cluster
        A connected cluster.
    """

    def __init__(self, cluster: Cluster) -> None:
        self.cluster = cluster
        self.slots = max(len(cluster.workers()), 1)
        self._watch = WorkerWatch(cluster)
        self._tasks: dict[Any, tuple[int, Job, Scene, bool]] = {}
        self._failed: list[Event] = []

    def start(self, ticket: int, job: Job, *, threads: int, force: bool) -> None:
        """Read the scene and send it to a worker. `threads` is ignored; workers use all their threads."""
        assert job.out is not None
        try:
            check_out(job.out, force=force, scene_path=job.scene)
            scene = load_for_bake(job.scene, job.settings)
            self._send(ticket, job, scene, force)
        except Exception as error:
            self._failed.append(Event(ticket, ended=True, error=describe(error)))

    def next_event(self, timeout: float) -> Event | None:
        """Wait at most `timeout` seconds for the end of a bake, and write its output folder.

        A bake whose data were lost together with a worker is submitted again, which is an event as well.
        """
        end = time.monotonic() + timeout
        while not self._failed:
            for task in self.cluster.finished(list(self._tasks)):
                return self._take(task)
            self._watch.check()
            if time.monotonic() >= end:
                return None
            time.sleep(0.02)
        return self._failed.pop(0)

    def close(self) -> None:
        """Disconnect from the cluster. The output folders of running bakes are not written."""
        self._tasks.clear()
        self.cluster.close()

    def _send(self, ticket: int, job: Job, scene: Scene, force: bool) -> None:
        # Do not send the source document and the path, which only `write_bake` needs.
        light = replace(scene, source=None, path=None)
        task = self.cluster.submit(bake_scene, light, job.settings)
        self._tasks[task] = (ticket, job, scene, force)

    def _take(self, task: Any) -> Event:
        ticket, job, scene, force = self._tasks.pop(task)
        assert job.out is not None
        try:
            result: BakeResult = self.cluster.result(task)
            whole = replace(result, scene=scene, settings=job.settings)
            write_bake(whole, job.out, force=force)
        except KeyError:
            self._send(ticket, job, scene, force)
            return Event(ticket, Stage.CLUSTER)
        except Exception as error:
            return Event(ticket, ended=True, error=describe(error))
        return Event(ticket, ended=True)


def bake_scene(scene: Scene, settings: BakeSettings) -> BakeResult:
    """In a worker: bake, and return the result without meshes, materials and instances of the scene."""
    result = bake(scene, settings=settings.model_copy(update={"threads": worker_threads()}))
    return replace(result, scene=replace(scene, meshes=(), materials=(), instances=()))
