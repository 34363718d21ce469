"""Runs the stages of a bake in order.

scene -> atlas -> texels -> valid points -> texel sides -> direct light -> patches -> form factors -> solve
-> final gather -> finished pages -> output folder
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from baker.channels.channel import Channel, chosen_channels
from baker.checks.in_bake import bake_warnings
from baker.core.atlas import Atlas
from baker.core.error_mapping import memory_errors
from baker.core.executor import LocalTileExecutor, TileExecutor
from baker.core.export import check_exports
from baker.core.light_limits import check_brightness
from baker.core.lightmap import BakeResult
from baker.core.precision import coarse_warnings
from baker.core.progress import Progress, notify, silent
from baker.core.scene import Scene
from baker.core.settings import BakeSettings
from baker.core.stage import Stage
from baker.io.bake.write_bake import check_encodings, check_out, write_bake
from baker.io.load import load_for_bake
from baker.io.protected_files import check_outputs
from baker.kernels.not_kept import cache_warnings
from baker.pipeline import precompile
from baker.pipeline.memory_check import check_memory
from baker.pipeline.no_light import fit_to_light
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
    """Make lightmap uv, compute light transport, finish the maps, and write a folder if `out` is set.

    Parameters
    ----------
    scene : Scene or path
        A loaded scene, or a scene file.
    settings : BakeSettings
        Settings of the bake.
    out : path, optional
        Folder to write; None keeps the result in memory.
    progress : Progress
        Called with the stage, the share of it that is done, and a detail; a truthy return value cancels.
    force : bool
        Also write into a folder that contains files but no bake, and bake even if the estimated memory is not
        free.
    executor : TileExecutor, optional
        Runs the tiles of the ray stages; by default, they run in this process.
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
        If memory or disk space runs out, or a library is missing.
    Cancelled
        If `progress` returned a truthy value.
    """
    channels = chosen_channels(settings.channels)
    folder = _folder(out, scene, settings, channels, force)
    compiling = precompile.start()
    record = Record(precompile.labelled(compiling, progress))
    with memory_errors():
        scene = _load(scene, settings, record)
        if atlas is not None:
            settings = settings_of_atlas(scene, atlas, settings)
        settings, dark = fit_to_light(scene, settings)
        if dark is not None:
            notify(progress, dark.message)
            record.warnings.append(dark)
            channels = chosen_channels(settings.channels)
        if not force:
            check_memory(scene, settings, channels)
        compiling = precompile.restart_for_materials(compiling, scene)
        record.progress = precompile.labelled(compiling, progress)
        atlas = _layout(scene, atlas, settings, record)
        traced = _trace(scene, atlas, settings, channels, record, executor or LocalTileExecutor(), compiling)
        precompile.finish(compiling, progress)
        result = finish_pages(scene, atlas, traced, channels, settings, record)
        if folder is not None:
            result = _write(result, folder, force, record)
    return result


def _folder(
    out: Path | str | None,
    scene: Scene | str | Path,
    settings: BakeSettings,
    channels: Mapping[str, Channel],
    force: bool,
) -> Path | None:
    """Return the output folder; raise an error before the bake if the result could not be written."""
    if out is None:
        return None
    check_encodings(settings.encode, channels, settings.resolution)
    check_exports(settings.export, settings.channels)
    scene_path = scene.path if isinstance(scene, Scene) else Path(scene)
    check_out(Path(out), force=force, scene_path=scene_path)
    check_outputs({"out": Path(out)}, [] if scene_path is None else [scene_path])
    return Path(out)


def _load(scene: Scene | str | Path, settings: BakeSettings, record: Record) -> Scene:
    """Return the scene; read it if `scene` is a path."""
    with record.stage(Stage.LOAD):
        if not isinstance(scene, Scene):
            return load_for_bake(scene, settings)
        check_brightness(scene)
        return scene


def _layout(scene: Scene, atlas: Atlas | None, settings: BakeSettings, record: Record) -> Atlas:
    """Return `atlas`, or unwrap the scene if it is None; record the warnings about scene and atlas."""
    record.warnings.extend([*scene.warnings, *bake_warnings(scene, settings), *cache_warnings()])
    with record.stage(Stage.UNWRAP):
        atlas = atlas or unwrap_scene(scene, settings, record.progress)
    record.warnings.extend([*atlas.warnings, *coarse_warnings(scene, atlas)])
    return atlas


def _trace(
    scene: Scene,
    atlas: Atlas,
    settings: BakeSettings,
    channels: Mapping[str, Channel],
    record: Record,
    executor: TileExecutor,
    compiling: precompile.Process,
) -> TracedTexels:
    """Run the ray stages, and return only the results that `finish_pages` reads; other arrays are freed."""
    executor.open(scene, atlas, settings)
    prepared = prepare_scene(scene, atlas, settings, record)
    if any(channel.needs_light for channel in channels.values()):
        precompile.wait_for_rays(compiling, record.progress)
    transport = trace_transport(prepared, channels, record, executor)
    prepared.close()
    executor.close()
    texels = prepared.texels.without_surface().without_hidden(atlas.n_pages)
    valid = prepared.job.valid_points[: texels.n_front] != 0
    # Half floats are precise enough for the suggested exposure and take half of the memory.
    albedo = prepared.texels.albedo[: texels.n_front].astype(np.float16)
    layers = {
        name: tuple(layer.first(texels.n_front) for layer in channel.layers(transport))
        for name, channel in channels.items()
    }
    return TracedTexels(texels, valid, albedo, layers)


def _write(result: BakeResult, folder: Path, force: bool, record: Record) -> BakeResult:
    """Write the output folder; return the result with `out` and `manifest`."""
    with record.stage(Stage.WRITE):
        manifest = write_bake(result, folder, force=force, progress=record.progress)
    return replace(result, out=folder, manifest=manifest)
