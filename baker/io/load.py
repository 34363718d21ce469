"""Loads a scene file of any known format as a `Scene`.

Each file of `baker.io.importers` registers one function for the file suffixes that it reads.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from numbers import Real
from pathlib import Path
from typing import TYPE_CHECKING

from baker.core.error_mapping import memory_errors
from baker.core.errors import InputError, SettingsError
from baker.core.light_limits import check_brightness
from baker.core.read_options import AS_IN_FILE, ReadOptions
from baker.core.registry import Registry
from baker.core.scene import Scene
from baker.io.level import LEVEL_SUFFIXES, read_level
from baker.io.object_rules import apply_object_settings
from baker.io.regular_file import read_regular
from baker.io.scene_folder import SceneFolder

if TYPE_CHECKING:
    from baker.core.settings import BakeSettings
    from baker.io.settings import LoadSettings


@dataclass(frozen=True)
class SceneFile:
    """The argument of an importer: the content of a scene file, and options.

    Attributes
    ----------
    path : Path
    data : bytes
        Content of the file, at least one byte.
    up : str
        "y" or "z": the up axis of the file, for formats that do not define an up axis.
    scale : float
        Metres per unit of the file, for formats that do not define a unit.
    options : ReadOptions
        Scene, variant, pose and treatment of materials.
    reflections : bool
        Also read metallic-roughness textures.
    lenient : bool
        Do not raise for the defects that `load_scene` lists, and store all triangles of the file in
        `Scene.source_scene`.
    allow_outside : bool
        Whether files outside the folder of the scene may be read.
    self_contained : bool
        Whether no other file is read, because the scene contains all its data.
    """

    path: Path
    data: bytes
    up: str = "y"
    scale: float = 1.0
    options: ReadOptions = AS_IN_FILE
    reflections: bool = False
    lenient: bool = False
    allow_outside: bool = False
    self_contained: bool = False

    @property
    def folder(self) -> SceneFolder:
        """Return the folder that the file names in the scene are relative to."""
        return SceneFolder(self.path.parent, self.allow_outside, self.self_contained)


Importer = Callable[[SceneFile], Scene]
IMPORTERS: Registry[Importer] = Registry("baker.io.importers")


def load_scene(
    path: Path | str,
    *,
    up: str = "y",
    scale: float = 1.0,
    options: ReadOptions = AS_IN_FILE,
    reflections: bool = False,
    lenient: bool = False,
    allow_outside: bool = False,
    self_contained: bool = False,
) -> Scene:
    """Read a scene file, and convert it to metres, +Y up and linear Rec.709.

    Parameters
    ----------
    path : Path or str
        A file with a suffix that is registered in `IMPORTERS`, or a level file (`baker.io.level`).
    up : str
        "y" or "z", the up axis of files whose format does not define an up axis. glTF is always +Y up.
    scale : float
        Metres per unit of files whose format does not define a unit. glTF is always in metres.
    options : ReadOptions
        Scene, variant, pose and treatment of materials.
    reflections : bool
        Also read metallic-roughness textures, which bakes do not use.
    lenient : bool
        Used for checks of the file. Three defects raise no error: indices out of range, negative or far too
        strong lights, and a scene without a valid triangle. `Scene.source_scene` then contains the triangles
        of the file, including invalid ones.
    allow_outside : bool
        Also read files outside the folder of the scene. If False, a reference to such a file is an error.
    self_contained : bool
        Read no file other than `path`. Used for the `scene.glb` of a bake, which contains all needed data.

    Returns
    -------
    Scene
        The scene, with at least one triangle unless `lenient`. `Scene.warnings` lists what was left out.

    Raises
    ------
    InputError
        If the file or a file that it refers to is missing, unreadable, malformed or outside the folder of the
        scene. If the scene requires an unknown extension, or contains nothing to bake.
    SettingsError
        If `up` is neither "y" nor "z", or `scale` is not a positive number. If the file has no scene,
        variant or animation of the given name.
    ResourceError
        If the scene does not fit into memory.
    """
    path = Path(path)
    if up not in ("y", "z"):
        raise SettingsError(f"`up` is neither y nor z (was {up!r})", object="up")
    if not (isinstance(scale, Real) and math.isfinite(scale) and scale > 0):
        raise SettingsError(
            f"`scale` is not a positive number of metres per unit (was {scale!r})", object="scale"
        )
    if path.suffix.lower() in LEVEL_SUFFIXES:

        def load_placed(file: Path) -> Scene:
            return load_scene(
                file,
                up=up,
                scale=scale,
                options=options,
                reflections=reflections,
                lenient=lenient,
                allow_outside=allow_outside,
            )

        return read_level(path, load_placed)
    data = read_scene_file(path)
    importer = _importer_of(path)
    if not data:
        raise InputError("the file is empty; export it again", file=str(path))
    with memory_errors(file=str(path)):
        scene = importer(
            SceneFile(path, data, up, scale, options, reflections, lenient, allow_outside, self_contained)
        )
    if not lenient:
        check_brightness(scene)
    return scene


def _importer_of(path: Path) -> Importer:
    """Return the importer for the suffix of a file."""
    importer = IMPORTERS.get(path.suffix.lower())
    if importer is None:
        known = ", ".join([*IMPORTERS.names(), LEVEL_SUFFIXES[0]])
        what = (
            f"'{path.suffix}' is not a known scene format" if path.suffix else "the file name has no suffix"
        )
        raise InputError(f"{what}; known are {known}", file=str(path))
    return importer


def load_for_bake(path: Path | str, settings: BakeSettings, *, lenient: bool = False) -> Scene:
    """Read a scene file with a bake's settings for up axis, scale and objects.

    Parameters
    ----------
    path : Path or str
        The scene file.
    settings : BakeSettings
        `up`, `scale`, `allow_outside`, `include`, `exclude`, `object`, `name_rules` and the members of
        `ReadOptions` are used.
    lenient : bool
        As in `load_scene`.

    Returns
    -------
    Scene
        The scene with the settings of its objects, without objects that are left out.

    Raises
    ------
    InputError
        As in `load_scene` and `apply_object_settings`.
    SettingsError
        As in `load_scene`.
    ResourceError
        As in `load_scene`.
    """
    scene = load_scene_as(path, settings, lenient=lenient)
    return apply_object_settings(scene, settings)


def load_scene_as(path: Path | str, settings: BakeSettings | LoadSettings, *, lenient: bool = False) -> Scene:
    """Read a scene file as settings say.

    Parameters
    ----------
    path : Path or str
        The scene file.
    settings : BakeSettings or LoadSettings
        `up`, `scale`, `allow_outside` and the members of `ReadOptions` are used.
    lenient : bool
        As in `load_scene`.

    Returns
    -------
    Scene
        All objects of the scene.

    Raises
    ------
    InputError
        As in `load_scene`.
    SettingsError
        As in `load_scene`.
    ResourceError
        As in `load_scene`.
    """
    return load_scene(
        path,
        up=settings.up,
        scale=settings.scale,
        options=ReadOptions.of(settings),
        lenient=lenient,
        allow_outside=settings.allow_outside,
    )


def read_scene_file(path: Path) -> bytes:
    """Return the content of a scene file.

    Parameters
    ----------
    path : Path
        The file.

    Returns
    -------
    bytes
        The content of the file.

    Raises
    ------
    InputError
        If there is no such file, it cannot be read, or it is not a regular file.
    """
    try:
        return read_regular(path)
    except FileNotFoundError:
        message = "the file does not exist; check its name and folder"
    except IsADirectoryError:
        message = "this is a folder; name the scene file inside it"
    except (OSError, ValueError) as error:
        message = f"the file cannot be read: {getattr(error, 'strerror', None) or error}"
    # Windows reports a folder as a permission error.
    raise InputError(
        "this is a folder; name the scene file inside it" if path.is_dir() else message, file=str(path)
    )
