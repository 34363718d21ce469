"""The stages of a bake, in order; the only place that connects them.

scene -> atlas -> texels -> valid points -> texel sides -> direct light -> patches -> form factors -> solve
-> final gather -> finished pages -> output folder
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from baker.channels.channel import Channel, chosen_channels
from baker.checks.in_bake import bake_warnings
from baker.core.atlas import Atlas
from baker.core.error_mapping import memory_errors
from baker.core.executor import LocalTileExecutor, TileExecutor
from baker.core.export import check_exports
from baker.core.light_limits import check_brightness
from baker.core.lightmap import BakeResult
from baker.core.precision import coarse_warnings
from baker.core.progress import Progress, silent
from baker.core.scene import Scene
from baker.core.settings import BakeSettings
from baker.core.stage import Stage
from baker.io.bake.write_bake import check_encodings, check_out, write_bake
from baker.io.load import load_for_bake
from baker.kernels.not_kept import cache_warnings
from baker.pipeline import precompile
from baker.pipeline.pages import TracedTexels, finish_pages
from baker.pipeline.prepare import prepare_scene
from baker.pipeline.record import Record
from baker.pipeline.transport import trace_transport
from baker.uv.settings import settings_of_atlas
from baker.uv.unwrap import unwrap_scene


def bake(
    scene: Scene | str | Path,
    *,
    settings: BakeSettings,
    out: Path | str | None = None,
    progress: Progress = silent,
    force: bool = False,
    executor: TileExecutor | None = None,
    atlas: Atlas | None = None,
) -> BakeResult:
    """Bake a scene: lightmap uv, light transport, finished maps, and the output folder if asked for.

    Parameters
    ----------
    scene : Scene or path
        A loaded scene, or a scene file.
    settings : BakeSettings
        What is baked, and how.
    out : path, optional
        Folder to write; None keeps everything in memory.
    progress : Progress
        Called with the stage, the share of it that is done, and a detail; a truthy answer cancels the bake.
    force : bool
        Replace an `out` that baker did not write.
    executor : TileExecutor, optional
        Runs the tiles of the ray stages; None is this process.
    atlas : Atlas, optional
        Lightmap uv of the scene; its resolution and padding replace those of `settings`.

    Returns
    -------
    BakeResult
        The finished maps; with `out` and `manifest` if the folder was written.

    Raises
    ------
    InputError
        If the scene cannot be read or has nothing to bake.
    SettingsError
        If a setting does not fit the scene or the channels.
    ResourceError
        If memory, disk or a library is missing.
    Cancelled
        If `progress` returned a truthy value.
    """
    channels = chosen_channels(settings.channels)
    folder = None if out is None else Path(out)
    if folder is not None:
        check_encodings(settings.encode, channels)
        check_exports(settings.export, settings.channels)
        check_out(folder, force=force, scene_path=scene.path if isinstance(scene, Scene) else Path(scene))
    record, compiling = Record(progress), precompile.start()
    with memory_errors():
        with record.stage(Stage.LOAD):
            if isinstance(scene, Scene):
                check_brightness(scene)
            else:
                scene = load_for_bake(scene, settings)
        if atlas is not None:
            settings = settings_of_atlas(scene, atlas, settings)
        compiling = precompile.restart_for_materials(compiling, scene)
        record.warnings.extend([*scene.warnings, *bake_warnings(scene, settings), *cache_warnings()])
        with record.stage(Stage.UNWRAP):
            atlas = atlas or unwrap_scene(scene, settings, progress)
        record.warnings.extend([*atlas.warnings, *coarse_warnings(scene, atlas)])
        traced = _trace(scene, atlas, settings, channels, record, executor or LocalTileExecutor(), compiling)
        precompile.finish(compiling, progress)
        result = finish_pages(scene, atlas, traced, channels, settings, record)
        if folder is not None:
            with record.stage(Stage.WRITE):
                manifest = write_bake(result, folder, force=force, progress=progress)
            result = replace(result, out=folder, manifest=manifest)
    return result


def _trace(
    scene: Scene,
    atlas: Atlas,
    settings: BakeSettings,
    channels: Mapping[str, Channel],
    record: Record,
    executor: TileExecutor,
    compiling: precompile.Process,
) -> TracedTexels:
    """Run the ray stages, and free what finishing does not read: a gigabyte at 4096 texels a side."""
    executor.open(scene, atlas, settings)
    prepared = prepare_scene(scene, atlas, settings, record)
    if any(channel.needs_light for channel in channels.values()):
        precompile.wait_for_rays(compiling, record.progress)
    transport = trace_transport(prepared, channels, record, executor)
    prepared.rays.close()
    executor.close()
    texels = prepared.texels.without_surface()
    return TracedTexels(texels, prepared.job.valid_points[: texels.n_front] != 0, transport)
