"""`baker bake SCENE -o OUT`: the main job."""

from __future__ import annotations

import gc
import inspect
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from baker.cli.commands import COMMANDS
from baker.cli.options import build, cluster_flag, common_flags, flag, given, setting_flags

if TYPE_CHECKING:
    from baker.cli.session import Session
    from baker.distributed.tile_executor import DistributedTileExecutor


def command() -> Any:
    """Return the subcommand."""
    return build("bake", COMMANDS["bake"], work, [*job_flags(), *setting_flags(), *common_flags()])


def job_flags() -> list[inspect.Parameter]:
    """Return the arguments of a bake that are no settings."""
    return [
        inspect.Parameter("ctx", inspect.Parameter.KEYWORD_ONLY, annotation=typer.Context),
        inspect.Parameter(
            "scene",
            inspect.Parameter.KEYWORD_ONLY,
            annotation=Annotated[
                Path, typer.Argument(metavar="SCENE", help="glb, gltf, obj, ply, stl or off file.")
            ],
        ),
        inspect.Parameter(
            "out",
            inspect.Parameter.KEYWORD_ONLY,
            annotation=Annotated[Path, typer.Option("--out", "-o", metavar="OUT", help="Folder to write.")],
        ),
        flag("config", Path | None, typer.Option("--config", metavar="FILE", help="TOML file of settings.")),
        flag(
            "force", bool, typer.Option("--force", help="Replace OUT even if baker did not write it."), False
        ),
        cluster_flag(),
    ]


def work(
    *,
    ctx: typer.Context,
    scene: Path,
    out: Path,
    config: Path | None,
    force: bool,
    cluster: str | None,
    as_json: bool,
    quiet: bool,
    verbose: int,
    **settings: Any,
) -> None:
    """Bake, show progress, and tell what was made."""
    from baker.cli.config import resolve
    from baker.cli.report import bake_json, write_summary

    session: Session = ctx.obj
    as_json = as_json or session.as_json
    resolved = resolve(given(settings), config)
    session.will_write(str(out))
    with session.reporter(quiet=quiet) as progress:
        # Inside: importing the kernels takes a moment, and the bar is there meanwhile.
        progress("start", 0.0)
        from baker.trace.numba_start import skip_blas

        skip_blas()
        from baker.io.bake.lock import held
        from baker.pipeline.bake import bake

        # What is loaded by now stays: looking for cycles in it takes 4 % of a first bake, which compiles.
        gc.freeze()
        spread = {} if cluster is None else {"executor": _executor(cluster, resolved.threads)}
        with held(out):
            result = bake(scene, out=out, settings=resolved, progress=progress, force=force, **spread)
    if not quiet:
        write_summary(result, session.text_stream(as_json=as_json), verbose=verbose)
    if as_json:
        session.write_json(bake_json(result))


def _executor(address: str, threads: int | None) -> DistributedTileExecutor:
    from baker.core.parallel import thread_count
    from baker.distributed.connection import Cluster
    from baker.distributed.tile_executor import DistributedTileExecutor

    return DistributedTileExecutor(Cluster(address, threads=thread_count(threads)))
