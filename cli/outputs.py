"""Which arguments of commands are files to write, and the check that they replace no input."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

# Options that name a file or a folder to write. Every other path is an input.
OUTPUTS = frozenset({"junit", "out", "report", "sarif"})
# Commands take the folder of a bake as the argument `out`, too: it is an input there.
_READ = frozenset({"verify", "view"})


def output_names(command: str) -> frozenset[str]:
    """Return the names of the arguments of a command that it writes to."""
    return OUTPUTS - {"out"} if command in _READ else OUTPUTS


def check_paths(command: str, values: Mapping[str, Any], config: Path | None) -> None:
    """Raise `SettingsError` if an output of a command would replace an input or a file of a bake.

    Parameters
    ----------
    command : str
        Its name.
    values : mapping of str to object
        Arguments of the command by name.
    config : Path or None
        File of settings.
    """
    names = output_names(command)
    outputs = {name: path for name, path in values.items() if name in names and isinstance(path, Path)}
    if not outputs:
        return
    from baker.io.protected_files import check_outputs

    inputs = [] if config is None else [config]
    for name, value in values.items():
        paths = value if isinstance(value, list | tuple) else [value]
        inputs += [path for path in paths if name not in outputs and isinstance(path, Path)]
    # An output that does not exist replaces nothing, and most do not.
    exists = any(os.path.lexists(path) for path in outputs.values())
    check_outputs(outputs, _scenes(command, inputs) if exists else [])


def _scenes(command: str, inputs: list[Path]) -> list[Path]:
    """Return the inputs, and the scenes that folders, patterns and lists of jobs stand for."""
    from baker.core.errors import BakerError

    found = list(inputs)
    # The command itself reports what cannot be read.
    with contextlib.suppress(BakerError, OSError, ValueError):
        if command == "check":
            from baker.checks.scenes import find_scenes

            found += find_scenes(inputs)
        elif command == "batch":
            from baker.jobs.jobs_file import read_jobs

            found += [job.scene for path in inputs for job in read_jobs(path, {})]
    return found
