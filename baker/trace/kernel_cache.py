"""Deletes outdated cached kernels, and allows kernels without a cache folder.

Numba compiles a cached kernel again only if the kernel's own file has changed. Functions compiled into it may
be in other files: after an update of those it would run outdated code, on arrays of another layout. So
importing a package with kernels deletes cache files that are older than any file they depend on.

Numba also refuses to define a function with `cache=True` where no cache folder can be written, as in a
read-only install. Then this file replaces a method of Numba's dispatcher classes for the process
(`allow_no_cache`), and the kernels of this program are compiled in memory, in every process.
"""

from __future__ import annotations

import contextlib
import glob
import importlib.util
import os
import time
from pathlib import Path
from typing import Any


def keep_kernels(package_file: str, *made_of: str) -> None:
    """Prepare a package whose kernels are about to be defined.

    Deletes outdated cache files of the package, and lets its kernels be defined where nothing can be cached.

    Parameters
    ----------
    package_file : str
        `__file__` of the package, or of the only file in it that has kernels.
    *made_of : str
        Dotted names of the other packages that its kernels take functions from.
    """
    folder = Path(package_file).parent
    drop_stale(folder, [folder, *map(_folder_of, made_of)])
    allow_no_cache(folder)


def _folder_of(package: str) -> Path:
    """Return the folder of a package without running its code."""
    found = importlib.util.find_spec(package)
    if found is None or not found.submodule_search_locations:
        raise ImportError(f"{package} is no package")
    return Path(next(iter(found.submodule_search_locations)))


def drop_stale(folder: Path, made_of: list[Path]) -> None:
    """Delete cache files of a package that are older than a file that its kernels may depend on.

    Parameters
    ----------
    folder : Path
        The package.
    made_of : list of Path
        Packages with those files.
    """
    newest = max((file.stat().st_mtime for part in made_of for file in part.glob("*.py")), default=0.0)
    if newest > time.time():
        # A source is from the future (wrong clock): every cached kernel would be deleted in each run.
        return
    for index in folder.glob("__pycache__/*.nbi"):
        # Another process may have deleted it, or the folder is read-only.
        with contextlib.suppress(OSError):
            if index.stat().st_mtime < newest:
                index.unlink()


def is_stored(kernel: Any) -> bool | None:
    """Return whether machine code of a kernel is on disk.

    Parameters
    ----------
    kernel : numba dispatcher
        A function that `trace.jit.kernel` made.

    Returns
    -------
    bool or None
        None if this install has no folder in which compiled kernels can be stored.

    Notes
    -----
    Numba names the files after the module, the function, its first line and the Python version, and has no
    public name for them; they are read from the function's own cache, so a renamed kernel has renamed files.
    An index without machine code is not enough: `drop_stale` removes only indices.
    """
    folder = kernel._cache.cache_path
    if folder is None:
        return None
    base = glob.escape(kernel._cache._impl.filename_base)
    return all(any(Path(folder).glob(base + end)) for end in (".nbi", ".*.nbc"))


def allow_no_cache(folder: Path) -> None:
    """Let kernels of this program be defined where they cannot be cached.

    Parameters
    ----------
    folder : Path
        Package whose kernels are about to be defined.

    Notes
    -----
    Does nothing where the package's own cache folder can be written, which is nearly always. Else, since
    Numba has no setting for it, `enable_caching` of its two classes of compiled functions is replaced for
    this process. The replacement suppresses Numba's error for functions of `baker` only.
    """
    kept = folder / "__pycache__"
    if os.access(kept if kept.exists() else folder, os.W_OK):
        return
    from numba.core.ccallback import CFunc
    from numba.core.dispatcher import Dispatcher

    for kind, function in ((Dispatcher, "py_func"), (CFunc, "_pyfunc")):
        if kind.enable_caching.__module__ != __name__:
            _suppress_error(kind, function)


def _suppress_error(kind: Any, function: str) -> None:
    """Replace `enable_caching` of a class of Numba by one without its error for functions of `baker`."""
    keep = kind.enable_caching

    def enable_caching(self: Any) -> None:
        try:
            keep(self)
        except RuntimeError as error:
            ours = getattr(self, function).__module__.startswith("baker.")
            if not ours or "no locator" not in str(error):
                raise

    kind.enable_caching = enable_caching
