"""Fixes and repairs scenes for `baker check`: `--fix`, `--repair`, `-o`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

from baker.core.errors import SettingsError
from baker.core.printable import printable

if TYPE_CHECKING:
    from baker.core.progress import Progress
    from baker.repairs.fix_file import FixResult
    from baker.repairs.mesh_plan import Change
    from baker.repairs.settings import RepairSettings


@dataclass(frozen=True)
class FixRequest:
    """The scene to fix and the file to write.

    Attributes
    ----------
    scene, out : Path
        The input file and the output file.
    settings : RepairSettings
    """

    scene: Path
    out: Path
    settings: RepairSettings


def fix_request(
    scenes: list[Path], settings: RepairSettings, *, fix: bool, out: Path | None, force: bool
) -> FixRequest | None:
    """Return the request of `--fix` or `--repair`, or None if neither flag is given.

    Raises
    ------
    SettingsError
        If the flags contradict each other, or `out` is missing or must not be written.
    """
    if not (fix or settings.repair):
        if out is not None:
            raise SettingsError("-o says where --fix writes; add --fix", object="out")
        return None
    name = "--repair" if settings.repair else "--fix"
    if out is None:
        raise SettingsError(f"{name} writes a new file; name it with -o FIXED.glb", object="out")
    if len(scenes) != 1:
        raise SettingsError(f"{name} takes one scene at a time; {len(scenes)} are named", object="scene")
    from baker.repairs.write import check_fixed

    check_fixed(out, scenes[0], force=force)
    return FixRequest(scenes[0], out, settings)


def fix_scene(request: FixRequest, progress: Progress) -> FixResult:
    """Fix a scene and write the result."""
    from baker.repairs.fix_file import fix_file
    from baker.repairs.write import write_fixed

    result = fix_file(request.scene, request.settings, progress)
    write_fixed(request.out, result.data, request.scene, allow_outside=request.settings.allow_outside)
    return result


def write_fixed_text(result: FixResult, request: FixRequest, stream: TextIO) -> None:
    """Write one line for each change and one line for each defect that was not fixed."""
    for fix in result.fixed:
        change = fix.change
        stream.write(
            f"{request.scene}: fixed: {change.change}: '{printable(fix.object)}' (node {fix.node})"
            f" {change.counted}: {change.before} -> {change.after}{_more(change)}\n"
        )
    for left in result.left_alone:
        name = printable(left.object)
        stream.write(f"{request.scene}: left alone: '{name}' (node {left.node}) {left.reason}\n")
    if not result.fixed:
        stream.write(f"{request.scene}: nothing to fix\n")


def fixed_json(result: FixResult, request: FixRequest) -> dict[str, Any]:
    """Return the keys that `--fix` adds to the output of `--json`."""
    return {**result.to_dict(), "out": str(request.out)}


def _more(change: Change) -> str:
    """Return the distance by which a repair moved the surface, and the attributes lost, as text."""
    moved = "" if change.distance is None else f"; the surface moved by up to {change.distance:.3g} m"
    return moved + (f"; {', '.join(change.lost)} could not be kept" if change.lost else "")
