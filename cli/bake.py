"""`baker bake SCENE -o OUT`: bakes a scene."""

from __future__ import annotations

import gc
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from baker.cli.bake_plan import BakePlan
from baker.cli.command import Cluster, Run, command
from baker.core.settings import BAKE, BakeSettings
from baker.core.settings_model import FILES
from baker.io.formats import scene_file_help

if TYPE_CHECKING:
    from baker.core.executor import TileExecutor

Scene = Annotated[Path, typer.Argument(metavar="SCENE", help=scene_file_help())]
Out = Annotated[Path, typer.Option("--out", "-o", metavar="OUT", help="Folder to write.")]
Force = Annotated[
    bool,
    typer.Option(
        "--force",
        help="Replace OUT even if baker did not write it; bake even if memory may not suffice.",
        rich_help_panel=FILES,
    ),
]


def bake_command(
    ctx: typer.Context, scene: Scene, out: Out, force: Force = False, cluster: Cluster = None
) -> None:
    """Bake a scene, show progress, and report the files written."""
    from baker.cli.report import bake_json, write_summary

    run: Run = ctx.obj
    settings = run.of(BakeSettings)
    run.session.will_write(str(out))
    with run.progress() as progress:
        # Import these modules after progress is shown, because importing the kernels is slow.
        from baker.trace.numba_start import skip_blas

        skip_blas()
        from baker.checks.stage_seconds import stage_seconds
        from baker.io.bake.lock import held
        from baker.pipeline.bake import bake

        progress.follow(BakePlan(stage_seconds(settings, scene)))
        # Exclude the objects that exist now from garbage collection. Collections took 4 % of the time of a
        # first bake, which compiles kernels.
        gc.freeze()
        spread: dict[str, Any] = (
            {} if cluster is None else {"executor": _tile_executor(cluster, settings.threads)}
        )
        with held(out):
            result = bake(scene, out=out, settings=settings, progress=progress, force=force, **spread)
    if not run.quiet:
        write_summary(result, run.text, verbose=run.verbose, noted=progress.noted)
    if run.as_json:
        run.session.write_json(bake_json(result))


def _tile_executor(address: str, threads: int | None) -> TileExecutor:
    from baker.core.parallel import thread_count
    from baker.distributed.connection import Cluster as Connection
    from baker.distributed.tile_executor import DistributedTileExecutor

    return DistributedTileExecutor(Connection(address, threads=thread_count(threads)))


bake = command("bake", BakeSettings, common=BAKE)(bake_command)
