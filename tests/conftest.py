"""Makes pytest put this folder on the import path, and coordinates the processes of `pytest -n 2`.

Rules for the processes:

- tests of a module that has module-wide, package-wide or session-wide fixtures run in the same process;
- if one process compiles a kernel, the other process waits and loads it from disk;
- a test that measures seconds (marked `timed`) runs while the other processes are idle.
"""

from __future__ import annotations

import contextlib
import hashlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

# Scopes of fixtures that are made once in a process.
_ONCE = ("module", "package", "session")
_LOCKS = pytest.StashKey[Path]()


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Put all tests of a module into one group if the module uses a fixture with a scope of `_ONCE`."""
    sharing = {
        item.path
        for item in items
        for found in item._fixtureinfo.name2fixturedefs.values()
        # Fixtures of plugins have an empty `baseid`.
        if found[-1].scope in _ONCE and found[-1].baseid
    }
    for item in items:
        if item.path in sharing:
            name = item.path.relative_to(item.config.rootpath).as_posix()
            item.add_marker(pytest.mark.xdist_group(name))


def pytest_configure(config: pytest.Config) -> None:
    """Set up the file locks in each process of a distributed run."""
    cache = getattr(config, "cache", None)
    if hasattr(config, "workerinput") and cache is not None:
        config.stash[_LOCKS] = cache.mkdir("locks")
        compile_once(config.stash[_LOCKS])


@contextlib.contextmanager
def held(path: Path, *, shared: bool = False) -> Iterator[None]:
    """Hold a file lock, exclusive or shared, within a `with` block."""
    import fcntl

    with path.open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_SH if shared else fcntl.LOCK_EX)
        yield


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Any:
    """Run a timed test alone, while no other process runs a test. Run all other tests in parallel."""
    folder = item.config.stash.get(_LOCKS, None)
    if folder is None:
        return (yield)
    alone = item.get_closest_marker("timed") is not None
    with contextlib.ExitStack() as room:
        # While a process waits for exclusive use, it holds the lock `door`, so no new test starts.
        with held(folder / "door", shared=not alone):
            room.enter_context(held(folder / "room", shared=not alone))
        return (yield)


def compile_once(folder: Path) -> None:
    """Make Numba hold a file lock while it compiles a kernel, so that other processes load the result.

    Without the lock both processes compiled most kernels, and two signatures of one kernel that were stored
    at the same time could get the same file name.
    """
    from numba.core.compiler_lock import global_compiler_lock
    from numba.core.dispatcher import Dispatcher

    compile_kernel = Dispatcher.compile

    def compile_or_wait(self: Any, signature: Any) -> Any:
        kept = self._cache.cache_path
        if kept is None:
            return compile_kernel(self, signature)
        name = hashlib.sha256(f"{kept} {self.__module__}.{self.__qualname__}".encode()).hexdigest()[:16]
        # Acquire Numba's lock first. In the other order, two threads of one process could deadlock.
        with global_compiler_lock, held(folder / f"kernel-{name}"):
            return compile_kernel(self, signature)

    Dispatcher.compile = compile_or_wait
