"""Makes pytest put this folder on the import path, and coordinates the processes of `pytest -n 2`.

Rules for the processes:

- tests of a module that has module-wide, package-wide or session-wide fixtures run in the same process;
- tests that compile the same functions run in the same process. Only kernels are stored on disk. The
  functions that are compiled into kernels are compiled by each process, and so are kernels of tests. Tests
  that parse the source run in the same process, too;
- if one process compiles a kernel, the other process waits and loads it from disk;
- tests that fork many times run first, while the processes are small, and then the largest groups;
- a test that measures seconds (marked `timed`) runs while the other processes are idle.
"""

from __future__ import annotations

import contextlib
import gc
import hashlib
import os
import re
import sys
from collections import Counter
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import pytest

# Scopes of fixtures that are made once in a process.
_ONCE = ("module", "package", "session")
_LOCKS = pytest.StashKey[Path]()
# Files of tests that fork about 700 times. A fork copies the page tables of the process: at the end of the
# suite it takes four times as long as at the start.
_FORKING = {"test_recovery.py"}
# {name of a group: pattern in the text of its files}
_SUBJECTS = {
    "path tracer": r"from (baker\.(pathtracer|rendering|verification)|reference_runs)",
    "source": r"(?m)^import ast$",
    "kernels": r"import (carray|njit)|from (inner|packet_driver) import",
}


@cache
def subject(path: Path) -> str | None:
    """Return the name of the group of files whose tests compile or parse the same code, or None."""
    text = path.read_text("utf-8")
    return next((name for name, pattern in _SUBJECTS.items() if re.search(pattern, text)), None)


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Put tests into groups, see the docstring of this module, and order the groups."""
    sharing = {
        item.path
        for item in items
        for found in item._fixtureinfo.name2fixturedefs.values()
        # Fixtures of plugins have an empty `baseid`.
        if found[-1].scope in _ONCE and found[-1].baseid
    }
    groups: dict[pytest.Item, str] = {}
    for item in items:
        name = subject(item.path)
        if name is None and item.path in sharing:
            name = item.path.relative_to(item.config.rootpath).as_posix()
        if name is not None:
            groups[item] = name
            item.add_marker(pytest.mark.xdist_group(name))
    size = Counter(groups.values())

    def rank(item: pytest.Item) -> tuple[int, int, str]:
        if item.path.name in _FORKING:
            return 0, 0, ""
        return (1, -size[groups[item]], groups[item]) if item in groups else (2, 0, "")

    items.sort(key=rank)


def pytest_configure(config: pytest.Config) -> None:
    """Set up the file locks in each process of a distributed run, and keep the order of the items.

    Tests start many processes of `baker`. Without stored bytecode, each of them compiles all modules.
    """
    sys.dont_write_bytecode = False
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
    config.option.loadscopereorder = False
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


@contextlib.contextmanager
def uncollected() -> Iterator[None]:
    """Suspend garbage collection. Compilation allocates millions of small objects, but few cycles."""
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            gc.enable()


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
            with uncollected():
                return compile_kernel(self, signature)
        name = hashlib.sha256(f"{kept} {self.__module__}.{self.__qualname__}".encode()).hexdigest()[:16]
        # Acquire Numba's lock first. In the other order, two threads of one process could deadlock.
        with global_compiler_lock, held(folder / f"kernel-{name}"), uncollected():
            return compile_kernel(self, signature)

    Dispatcher.compile = compile_or_wait
