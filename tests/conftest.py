"""Stands here so that every test can import the helpers of this folder (pytest puts it on the path).

It also lets the processes of `pytest -n 2` share the suite well:

- tests of a module that makes something expensive once go to the same process;
- a kernel that one process compiles is waited for by the other one, and taken from disk;
- a test that measures seconds (marked `timed`) runs while the other processes rest.
"""

from __future__ import annotations

import contextlib
import hashlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

# Fixtures of these scopes are made once in a process.
_ONCE = ("module", "package", "session")
_LOCKS = pytest.StashKey[Path]()


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Group the tests of each module that has fixtures which outlive a test."""
    sharing = {
        item.path
        for item in items
        for found in item._fixtureinfo.name2fixturedefs.values()
        # Fixtures of plugins belong to no file.
        if found[-1].scope in _ONCE and found[-1].baseid
    }
    for item in items:
        if item.path in sharing:
            name = item.path.relative_to(item.config.rootpath).as_posix()
            item.add_marker(pytest.mark.xdist_group(name))


def pytest_configure(config: pytest.Config) -> None:
    """Prepare a process of a distributed run; a run in one process needs nothing."""
    cache = getattr(config, "cache", None)
    if hasattr(config, "workerinput") and cache is not None:
        config.stash[_LOCKS] = cache.mkdir("locks")
        compile_once(config.stash[_LOCKS])


@contextlib.contextmanager
def held(path: Path, *, shared: bool = False) -> Iterator[None]:
    """Hold a file lock."""
    import fcntl

    with path.open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_SH if shared else fcntl.LOCK_EX)
        yield


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Any:
    """Run a timed test alone, and any other one beside those of other processes."""
    folder = item.config.stash.get(_LOCKS, None)
    if folder is None:
        return (yield)
    alone = item.get_closest_marker("timed") is not None
    with contextlib.ExitStack() as room:
        # A process that waits for exclusive use blocks new ones from starting.
        with held(folder / "door", shared=not alone):
            room.enter_context(held(folder / "room", shared=not alone))
        return (yield)


def compile_once(folder: Path) -> None:
    """Let Numba hold a file lock for each kernel that it compiles: who comes second finds it on disk.

    Without it both processes compiled most kernels, and two signatures of one kernel that are kept at the
    same time can get the same file name.
    """
    from numba.core.compiler_lock import global_compiler_lock
    from numba.core.dispatcher import Dispatcher

    compile_kernel = Dispatcher.compile

    def compile_or_wait(self: Any, signature: Any) -> Any:
        kept = self._cache.cache_path
        if kept is None:
            return compile_kernel(self, signature)
        name = hashlib.sha256(f"{kept} {self.__module__}.{self.__qualname__}".encode()).hexdigest()[:16]
        # Numba's own lock comes first, so that threads of one process never wait for each other in a circle.
        with global_compiler_lock, held(folder / f"kernel-{name}"):
            return compile_kernel(self, signature)

    Dispatcher.compile = compile_or_wait
