"""Functions that verify, compare, render and view finished bakes, and that run batches of bakes."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Unpack, overload

from baker.api.arguments import of_the_api, path_of
from baker.core.progress import Progress, silent

if TYPE_CHECKING:
    from baker.api.keywords import BatchKeywords, DiffKeywords, RenderKeywords, VerifyKeywords
    from baker.comparison.compare import DiffReport
    from baker.comparison.settings import DiffSettings
    from baker.core.lightmap import BakeResult
    from baker.core.scene import Scene
    from baker.jobs.report import BatchReport
    from baker.jobs.settings import BatchSettings
    from baker.rendering.render import Picture
    from baker.rendering.settings import RenderSettings
    from baker.verification.settings import VerifySettings
    from baker.verification.verify import VerifyReport
    from baker.viewer.server import ViewServer


@of_the_api
def verify(
    bake: str | Path | BakeResult,
    settings: VerifySettings | None = None,
    *,
    progress: Progress = silent,
    **keywords: Unpack[VerifyKeywords],
) -> VerifyReport:
    """Measure the error of a finished bake against path tracing.

    Parameters
    ----------
    bake : str, Path or BakeResult
        An output folder, or a bake that was written to a folder.
    settings : VerifySettings, optional
        Number of points, effort of path tracing, and limits.
    progress : Progress
        Called with stage, fraction done and a detail as text; a truthy return value cancels.
    **keywords : Unpack[VerifyKeywords]
        Settings by name, which replace those in `settings`:

        texels : int, from 1, default 2000
            Number of random texels to compare. Points at edges are added. Texels that differ from all their
            neighbours, that have large gradients or that have rare light levels are added, too.
        spp : int | None, from 1, default None
            Fixed number of paths for each texel.
        target_se : float, above 0, default 0.005
            Relative standard error at which path tracing of a texel stops.
        time_limit : float | None, s, above 0, default None
            Time for path tracing; `inf` is no limit. Default: 40, or no limit if `spp` is set.
        fail_if : str | None, default None
            Conditions for failure, separated by commas: "irradiance.p95 > 0.05, ao.rmse > 0.02". Default:
            the limits of `baker` for each channel.
        seed : int, 0 to 2147483647, default 0
            Seed of all random numbers.
        threads : int | None, 1 to 1024, default None
            Number of threads; default: all cores.

    Returns
    -------
    VerifyReport
        Metrics of each channel, tables of objects, light levels, regions and the texels with the largest
        errors, and whether all limits hold.

    Raises
    ------
    InputError
        If the folder contains no bake.
    SettingsError
        For an unknown setting, a value out of range, or a limit that cannot be parsed.
    ResourceError
        If memory runs out or a library is missing.
    Cancelled
        If `progress` returned a truthy value.

    Examples
    --------
    >>> report = baker.verify("out", texels=50, spp=8)
    >>> 0 <= report.channels["irradiance"].figures["median"] < 1
    True
    >>> report.channels["ao"].bias == report.channels["ao"].figures["bias"]
    True
    """
    from baker.api.folders import folder_of
    from baker.api.settings_of import settings_of
    from baker.verification.settings import VerifySettings
    from baker.verification.verify import verify as run

    return run(folder_of(bake), settings_of(VerifySettings, settings, keywords), progress)


@of_the_api
def diff(
    a: str | Path | BakeResult,
    b: str | Path | BakeResult,
    settings: DiffSettings | None = None,
    *,
    progress: Progress = silent,
    **keywords: Unpack[DiffKeywords],
) -> DiffReport:
    """Compare two finished bakes at the same points of the surface; their lightmap uv may differ.

    Parameters
    ----------
    a, b : str, Path or BakeResult
        Output folders, or bakes that were written to folders. `b` is the reference.
    settings : DiffSettings, optional
        Number of texels, and limits.
    progress : Progress
        Called with stage, fraction done and a detail as text; a truthy return value cancels.
    **keywords : Unpack[DiffKeywords]
        Settings by name, which replace those in `settings`:

        texels : int, from 1, default 20000
            Number of texels of A to compare.
        flip : bool, default True
            Also compute the FLIP error of the pages.
        fail_if : str | None, default None
            Conditions for failure, separated by commas: "irradiance.p95 > 0.05, ao.flip > 0.02". Default:
            none.
        seed : int, 0 to 2147483647, default 0
            Seed of all random numbers.
        threads : int | None, 1 to 1024, default None
            Number of threads; default: all cores.

    Returns
    -------
    DiffReport
        Error metrics of each channel that both bakes have, and the texels with the largest errors.

    Raises
    ------
    InputError
        If a folder contains no bake, or the bakes have no surface or channel in common.
    SettingsError
        For an unknown setting, a value out of range, or a limit that cannot be parsed.
    Cancelled
        If `progress` returned a truthy value.

    Examples
    --------
    >>> report = baker.diff("out", "ao_only", texels=100)
    >>> list(report.channels), report.passed
    (['ao'], True)
    """
    from baker.api.folders import folder_of
    from baker.api.settings_of import settings_of
    from baker.comparison.compare import compare
    from baker.comparison.settings import DiffSettings

    return compare(
        folder_of(a, "a"), folder_of(b, "b"), settings_of(DiffSettings, settings, keywords), progress
    )


@of_the_api
def render(
    scene: Scene | str | Path,
    settings: RenderSettings | None = None,
    *,
    out: str | Path | None = None,
    progress: Progress = silent,
    **keywords: Unpack[RenderKeywords],
) -> Picture:
    """Render a scene through a pinhole camera by path tracing, as ambient occlusion, or lit by a bake.

    Parameters
    ----------
    scene : Scene, str or Path
        A scene file, or a result of `load`.
    settings : RenderSettings, optional
        Camera, size of the picture, number of paths and other settings.
    out : str or Path, optional
        EXR or PNG file to write.
    progress : Progress
        Called with stage, fraction done and a detail as text; a truthy return value cancels.
    **keywords : Unpack[RenderKeywords]
        Settings by name, which replace those in `settings`:

        camera : str | float | Sequence[float] | None, default None
            Position, target and vertical field of view in degrees; or name or number of a camera in the
            file. Default: the file's first camera.
        width : int, pixels, 1 to 16384, default 640
            Width of the picture.
        height : int, pixels, 1 to 16384, default 480
            Height of the picture.
        spp : int | None, from 1, default None
            Number of paths per pixel; at least two are traced. Default: 64, or no limit with `time_limit`.
        time_limit : float | None, s, above 0, default None
            Stop after this time, which includes loading. At least two paths per pixel are traced.
        estimator : str, default 'mis'
            Estimator: uniform, cosine, stratified, light, bsdf, mis, mis-power or bdpt.
        max_depth : int | None, from 1, default None
            Largest number of surface points that reflect light on a path; 1 is direct light only. Default:
            no limit.
        ao : bool, default False
            Render ambient occlusion.
        ao_distance : str | float | None, m, default None
            Largest distance of occluders for `ao`: metres, `10%` of the scene's diagonal, or `inf`.
        aov : str | Sequence[str], default ()
            Further layers: albedo, normal, depth.
        denoise : bool, default False
            Run Open Image Denoise over the picture.
        lightmap : str | Path | None, default None
            Output folder of a bake. Instead of the input, its scene is rendered, lit by its lightmaps,
            without path tracing.
        sky : str | float | Sequence[float] | None, cd/m2, default None
            Sky radiance R,G,B in cd/m2. Default: black; with `lightmap`, the sky of the bake.
        sky_strength : float, from 0, default 1.0
            Factor of the sky radiance.
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
        include : str | Sequence[str], default ()
            Bake only objects with these node names or node paths; `*` and `?` are wildcards.
        exclude : str | Sequence[str], default ()
            Leave out objects and lights with these node names or node paths, and their descendants.
        object : str | Sequence[str], default ()
            Settings of the objects with these node names or node paths, and of their descendants.
        name_rules : bool, default True
            Leave out collision hulls and lower levels of detail, recognised by their names, like
            `UCX_Wall`.
        allow_outside : bool, default False
            Also read referenced files outside the scene's folder.
        seed : int, 0 to 2147483647, default 0
            Seed of all random numbers.
        threads : int | None, 1 to 1024, default None
            Number of threads; default: all cores.

    Returns
    -------
    Picture
        `colour` is (H, W, 3) float32, cd/m2.

    Raises
    ------
    InputError
        If the scene cannot be read, or if neither the scene nor `camera` specifies a camera.
    SettingsError
        For an unknown setting, a value out of range, or if `out` is not an EXR or PNG file.
    ResourceError
        If memory or disk space runs out, or a library is missing.
    Cancelled
        If `progress` returned a truthy value.

    Examples
    --------
    >>> picture = baker.render("cornell.glb", out="view.png", width=32, height=24, spp=4)
    >>> picture.colour.shape
    (24, 32, 3)
    """
    from baker.api.settings_of import settings_of
    from baker.core.scene import Scene
    from baker.io.protected_files import check_outputs
    from baker.rendering.render import render as run
    from baker.rendering.settings import RenderSettings
    from baker.rendering.write import check_image, write_picture

    wanted = settings_of(RenderSettings, settings, keywords)
    scene = scene if isinstance(scene, Scene) else path_of(scene, "scene", "a file or a baker.Scene")
    if out is not None:
        check_image(path_of(out, "out"), wanted.aov)
        check_outputs({"out": Path(out)}, [Path(scene)] if isinstance(scene, str | Path) else [])
    picture = run(scene, wanted, progress)
    if out is not None:
        write_picture(Path(out), picture)
    return picture


@overload
def view(
    bake: str | Path | BakeResult,
    *,
    port: int = 0,
    three: str | Path | None = None,
    browser: bool = True,
    export: None = None,
) -> ViewServer: ...


@overload
def view(
    bake: str | Path | BakeResult,
    *,
    port: int = 0,
    three: str | Path | None = None,
    browser: bool = True,
    export: str | Path,
) -> Path: ...


@of_the_api
def view(
    bake: str | Path | BakeResult,
    *,
    port: int = 0,
    three: str | Path | None = None,
    browser: bool = True,
    export: str | Path | None = None,
) -> ViewServer | Path:
    """Serve a local web page that shows a finished bake, in a thread of this process, or write the page.

    Parameters
    ----------
    bake : str, Path or BakeResult
        An output folder, or a bake that was written to a folder.
    port : int
        Port on 127.0.0.1; 0 chooses a free port.
    three : str or Path, optional
        Copy of three.js to use: its file, or the folder in which npm installed it.
    browser : bool
        Whether to open the page in the default browser.
    export : str or Path, optional
        Folder into which the page is written as static files, for any web server. Nothing is served then. A
        folder that exists is replaced if it contains only an exported page.

    Returns
    -------
    ViewServer or Path
        The running server. `url` is its address; `shutdown()` and `server_close()` stop it. With `export`,
        the path of the written `index.html`.

    Raises
    ------
    InputError
        If the folder contains no bake, or `three` is not a copy of three.js.
    SettingsError
        If `port` is not an integer from 0 to 65535, or `export` is not a folder for the page.
    ResourceError
        If the port is in use, three.js is not installed, or the page cannot be written.

    Examples
    --------
    >>> server = baker.view("out", browser=False)
    >>> server.url.startswith("http://127.0.0.1:")
    True
    >>> server.shutdown(), server.server_close()
    (None, None)
    >>> baker.view("out", export="page").name
    'index.html'
    """
    import threading
    import webbrowser

    from baker.api.folders import folder_of
    from baker.core.errors import SettingsError
    from baker.io.bake.read_bake import read_bake
    from baker.viewer.export import checked_folder, export_page
    from baker.viewer.script import find_three
    from baker.viewer.server import make_server

    if not (isinstance(port, int) and 0 <= port <= 65535):
        raise SettingsError(f"`port` is no number from 0 to 65535 (was {port!r})", object="port")
    script = find_three(None if three is None else path_of(three, "three"))
    if export is not None:
        folder = checked_folder(path_of(export, "export"))
        export_page(read_bake(folder_of(bake)), script, folder)
        return folder / "index.html"
    server = make_server(read_bake(folder_of(bake)), script, port=port)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    if browser:
        threading.Thread(target=webbrowser.open, args=(server.url,), daemon=True).start()
    return server


@of_the_api
def batch(
    jobs_file: str | Path,
    settings: BatchSettings | None = None,
    *,
    progress: Progress = silent,
    **keywords: Unpack[BatchKeywords],
) -> BatchReport:
    r"""Bake the scenes of a jobs file that are not up to date.

    Parameters
    ----------
    jobs_file : str or Path
        TOML file that lists scenes and settings, see BATCH.md.
    settings : BatchSettings, optional
        Number of processes, memory limit, and which jobs are baked.
    progress : Progress
        Called with stage, fraction done and a detail as text; a truthy return value cancels.
    **keywords : Unpack[BatchKeywords]
        Settings by name, which replace those in `settings`:

        jobs : int, 1 to 1024, default 1
            Number of bakes that run at the same time, each in a separate process.
        memory : str | float | None, bytes, default None
            Limit of the estimated memory of all running bakes together, such as 8G.
        dry_run : bool, default False
            Only report the jobs that would be baked, with reasons.
        fail_fast : bool, default False
            Start no further jobs after a failure.
        force : bool, default False
            Bake all jobs, also into folders that baker did not write.
        seed : int | None, 0 to 2147483647, default None
            Seed of all bakes; by default, each job uses the seed in its settings.
        threads : int | None, 1 to 1024, default None
            Number of threads; default: all cores.

    Returns
    -------
    BatchReport
        The outcome of each job.

    Raises
    ------
    InputError
        If the file cannot be read.
    SettingsError
        For an unknown setting or a value out of range.
    Cancelled
        If `progress` returned a truthy value.

    Examples
    --------
    >>> from pathlib import Path
    >>> _ = Path("jobs.toml").write_text('[[job]]\nscene = "cornell.glb"\nout = "batch_out"\n')
    >>> report = baker.batch("jobs.toml", dry_run=True)
    >>> [outcome.state for outcome in report.outcomes]
    ['baked']
    """
    from baker.api.settings_of import settings_of
    from baker.jobs.report import run_jobs_file
    from baker.jobs.settings import BatchSettings

    return run_jobs_file(
        path_of(jobs_file, "jobs_file"), settings_of(BatchSettings, settings, keywords), progress
    )
