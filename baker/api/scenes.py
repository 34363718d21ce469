"""Functions that load, check and repair scenes, and that make lightmap uv."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Unpack

from baker.api.arguments import instance_of, of_the_api, path_of
from baker.core.progress import Progress, silent

if TYPE_CHECKING:
    from baker.api.keywords import CheckKeywords, LoadKeywords, RepairKeywords, UnwrapKeywords
    from baker.checks.run import CheckReport
    from baker.checks.settings import CheckSettings
    from baker.core.atlas import Atlas
    from baker.core.scene import Scene
    from baker.core.settings import BakeSettings
    from baker.io.settings import LoadSettings
    from baker.repairs.fix_file import FixResult
    from baker.repairs.settings import RepairSettings
    from baker.uv.settings import UnwrapSettings


@of_the_api
def load(path: str | Path, settings: LoadSettings | None = None, **keywords: Unpack[LoadKeywords]) -> Scene:
    """Read a scene file.

    Parameters
    ----------
    path : str or Path
        A scene file, such as .glb or .obj; `baker.io.importers` contains one module for each format.
    settings : LoadSettings, optional
        Units, scene, pose and variant of the file.
    **keywords : Unpack[LoadKeywords]
        Settings by name, which replace those in `settings`:

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

    Returns
    -------
    Scene
        The scene in metres, +Y up, linear Rec.709.

    Raises
    ------
    InputError
        If the file is unreadable, malformed, or contains nothing to bake.
    SettingsError
        For an unknown setting or a value out of range. If the file has no scene, variant or animation of the
        given name.

    Examples
    --------
    >>> import baker
    >>> scene = baker.load("cornell.glb")
    >>> len(scene.instances), scene.n_triangles
    (8, 32)
    """
    from baker.api.settings_of import settings_of
    from baker.io.load import load_scene_as
    from baker.io.settings import LoadSettings

    return load_scene_as(path_of(path, "path", "a scene file"), settings_of(LoadSettings, settings, keywords))


@of_the_api
def check(
    scene: Scene | str | Path,
    settings: CheckSettings | None = None,
    *,
    bake: BakeSettings | None = None,
    progress: Progress = silent,
    **keywords: Unpack[CheckKeywords],
) -> CheckReport:
    """Find defects of a scene that make a bake fail or cause errors in its lightmap.

    Parameters
    ----------
    scene : Scene, str or Path
        A scene file, or a result of `load`. Most defects for which `load` raises an error are findings here.
    settings : CheckSettings, optional
        Which findings are ignored, which fail the check, and how cost is estimated.
    bake : BakeSettings, optional
        Settings of the planned bake, such as `resolution`, `padding`, `uv` and `sky`.
    progress : Progress
        Called with stage, fraction done and a detail as text; a truthy return value cancels.
    **keywords : Unpack[CheckKeywords]
        Settings by name, which replace those in `settings`:

        fail_on : Literal["warning", "error"] | None, default None
            Lowest severity that fails the check; default: the scene's extras, else error.
        ignore : str | Sequence[str], default ()
            Findings to ignore; `*` matches any characters. Repeatable.
        mip : int, 0 to 14, default 2
            Coarsest mip level at which charts must not bleed into each other; 0 is the page.
        rates : str | Path | None, default None
            Folder of an earlier bake whose speed is used to estimate time; default: the latest bake of the
            scene in a folder beside it.
        cost : bool, default False
            Estimate time and memory of a bake; measures the speed of rays for about a second.

    Returns
    -------
    CheckReport
        Findings in order of decreasing severity, and whether the scene passed.

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
    >>> report = baker.check("cornell.glb", fail_on="warning")
    >>> report.passed
    True
    >>> sorted({finding.severity for finding in report.findings})
    ['info']
    """
    from baker.api.settings_of import settings_of
    from baker.checks.run import check_scene
    from baker.checks.settings import CheckSettings
    from baker.core.scene import Scene
    from baker.core.settings import BakeSettings

    scene = scene if isinstance(scene, Scene) else path_of(scene, "scene", "a file or a baker.Scene")
    bake = BakeSettings() if bake is None else instance_of(bake, BakeSettings, "bake")
    return check_scene(scene, settings_of(CheckSettings, settings, keywords), bake, progress)


@of_the_api
def repair(
    scene: str | Path,
    out: str | Path | None = None,
    settings: RepairSettings | None = None,
    *,
    force: bool = False,
    progress: Progress = silent,
    **keywords: Unpack[RepairKeywords],
) -> FixResult:
    """Fix the meshes of a scene file without a visible change; with `repair=True`, also repair shapes.

    Parameters
    ----------
    scene : str or Path
        A scene file of any supported format. It is not changed.
    out : str or Path, optional
        The .glb file to write; None keeps the result in memory.
    settings : RepairSettings, optional
        Lightmap resolution, units, and whether shapes are repaired.
    force : bool
        Replace `out` if it exists.
    progress : Progress
        Called with stage, fraction done and a detail as text; a truthy return value cancels.
    **keywords : Unpack[RepairKeywords]
        Settings by name, which replace those in `settings`:

        repair : bool, default False
            Fix, and also repair the shape of meshes: non-manifold edges, holes, orientation, slivers (needs
            pip install pymeshlab).
        resolution : int, texels, 16 to 16384, default 1024
            Width of the page for which lightmap uv are tested and made.
        up : Literal["y", "z"], default 'y'
            Up axis, for file formats that do not specify one.
        scale : float, m, above 0, default 1.0
            Metres per unit, for file formats that do not specify their unit.
        allow_outside : bool, default False
            Also read referenced files outside the scene's folder.
        threads : int | None, 1 to 1024, default None
            Number of threads; default: all cores.

    Returns
    -------
    FixResult
        The content of the GLB file (`data`), the changes made, and the defects that were not fixed.

    Raises
    ------
    InputError
        If the file cannot be read, or a defect that is not fixed prevents a bake; `out` is not written.
    SettingsError
        For an unknown setting, a value out of range, or if `out` cannot be written.
    ResourceError
        If `repair` is set and pymeshlab is not installed, or the fixed scene cannot be written and read.
    Cancelled
        If `progress` returned a truthy value.

    Examples
    --------
    >>> result = baker.repair("cornell.glb", "fixed.glb", resolution=64)
    >>> [fix.change.change for fix in result.fixed]
    []
    """
    from baker.api.settings_of import settings_of
    from baker.repairs.fix_file import fix_file
    from baker.repairs.settings import RepairSettings
    from baker.repairs.write import check_fixed, write_fixed

    wanted = settings_of(RepairSettings, settings, keywords)
    file = path_of(scene, "scene", "a scene file")
    if out is not None:
        check_fixed(path_of(out, "out"), file, force=force)
    result = fix_file(file, wanted, progress)
    if out is not None:
        write_fixed(Path(out), result.data, file, allow_outside=wanted.allow_outside)
    return result


@of_the_api
def unwrap(
    scene: Scene,
    settings: UnwrapSettings | None = None,
    *,
    progress: Progress = silent,
    **keywords: Unpack[UnwrapKeywords],
) -> Atlas:
    """Make lightmap uv for every instance of a scene and pack them in pages.

    Parameters
    ----------
    scene : Scene
        A result of `load`.
    settings : UnwrapSettings, optional
        Size of the pages, density, padding, and whether TEXCOORD_1 is kept.
    progress : Progress
        Called with stage, fraction done and a detail as text; a truthy return value cancels.
    **keywords : Unpack[UnwrapKeywords]
        Settings by name, which replace those in `settings`:

        resolution : int, texels, 16 to 16384, default 1024
            Width and height of each page.
        density : float | None, texels/m, above 0, default None
            Texels per metre; adds pages as needed.
        max_pages : int, 1 to 256, default 16
            Largest number of pages if `density` is set.
        padding : int, texels, 0 to 64, default 4
            Empty texels between charts.
        uv : Literal["auto", "keep", "unwrap"], default 'auto'
            Keep TEXCOORD_1 as lightmap uv, or unwrap; `auto` keeps it if it is valid.
        instances : Literal["share", "unique"], default 'share'
            Instances of a mesh share one mesh and TEXCOORD_1 in scene.glb, or each has its own copy.
        unwrapper : Literal["xatlas"], default 'xatlas'
            Library that cuts surfaces into charts and packs them.
        threads : int | None, 1 to 1024, default None
            Number of threads; default: all cores.

    Returns
    -------
    Atlas
        Page and lightmap uv of each instance, for the argument `atlas` of `bake`.

    Raises
    ------
    InputError
        If the scene has no triangles, or its uv cannot be kept although `uv` is "keep".
    SettingsError
        For an unknown setting or a value out of range.
    Cancelled
        If `progress` returned a truthy value.

    Examples
    --------
    >>> atlas = baker.unwrap(scene, resolution=64)
    >>> atlas.resolution, atlas.n_pages, len(atlas.layouts)
    (64, 1, 8)
    """
    from baker.api.settings_of import settings_of
    from baker.core.scene import Scene
    from baker.uv.settings import UnwrapSettings
    from baker.uv.unwrap import unwrap_scene

    scene = instance_of(scene, Scene, "scene", "; baker.load reads one")
    return unwrap_scene(scene, settings_of(UnwrapSettings, settings, keywords).for_bake(), progress)
