"""Finds the output paths among the arguments of a command, and refuses those that would replace an input."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

# Arguments that name a file or a folder to write. Every other path is an input.
OUTPUTS = frozenset({"export", "junit", "out", "report", "sarif"})
# Commands whose argument `out` is the folder of an existing bake, which they only read.
_READ = frozenset({"verify", "view"})


def output_names(command: str) -> frozenset[str]:
    """Return the names of the arguments of a command that it writes to."""
    return OUTPUTS - {"out"} if command in _READ else OUTPUTS


def check_paths(command: str, values: Mapping[str, Any], config: Path | None) -> None:
    """Raise `SettingsError` if an output of a command would replace an input or a file of a bake.

    Parameters
    ----------
    command : str
        Name of the command.
    values : mapping of str to object
        Arguments of the command by name.
    config : Path or None
        The configuration file, which is also an input.
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
    # Search the scenes only if an output exists, because a new output cannot replace an input.
    exists = any(os.path.lexists(path) for path in outputs.values())
    check_outputs(outputs, _scenes(command, inputs) if exists else [])


def _scenes(command: str, inputs: list[Path]) -> list[Path]:
    """Return the inputs, and the scene files that folders, patterns and job files among them refer to."""
    from baker.core.errors import BakerError

    found = list(inputs)
    # Ignore errors here, because the command reports unreadable inputs itself.
    with contextlib.suppress(BakerError, OSError, ValueError):
        if command == "check":
            from baker.checks.scenes import find_scenes

            found += find_scenes(inputs)
        elif command == "batch":
            from baker.jobs.jobs_file import read_jobs

            found += [job.scene for path in inputs for job in read_jobs(path, {})]
    return found
