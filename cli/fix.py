"""The part of `baker check` that mends: `--fix`, `--repair`, `-o`."""

from __future__ import annotations

import inspect
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

import typer

from baker.cli.options import flag
from baker.core.errors import SettingsError

if TYPE_CHECKING:
    from baker.core.progress import Progress
    from baker.core.settings import BakeSettings
    from baker.repairs.file import Mended
    from baker.repairs.plan import Change


@dataclass(frozen=True)
class MendRequest:
    """What the flags ask for.

    Attributes
    ----------
    scene, out : Path
    repair : bool
        Also mend what changes the shape a little.
    force : bool
        Replace `out` if it exists.
    """

    scene: Path
    out: Path
    repair: bool
    force: bool


def mend_flags() -> list[inspect.Parameter]:
    """Return the flags that mend."""
    return [
        flag(
            "fix",
            bool,
            typer.Option("--fix", help="Mend what can be without changing the look, and check the result."),
            False,
        ),
        flag(
            "repair",
            bool,
            typer.Option(
                "--repair", help="--fix, and mend the shape of meshes (needs pip install pymeshlab)."
            ),
            False,
        ),
        flag(
            "out",
            Path | None,
            typer.Option("--out", "-o", metavar="FIXED.glb", help="Where --fix and --repair write."),
        ),
        flag("force", bool, typer.Option("--force", help="Let -o replace a file that exists."), False),
    ]


def asked(
    scenes: list[Path], *, fix: bool, repair: bool, out: Path | None, force: bool
) -> MendRequest | None:
    """Return what is to be mended, or None for a check alone.

    Raises
    ------
    SettingsError
        If the flags do not go together or `out` cannot be written.
    """
    if not (fix or repair):
        if out is not None:
            raise SettingsError("-o says where --fix writes; add --fix", object="out")
        return None
    name = "--repair" if repair else "--fix"
    if out is None:
        raise SettingsError(f"{name} writes a new file; name it with -o FIXED.glb", object="out")
    if len(scenes) != 1:
        raise SettingsError(f"{name} takes one scene at a time; {len(scenes)} are named", object="scene")
    from baker.repairs.write import check_fixed

    check_fixed(out, scenes[0], force=force)
    return MendRequest(scenes[0], out, repair, force)


def mend(request: MendRequest, settings: BakeSettings, progress: Progress) -> Mended:
    """Mend a scene and write the result."""
    from baker.repairs.file import MendSettings, mend_file
    from baker.repairs.write import write_fixed

    wanted = MendSettings(
        resolution=settings.resolution,
        up=settings.up,
        scale=settings.scale,
        threads=settings.threads,
        repair=request.repair,
    )
    mended = mend_file(request.scene, wanted, progress)
    write_fixed(request.out, mended.data)
    return mended


def write_mended_text(mended: Mended, request: MendRequest, stream: TextIO) -> None:
    """Write what was mended and what was left alone, a line each."""
    for fix in mended.fixed:
        change = fix.change
        stream.write(
            f"{request.scene}: mended: {change.change}: '{fix.object}' (node {fix.node})"
            f" {change.counted}: {change.before} -> {change.after}{_more(change)}\n"
        )
    for left in mended.left_alone:
        stream.write(f"{request.scene}: left alone: '{left.object}' (node {left.node}) {left.reason}\n")
    if not mended.fixed:
        stream.write(f"{request.scene}: nothing to mend\n")


def mended_json(mended: Mended, request: MendRequest) -> dict[str, Any]:
    """Return the keys that mending adds to `--json`."""
    return {**mended.json(), "out": str(request.out)}


def _more(change: Change) -> str:
    """Return what a repair did to the surface and to attributes, in words."""
    moved = "" if change.distance is None else f"; the surface moved by up to {change.distance:.3g} m"
    return moved + (f"; {', '.join(change.lost)} could not be kept" if change.lost else "")
