"""Functions that bake a scene, write a bake to a folder and export it for an engine."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Unpack

from baker.api.arguments import instance_of, of_the_api, path_of, wrong_type
from baker.core.progress import Progress, silent

if TYPE_CHECKING:
    from baker.api.keywords import AoKeywords, BakeKeywords
    from baker.core.atlas import Atlas
    from baker.core.lightmap import BakeResult
    from baker.core.scene import Scene
    from baker.core.settings import BakeSettings


@of_the_api
def bake(
    scene: Scene | str | Path,
    settings: BakeSettings | None = None,
    *,
    out: str | Path | None = None,
    atlas: Atlas | None = None,
    force: bool = False,
    progress: Progress = silent,
    **keywords: Unpack[BakeKeywords],
) -> BakeResult:
    """Bake a scene.

    Parameters
    ----------
    scene : Scene, str or Path
        A scene file, or a result of `load`.
    settings : BakeSettings, optional
        Settings of the bake.
    out : str or Path, optional
        Folder to write; None keeps the result in memory.
    atlas : Atlas, optional
        Lightmap uv of the scene, a result of `unwrap` for the same Scene. Its resolution and padding replace
        those of the settings.
    force : bool
        Replace `out` even if baker did not write it, and bake even if the estimated memory is not free.
    progress : Progress
        Called with stage, fraction done and a detail as text; a truthy return value cancels.
    **keywords : Unpack[BakeKeywords]
        Settings by name, which replace those in `settings`:

        channels : str | Sequence[str], default ('irradiance', 'ao')
            Channels to bake. Default for a scene without light: ao.
        resolution : int, texels, 16 to 16384, default 1024
            Width and height of each page.
        density : float | None, texels/m, above 0, default None
            Texels per metre; adds pages as needed.
        max_pages : int, 1 to 256, default 16
            Largest number of pages if `density` is set.
        budget : str | None, default None
            Number of pages and their width, such as 2x1024: all objects get the largest density that fits.
        padding : int, texels, 0 to 64, default 4
            Empty texels between charts.
        uv : Literal["auto", "keep", "unwrap"], default 'auto'
            Keep TEXCOORD_1 as lightmap uv, or unwrap; `auto` keeps it if it is valid.
        instances : Literal["share", "unique"], default 'share'
            Instances of a mesh share one mesh and TEXCOORD_1 in scene.glb, or each has its own copy.
        unwrapper : Literal["xatlas"], default 'xatlas'
            Library that cuts surfaces into charts and packs them.
        quality : Literal["preview", "medium", "high", "ultra"], default 'medium'
            Preset of `samples`: preview 16, medium 64, high 256, ultra 1024.
        samples : int | None, 1 to 65536, default None
            Hemisphere rays per texel; default: by `quality`.
        light_samples : int | None, 1 to 65536, default None
            Rays per texel to emissive surfaces; default: `samples`.
        ao_samples : int | None, 1 to 65536, default None
            AO rays per texel; default: `samples`.
        ao_distance : str | float, m, default '10%'
            Maximum distance of AO: metres, `10%` of the scene's diagonal, or `inf`.
        sky : str | float | Sequence[float] | None, cd/m2, default None
            Sky radiance R,G,B in cd/m2. Default: black.
        sky_strength : float, from 0, default 1.0
            Factor of the sky radiance.
        bounces : int | None, 0 to 1000, default None
            Number of reflections of light; default: until converged.
        denoise : bool, default True
            Denoise with Open Image Denoise.
        encode : str | Sequence[str], default ()
            Additional file formats of each page: `hdr`, `ktx2`, `rgbm`, `webp` for maps with three colours;
            `png16`, `png8` for maps with one value per texel.
        export : str | Sequence[str], default ()
            Engines for which a subfolder is written: `three`, `babylon`, `godot`, `unity` ..., see
            ENGINES.md.
        include : str | Sequence[str], default ()
            Bake only objects with these node names or node paths; `*` and `?` are wildcards.
        exclude : str | Sequence[str], default ()
            Leave out objects and lights with these node names or node paths, and their descendants.
        object : str | Sequence[str], default ()
            Settings of the objects with these node names or node paths, and of their descendants.
        name_rules : bool, default True
            Leave out collision hulls and lower levels of detail, recognised by their names, like
            `UCX_Wall`.
        up : Literal["y", "z"], default 'y'
            Up axis, for file formats that do not specify one.
        scale : float, m, above 0, default 1.0
            Metres per unit, for file formats that do not specify their unit.
        scene_name : str | float | None, default None
            Name or number of the scene in a glTF file; default: the file's default scene.
        variant : str | None, default None
            Material variant of a glTF file; default: the materials without a variant.
        animation : str | float | None, default None
            Name or number of the animation that poses a glTF scene; default with `time`: the first one.
        time : float | None, s, from 0, default None
            Time of the animation that poses a glTF scene; default: the pose of the file, with `animation`
            0.
        missing_textures : Literal["error", "white", "grey", "magenta"], default 'error'
            Colour that replaces unreadable textures of base colour, emission and alpha, or error.
        split : Literal["groups", "objects", "none"], default 'groups'
            What becomes an object of an OBJ file: each object and group, each object, or the whole file.
        unlit : Literal["block", "lit"], default 'block'
            Unlit materials of glTF only block light (`block`), or also reflect it like others (`lit`).
        allow_outside : bool, default False
            Also read referenced files outside the scene's folder.
        seed : int, 0 to 2147483647, default 0
            Seed of all random numbers.
        threads : int | None, 1 to 1024, default None
            Number of threads; default: all cores.
        dtype : Literal["half", "float"], default 'half'
            Number format of the EXR files.
        exr_compression : Literal["zip", "piz"], default 'zip'
            Compression of the EXR files.
        rgbm_range : str | float, lx, default 'auto'
            Largest irradiance that RGBM can store, lx; `auto` uses the brightest texel.

    Returns
    -------
    BakeResult
        `result.lightmaps["irradiance"].value` is (pages, H, W, 3) float32, lx.

    Raises
    ------
    InputError
        If the scene cannot be read or contains nothing to bake.
    SettingsError
        For an unknown setting, a value out of range, or an atlas of another scene.
    ResourceError
        If memory or disk space runs out, or a library is missing.
    Cancelled
        If `progress` returned a truthy value.

    Examples
    --------
    >>> result = baker.bake("cornell.glb", out="out", resolution=64, quality="preview", denoise=False)
    >>> result.lightmaps["irradiance"].value.shape
    (1, 64, 64, 3)
    >>> (result.status == baker.TexelStatus.COVERED).any()
    np.True_

    The scene and its atlas can be made by separate calls, and settings can be passed as an object:

    >>> scene = baker.load("cornell.glb")
    >>> atlas = baker.unwrap(scene, baker.UnwrapSettings(resolution=64))
    >>> settings = baker.BakeSettings(quality="preview", denoise=False)
    >>> result = baker.bake(scene, settings, atlas=atlas, samples=4)
    >>> result.settings.resolution
    64
    """
    from baker.api.settings_of import settings_of
    from baker.core.atlas import Atlas
    from baker.core.scene import Scene
    from baker.core.settings import BakeSettings
    from baker.pipeline.bake import bake as run

    wanted = settings_of(BakeSettings, settings, keywords)
    scene = scene if isinstance(scene, Scene) else path_of(scene, "scene", "a file or a baker.Scene")
    if atlas is not None:
        atlas = instance_of(atlas, Atlas, "atlas", "; baker.unwrap makes one")
    out = None if out is None else path_of(out, "out")
    return run(scene, settings=wanted, out=out, progress=progress, force=force, atlas=atlas)


@of_the_api
def ao(
    scene: Scene | str | Path,
    settings: BakeSettings | None = None,
    *,
    out: str | Path | None = None,
    atlas: Atlas | None = None,
    force: bool = False,
    progress: Progress = silent,
    **keywords: Unpack[AoKeywords],
) -> BakeResult:
    """Bake ambient occlusion only.

    Parameters
    ----------
    scene : Scene, str or Path
        A scene file, or a result of `load`.
    settings : BakeSettings, optional
        Settings of the bake; `channels` is ignored.
    out : str or Path, optional
        Folder to write; None keeps the result in memory.
    atlas : Atlas, optional
        Lightmap uv of the scene, a result of `unwrap` for the same Scene. Its resolution and padding replace
        those of the settings.
    force : bool
        Replace `out` even if baker did not write it, and bake even if the estimated memory is not free.
    progress : Progress
        Called with stage, fraction done and a detail as text; a truthy return value cancels.
    **keywords : Unpack[AoKeywords]
        Settings by name, which replace those in `settings`: all keywords of `bake` except `channels`.

    Returns
    -------
    BakeResult
        `result.lightmaps["ao"].value` is (pages, H, W, 1) float32; 1 is unoccluded, 0 is fully occluded.

    Raises
    ------
    InputError
        If the scene cannot be read or contains nothing to bake.
    SettingsError
        For an unknown setting, a value out of range, or an atlas of another scene.
    ResourceError
        If memory or disk space runs out, or a library is missing.
    Cancelled
        If `progress` returned a truthy value.

    Examples
    --------
    >>> result = baker.ao("cornell.glb", resolution=64, samples=4, ao_distance=0.5, denoise=False)
    >>> list(result.lightmaps)
    ['ao']
    """
    from baker.api.settings_of import settings_of
    from baker.core.atlas import Atlas
    from baker.core.scene import Scene
    from baker.core.settings import BakeSettings
    from baker.pipeline.bake import bake as run

    wanted = settings_of(BakeSettings, settings, {**keywords, "channels": "ao"})
    scene = scene if isinstance(scene, Scene) else path_of(scene, "scene", "a file or a baker.Scene")
    if atlas is not None:
        atlas = instance_of(atlas, Atlas, "atlas", "; baker.unwrap makes one")
    out = None if out is None else path_of(out, "out")
    return run(scene, settings=wanted, out=out, progress=progress, force=force, atlas=atlas)


@of_the_api
def save(
    bake: BakeResult,
    out: str | Path,
    *,
    export: str | Sequence[str] = (),
    force: bool = False,
    progress: Progress = silent,
) -> BakeResult:
    """Write a result of `bake` to an output folder.

    Parameters
    ----------
    bake : BakeResult
        The bake to write.
    out : str or Path
        Folder to write. After an error it has its old content.
    export : str or sequence of str
        Engines for which a subfolder is written: "godot", "unity", "three" ...
    force : bool
        Replace `out` even if baker did not write it.
    progress : Progress
        Called with stage, fraction done and a detail as text; a truthy return value cancels.

    Returns
    -------
    BakeResult
        A copy of `bake` with `out` and `manifest`.

    Raises
    ------
    SettingsError
        For an unknown export, or if `out` must not be replaced.
    ResourceError
        If the folder cannot be written.
    Cancelled
        If `progress` returned a truthy value.

    Examples
    --------
    >>> saved = baker.save(result, "ao_only", export=["gltf"])
    >>> sorted(path.name for path in saved.out.iterdir())
    ['ao_0.exr', 'bake.json', 'gltf', 'scene.glb', 'status_0.png']
    """
    from baker.core.export import check_exports
    from baker.core.lightmap import BakeResult
    from baker.io.bake.write_bake import check_out, write_bake

    bake, folder = instance_of(bake, BakeResult, "bake", "; baker.bake makes one"), path_of(out, "out")
    settings = bake.settings.changed(export=export) if export else bake.settings
    check_exports(settings.export, settings.channels)
    check_out(folder, force=force, scene_path=bake.scene.path)
    manifest = write_bake(replace(bake, settings=settings), folder, force=force, progress=progress)
    return replace(bake, settings=settings, out=folder, manifest=manifest)


@of_the_api
def export(bake: str | Path | BakeResult, engine: str, out: str | Path) -> Path:
    """Convert a finished bake to a folder of files for one engine.

    Parameters
    ----------
    bake : str, Path or BakeResult
        An output folder, or a bake that was written to a folder.
    engine : str
        Name of the engine, such as "godot", "unity" or "three"; see ENGINES.md.
    out : str or Path
        Folder to write. If it exists, it must be empty. After an error it is as before.

    Returns
    -------
    Path
        `out`.

    Raises
    ------
    InputError
        If the folder contains no bake.
    SettingsError
        For an unknown engine, if a channel that it needs is not baked, or if `out` is not empty.

    Examples
    --------
    >>> baker.export("out", "three", "for_three").name
    'for_three'
    """
    from baker.api.folders import folder_of
    from baker.core.errors import SettingsError
    from baker.core.export import EXPORTS, check_exports
    from baker.io.bake.output_folder import OutputFolder
    from baker.io.bake.read_bake import read_bake
    from baker.io.bake.recovery import recover

    if not isinstance(engine, str):
        raise wrong_type("engine", "the name of one export", engine)
    stored = read_bake(folder_of(bake))
    check_exports((engine,), tuple(stored.maps))
    target = path_of(out, "out")
    recover(target)
    if target.exists() and (not target.is_dir() or any(target.iterdir())):
        raise SettingsError("there are files here already; name another folder", file=str(target))
    with OutputFolder(target) as folder:
        EXPORTS.require(engine, "export").write(stored.folder, folder.path)
        folder.commit()
    return target
