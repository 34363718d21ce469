"""Connects to a dask.distributed cluster; no other file imports dask.distributed.

Data that several tasks read are sent to each worker once. If a worker is lost, other workers repeat its
tasks.
"""

from __future__ import annotations

import contextlib
import logging
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from numpy.typing import NDArray

from baker.core.errors import BakerError, ResourceError, SettingsError
from baker.core.stage import Stage
from baker.distributed.tile_worker import Result, Span, TileWorker
from baker.io.bake.manifest import library_versions

# Timeout for connecting to a scheduler, for the first worker, and for closing the connection, seconds.
_CONNECT = 10
# Time without any worker after which the work ends with an error, seconds.
_ALONE = 30.0
# Time between two checks for workers, seconds.
_POLL = 1.0


class Cluster:
    """A connection to the workers of a cluster.

    Parameters
    ----------
    address : str
        "tcp://HOST:8786" or "tls://HOST:8786" of a scheduler, or "local:N" for N new worker processes on this
        machine.
    threads : int
        Number of threads of the N workers of "local:N" together; each worker has at least one thread.

    Raises
    ------
    SettingsError
        If the address has none of these forms, or N is not from 1 to 1024.
    ResourceError
        If dask.distributed is not installed, no scheduler with a worker answers, or a worker has different
        library versions.
    """

    def __init__(self, address: str, *, threads: int = 1) -> None:
        kind, _, rest = address.partition(":")
        if kind not in ("tcp", "tls", "local") or (kind == "local" and not rest.isdigit()):
            message = f"the cluster '{address}' is no address; write tcp://HOST:8786, or local:N"
            raise SettingsError(message, object="cluster")
        try:
            import distributed
        except ImportError:
            message = "a cluster needs dask.distributed; install it with: pip install distributed"
            raise ResourceError(message) from None
        dask: Any = distributed  # its functions have no type annotations
        # Suppress the log, because `result` raises an error for each failure of a worker.
        logging.getLogger("distributed").setLevel(logging.CRITICAL)
        self._local: Any = None
        if kind == "local":
            n = int(rest)
            if not 1 <= n <= 1024:
                raise SettingsError(f"local:{n} is no number of workers from 1 to 1024", object="cluster")
            self._local = dask.LocalCluster(
                n_workers=n,
                threads_per_worker=max(threads // n, 1),
                processes=True,
                host="127.0.0.1",
                dashboard_address=None,
                worker_dashboard_address=None,
                silence_logs=logging.CRITICAL,
                memory_limit=0,
            )
        try:
            self._client: Any = dask.Client(self._local or address, timeout=_CONNECT, set_as_default=False)
            self._client.wait_for_workers(1, timeout=_CONNECT)
        except (OSError, TimeoutError):
            self.close()
            message = f"no scheduler with workers answers at {address}; start them, or check the address"
            raise ResourceError(message) from None
        try:
            self._check_versions()
        except BaseException:
            self.close()
            raise

    def workers(self) -> dict[str, int]:
        """Return the number of threads of each worker, by address of the worker."""
        found: dict[str, int] = dict(self._client.nthreads())
        return found

    def send(self, value: Any) -> Any:
        """Send a value to all workers; return the handle to pass to `submit` in place of the value."""
        return self._client.scatter([value], broadcast=True, hash=False)[0]

    def submit(self, work: Callable[..., Any], *arguments: Any) -> Any:
        """Start `work(*arguments)` in a worker that the scheduler chooses; return the task."""
        return self._client.submit(_checked, library_versions(), work, *arguments, pure=False)

    def finished(self, tasks: Sequence[Any]) -> list[Any]:
        """Return those of the tasks that have ended, successfully or not."""
        return [task for task in tasks if task.status != "pending"]

    def result(self, task: Any) -> Any:
        """Return the result of a finished task.

        Raises
        ------
        BakerError
            If the task raised a `BakerError`, or if workers died repeatedly while they ran it.
        KeyError
            If data of the task were lost together with a worker. The caller must send the data and submit the
            task again.
        Exception
            If the task raised another exception.
        """
        try:
            if task.status == "finished":
                return self._client.gather(task)
            error = task.exception() if task.status == "error" else None
        except Exception as lost:
            error = lost
        if isinstance(error, BakerError):
            raise error
        if error is None or type(error).__name__ in ("FutureCancelledError", "CancelledError"):
            raise KeyError(task.key)
        if type(error).__name__ == "KilledWorker":
            message = "workers of the cluster died of it again and again, most likely for want of memory"
            raise ResourceError(f"{message}; lower resolution, or use workers with more")
        raise error

    def alive(self) -> bool:
        """Return whether the cluster has a worker."""
        return bool(self._client.scheduler_info()["workers"])

    def close(self) -> None:
        """Disconnect, and stop the workers of "local:N"."""
        for part in (getattr(self, "_client", None), self._local):
            if part is not None:
                # The cluster kills a worker that does not respond.
                with contextlib.suppress(TimeoutError, OSError):
                    part.close(timeout=_CONNECT)

    def _check_versions(self) -> None:
        here = library_versions()
        for address, there in self._client.run(library_versions, on_error="return").items():
            if not isinstance(there, dict):
                message = f"the worker {address} has no baker that can be used ({type(there).__name__})"
                raise ResourceError(f"{message}; install baker {here['baker']} there")
            _compare(address, here, there)


def _compare(address: str, here: Mapping[str, Any], there: Mapping[str, Any]) -> None:
    for name in here:
        if there.get(name) != here[name]:
            message = f"the worker {address} has {name} {there.get(name)}, here it is {name} {here[name]}"
            raise ResourceError(f"{message}; install the same version on both, else results would differ")


def _checked(versions: dict[str, Any], work: Callable[..., Any], *arguments: Any) -> Any:
    """In a worker: compare the library versions, and then call `work`.

    `Cluster` compares the versions of its workers when it connects, but this worker may have joined later.
    """
    from distributed import get_worker

    _compare(get_worker().address, versions, library_versions())
    return work(*arguments)


class WorkerWatch:
    """Raises an error if checks have found no worker of a cluster for more than `_ALONE` seconds."""

    def __init__(self, cluster: Cluster) -> None:
        self.cluster = cluster
        self.seen = self.checked = time.monotonic()

    def check(self) -> None:
        """Check for workers, unless the last check was less than a second ago.

        Raises
        ------
        ResourceError
            If there is no worker, and there was none for more than half a minute.
        """
        now = time.monotonic()
        if now - self.checked < _POLL:
            return
        self.checked = now
        if self.cluster.alive():
            self.seen = now
        elif now - self.seen > _ALONE:
            raise ResourceError("the cluster has had no worker for half a minute; start workers, try again")


def held_bakes() -> dict[str, TileWorker]:
    """In a worker: return the `TileWorker` objects that the worker keeps, by hash of the bake."""
    from distributed import get_worker

    held: dict[str, TileWorker] = vars(get_worker()).setdefault("baker_bakes", {})
    return held


def worker_threads() -> int:
    """In a worker: return the number of its threads."""
    from distributed import get_worker

    return int(get_worker().state.nthreads)


def work_on_tiles(
    key: str,
    parts: tuple[Any, Any, Any],
    stage: Stage,
    arrays: Mapping[str, NDArray[Any]],
    spans: list[Span],
) -> Result:
    """In a worker: return the results of the tiles `spans` of a stage of the bake with the hash `key`.

    `parts` are scene, atlas and settings of the bake, and `arrays` the results of earlier stages.
    """
    held = held_bakes()
    if key not in held:
        scene, atlas, settings = parts
        # Keep one bake at a time: free the ray tree of the previous bake.
        held.clear()
        threads = {"threads": worker_threads()}
        held.setdefault(key, TileWorker(scene, atlas, settings.model_copy(update=threads)))
    return held[key].work(stage, arrays, spans)
