"""Deletes outdated cached kernels, and allows kernels without a cache folder.

Numba compiles a cached kernel again only if the file of the kernel has changed. The functions compiled into
the kernel may be in other files. If only these files change, Numba runs outdated code. Therefore, importing a
package with kernels deletes the index files of the cache that are older than any source file on which the
kernels may depend.

If no cache folder is writable, for example in a read-only install, Numba raises an error for functions with
`cache=True`. In that case, `allow_no_cache` replaces a method of Numba's classes of compiled functions, and
every process compiles the kernels in memory.
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
    """Call `drop_stale` and `allow_no_cache` for a package, before its kernels are defined.

    Parameters
    ----------
    package_file : str
        `__file__` of the package, or of the only module in it that has kernels.
    *made_of : str
        Dotted names of the other packages whose functions are compiled into its kernels.
    """
    folder = Path(package_file).parent
    drop_stale(folder, [folder, *map(_folder_of, made_of)])
    allow_no_cache(folder)


def _folder_of(package: str) -> Path:
    """Return the folder of a package without importing it."""
    found = importlib.util.find_spec(package)
    if found is None or not found.submodule_search_locations:
        raise ImportError(f"{package} is no package")
    return Path(next(iter(found.submodule_search_locations)))


def drop_stale(folder: Path, made_of: list[Path]) -> None:
    """Delete cache indices of a package that are older than a source file on which its kernels may depend.

    Parameters
    ----------
    folder : Path
        Folder of the package.
    made_of : list of Path
        Folders of all packages whose functions are compiled into its kernels, including `folder`.
    """
    newest = max((file.stat().st_mtime for part in made_of for file in part.glob("*.py")), default=0.0)
    if newest > time.time():
        # A source file has a time in the future, because a clock was wrong. Every cached kernel is older than
        # this file and would be deleted in each run.
        return
    for index in folder.glob("__pycache__/*.nbi"):
        # Ignore the error if another process has deleted the file, or if the folder is read-only.
        with contextlib.suppress(OSError):
            if index.stat().st_mtime < newest:
                index.unlink()


def is_stored(kernel: Any) -> bool | None:
    """Return whether the cache of a kernel on disk has both an index and machine code.

    Parameters
    ----------
    kernel : numba dispatcher
        A function decorated with `trace.jit.kernel`.

    Returns
    -------
    bool or None
        None if this install has no writable cache folder.

    Notes
    -----
    Numba has no public function for the names of the cache files, so they are read from private attributes of
    the kernel. `drop_stale` deletes an index (.nbi) and leaves the machine code (.nbc), so both are required.
    """
    folder = kernel._cache.cache_path
    if folder is None:
        return None
    base = glob.escape(kernel._cache._impl.filename_base)
    return all(any(Path(folder).glob(base + end)) for end in (".nbi", ".*.nbc"))


def allow_no_cache(folder: Path) -> None:
    """Allow the definition of kernels that cannot be cached on disk.

    Parameters
    ----------
    folder : Path
        Folder of a package whose kernels are about to be defined.

    Notes
    -----
    If the cache folder of the package is writable, this function does nothing. Otherwise, it replaces
    `enable_caching` of Numba's two classes of compiled functions in this process, because Numba has no
    setting for this case. The replacement suppresses Numba's error for functions of `baker` only.
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
    """Replace `enable_caching` of a Numba class `kind` by a method that ignores its error in `baker`.

    function : name of the attribute of `kind` that is the Python function
    """
    keep = kind.enable_caching

    def enable_caching(self: Any) -> None:
        try:
            keep(self)
        except RuntimeError as error:
            ours = getattr(self, function).__module__.startswith("baker.")
            if not ours or "no locator" not in str(error):
                raise

    kind.enable_caching = enable_caching
