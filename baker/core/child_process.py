"""Runs a module of this package in a child process."""

from __future__ import annotations

import os
import subprocess
import sys


def start_module(module: str) -> subprocess.Popen[bytes]:
    """Start `python -m module ID` with pipes at its standard input and output; ID is the id of this process.

    Parameters
    ----------
    module : str
        Dotted name of the module. The child process searches modules in the folders of `sys.path`.

    Returns
    -------
    subprocess.Popen of bytes
        The running process; its standard error is discarded.
    """
    path = os.pathsep.join(entry for entry in sys.path if entry)
    return subprocess.Popen(
        [sys.executable, "-m", module, str(os.getpid())],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        env={**os.environ, "PYTHONPATH": path},
    )
