"""Lets kernels work where Numba can keep nothing: a read-only install and no cache folder to write to.

Numba then refuses to define a function that asks to be kept on disk. Ours are compiled in memory instead,
anew in every process.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any


def allow_no_cache(package_file: str) -> None:
    """Let kernels of this program be defined where they cannot be kept.

    Parameters
    ----------
    package_file : str
        `__file__` of the package whose kernels are about to be defined.

    Notes
    -----
    Where the package's own cache folder can be written, which is nearly always, this looks no further. Numba
    has no setting for it: its two kinds of compiled function are told to go on.
    """
    folder = Path(package_file).parent
    kept = folder / "__pycache__"
    if os.access(kept if kept.exists() else folder, os.W_OK):
        return
    from numba.core.ccallback import CFunc
    from numba.core.dispatcher import Dispatcher

    for kind, function in ((Dispatcher, "py_func"), (CFunc, "_pyfunc")):
        if kind.enable_caching.__module__ != __name__:
            _go_on(kind, function)


def _go_on(kind: Any, function: str) -> None:
    keep = kind.enable_caching

    def enable_caching(self: Any) -> None:
        try:
            keep(self)
        except RuntimeError as error:
            ours = getattr(self, function).__module__.startswith("baker.")
            if not ours or "no locator" not in str(error):
                raise

    kind.enable_caching = enable_caching
