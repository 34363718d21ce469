"""Reads level files: TOML files that place several scene files, and override lights and materials.

    [[place]]
    file = "house.glb"
    name = "north"
    at = [10, 0, 0]
    rotate = 90
    scale = 2

    [[light]]
    match = "north/Bulb"
    intensity = 800

    [[material]]
    match = "Neon*"
    emission = [0, 20, 40]

The names of objects and lights are the name of the place, `/`, and the path of the node in its file.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from baker.core.errors import InputError, SettingsError
from baker.core.names import unknown_name
from baker.core.scene import Camera, Instance, Material, Mesh, PunctualLight, Scene, SceneWarning
from baker.core.source_mesh import SourceInstance, SourceMesh, SourceScene
from baker.io.node_names import NodeNames
from baker.io.object_rules import with_extras
from baker.io.toml_file import read_toml

# Suffixes of level files.
LEVEL_SUFFIXES = (".level", ".toml")
_PLACE_KEYS = ("file", "name", "at", "rotate", "scale")
_LIGHT_KEYS = ("match", "intensity", "colour", "off")
_MATERIAL_KEYS = ("match", "base_colour", "emission", "double_sided")
_T = TypeVar("_T", PunctualLight, Material)


@dataclass(frozen=True)
class _Placement:
    """A scene file in a level, with the name and transform of the place."""

    file: Path
    name: str
    world_from_file: NDArray[np.float64]


def read_level(path: Path, load: Callable[[Path], Scene]) -> Scene:
    """Read a level file and the scenes that it places.

    Parameters
    ----------
    path : Path
        The level file. Paths of scene files are relative to its folder.
    load : callable
        Reads a scene file.

    Returns
    -------
    Scene
        All objects, lights and cameras in one scene without a source document.

    Raises
    ------
    InputError
        If the level file or a scene file is malformed.
    """
    try:
        document = read_toml(path, "the level file")
    except SettingsError as error:
        raise InputError(error.message, file=str(path)) from None
    except OSError as error:
        raise InputError(f"the file cannot be read: {error.strerror}", file=str(path)) from None
    for key in document:
        if key not in ("place", "light", "material"):
            raise unknown_name("table", key, ("place", "light", "material"), file=str(path), error=InputError)
    placements = [
        _placement(table, number, path) for number, table in enumerate(_tables(document, "place", path))
    ]
    if not placements:
        raise InputError("the level places nothing; add [[place]] with file = 'house.glb'", file=str(path))
    if len({placement.name for placement in placements}) < len(placements):
        raise InputError("two places have the same name; give them different names", file=str(path))
    loaded = {
        file: with_extras(load(file)) for file in dict.fromkeys(placement.file for placement in placements)
    }
    scene = _combined(path, placements, loaded)
    lights, more = _overridden(scene.lights, _tables(document, "light", path), _LIGHT_KEYS, path, _light)
    materials, most = _overridden(
        scene.materials, _tables(document, "material", path), _MATERIAL_KEYS, path, _material
    )
    return replace(scene, lights=lights, materials=materials, warnings=(*scene.warnings, *more, *most))


def level_files(path: Path) -> list[Path]:
    """Return the scene files that a level file places; empty if it cannot be read.

    Parameters
    ----------
    path : Path
        The level file.

    Returns
    -------
    list of Path
        The files, some of which may not exist.
    """
    try:
        placements = read_toml(path, "the level file").get("place", [])
        return [
            path.parent / str(table["file"])
            for table in placements
            if isinstance(table, dict) and "file" in table
        ]
    except (OSError, SettingsError, TypeError):
        return []


def _tables(document: Mapping[str, Any], name: str, path: Path) -> list[dict[str, Any]]:
    """Return the tables [[name]] of a level file."""
    found = document.get(name, [])
    if not isinstance(found, list) or not all(isinstance(table, dict) for table in found):
        raise InputError(
            f"'{name}' must be a list of tables, written [[{name}]]", file=str(path), object=name
        )
    return found


def _placement(table: dict[str, Any], number: int, path: Path) -> _Placement:
    """Return a place from its table."""
    label = f"place[{number}]"
    _check_keys(table, _PLACE_KEYS, path, label)
    file, name = table.get("file"), table.get("name")
    if not isinstance(file, str) or not file:
        raise InputError(
            "it needs the key 'file' with the path of a scene file", file=str(path), object=label
        )
    if Path(file).suffix.lower() in LEVEL_SUFFIXES:
        raise InputError("a level cannot place another level", file=str(path), object=label)
    if name is not None and (not isinstance(name, str) or not name):
        raise InputError("'name' is not a text", file=str(path), object=label)
    at = _numbers(table, "at", 3, (0.0, 0.0, 0.0), path, label)
    turn = _numbers(table, "rotate", 3, (0.0, 0.0, 0.0), path, label, one=lambda angle: (0.0, angle, 0.0))
    scale = _numbers(table, "scale", 3, (1.0, 1.0, 1.0), path, label, one=lambda factor: (factor,) * 3)
    if 0.0 in scale:
        raise InputError("'scale' is 0", file=str(path), object=label)
    matrix = np.eye(4)
    matrix[:3, :3] = _rotation(turn) * np.array(scale)
    matrix[:3, 3] = at
    return _Placement(path.parent / file, name or f"{Path(file).stem}_{number}", matrix)


def _rotation(degrees: Sequence[float]) -> NDArray[np.float64]:
    """Return the rotation about the axes X, then Y, then Z of the level, (3, 3)."""
    result = np.eye(3)
    for axis, angle in enumerate(np.radians(degrees)):
        turn = np.eye(3)
        first, second = (axis + 1) % 3, (axis + 2) % 3
        turn[first, first] = turn[second, second] = math.cos(angle)
        turn[second, first], turn[first, second] = math.sin(angle), -math.sin(angle)
        result = turn @ result
    return result


def _numbers(
    table: Mapping[str, Any],
    key: str,
    count: int,
    default: Sequence[float],
    path: Path,
    label: str,
    *,
    one: Callable[[float], Sequence[float]] | None = None,
) -> Sequence[float]:
    """Return finite numbers of a table; a single number is converted by `one`."""
    value = table.get(key, default)
    if isinstance(value, int | float) and not isinstance(value, bool) and one is not None:
        value = one(float(value))
    good = isinstance(value, list | tuple) and len(value) == count
    if not good or not all(
        isinstance(v, int | float) and not isinstance(v, bool) and math.isfinite(v) for v in value
    ):
        choice = f"{count} numbers" if one is None else f"a number or {count} numbers"
        raise InputError(f"'{key}' is not {choice} (was {value!r})", file=str(path), object=label)
    return [float(v) for v in value]


def _check_keys(table: Mapping[str, Any], known: Sequence[str], path: Path, label: str) -> None:
    for key in table:
        if key not in known:
            raise unknown_name("key", key, known, file=str(path), object=label, error=InputError)


def _combined(path: Path, placements: Sequence[_Placement], loaded: Mapping[Path, Scene]) -> Scene:
    """Return all places in one scene. Places of the same file share meshes and materials."""
    meshes: list[Mesh] = []
    source_meshes: list[SourceMesh] = []
    materials: list[Material] = []
    first_mesh: dict[Path, tuple[int, int]] = {}
    warnings: list[SceneWarning] = []
    for file, scene in loaded.items():
        first_mesh[file] = len(meshes), len(source_meshes)
        source_meshes += scene.source_scene.meshes if scene.source_scene is not None else ()
        meshes += [replace(mesh, material=mesh.material + np.int32(len(materials))) for mesh in scene.meshes]
        materials += scene.materials
        warnings += [replace(w, message=f"{file.name}: {w.message}") for w in scene.warnings]
        warnings += _lost(file, scene)
    instances: list[Instance] = []
    sources: list[SourceInstance] = []
    lights: list[PunctualLight] = []
    cameras: list[Camera] = []
    for placement in placements:
        scene, names = loaded[placement.file], NodeNames(loaded[placement.file])
        for i in scene.instances:
            world = placement.world_from_file @ i.world_from_object
            name = f"{placement.name}/{names.path(i.node, i.name)}"
            mesh = first_mesh[placement.file][0] + i.mesh
            instances.append(replace(i, node=len(instances), name=name, mesh=mesh, world_from_object=world))
        for shown in scene.source_scene.instances if scene.source_scene is not None else ():
            world = placement.world_from_file @ shown.world_from_object
            name = f"{placement.name}/{names.path(shown.node, shown.name)}"
            mesh = first_mesh[placement.file][1] + shown.mesh
            sources.append(SourceInstance(len(sources), name, mesh, world))
        lights += [
            _moved(light, placement, f"{placement.name}/{names.path(light.node, light.name)}")
            for light in scene.lights
        ]
        cameras += [_moved_camera(camera, placement) for camera in scene.cameras]
    hashed = hashlib.sha256(path.read_bytes())
    for scene in loaded.values():
        hashed.update(scene.sha256.encode())
    return Scene(
        name=path.name.split(".")[0],
        path=path,
        meshes=tuple(meshes),
        materials=tuple(materials),
        instances=tuple(instances),
        lights=tuple(replace(light, node=len(instances) + k) for k, light in enumerate(lights)),
        cameras=tuple(cameras),
        warnings=tuple(warnings),
        sha256=hashed.hexdigest(),
        source_scene=SourceScene(tuple(source_meshes), tuple(sources)) if source_meshes else None,
    )


def _lost(file: Path, scene: Scene) -> list[SceneWarning]:
    """Return a warning about the contents of a file that the scene.glb of a level lacks."""
    document = scene.source.json if scene.source is not None else {}
    names = [key for key in ("animations", "skins") if document.get(key)]
    if not names:
        return []
    message = f"{file.name}: {' and '.join(names)} are not copied to the scene.glb of a level"
    return [SceneWarning("level-drops", message)]


def _moved(light: PunctualLight, placement: _Placement, name: str) -> PunctualLight:
    """Return a light at a place. Like glTF lights, its intensity does not depend on the scale."""
    matrix = placement.world_from_file
    x, y, z = (matrix[:3, :3] @ np.array(light.position) + matrix[:3, 3]).tolist()
    direction = matrix[:3, :3] @ np.array(light.direction)
    dx, dy, dz = (direction / np.linalg.norm(direction)).tolist()
    return replace(light, name=name, position=(x, y, z), direction=(dx, dy, dz))


def _moved_camera(camera: Camera, placement: _Placement) -> Camera:
    """Return a camera at a place."""
    matrix = placement.world_from_file

    def turned(axis: Sequence[float]) -> tuple[float, float, float]:
        moved = matrix[:3, :3] @ np.array(axis)
        ax, ay, az = (moved / np.linalg.norm(moved)).tolist()
        return ax, ay, az

    x, y, z = (matrix[:3, :3] @ np.array(camera.position) + matrix[:3, 3]).tolist()
    return replace(
        camera,
        name=f"{placement.name}/{camera.name}",
        position=(x, y, z),
        right=turned(camera.right),
        up=turned(camera.up),
        forward=turned(camera.forward),
    )


def _overridden(
    items: tuple[_T, ...],
    tables: Sequence[dict[str, Any]],
    keys: Sequence[str],
    path: Path,
    change: Callable[[_T, Mapping[str, Any], Path, str], _T],
) -> tuple[tuple[_T, ...], list[SceneWarning]]:
    """Return lights or materials with the overrides of a level file, and warnings about patterns."""
    warnings = []
    for table in tables:
        pattern = table.get("match")
        if not isinstance(pattern, str):
            raise InputError("an override needs the key 'match' with a pattern of names", file=str(path))
        _check_keys(table, keys, path, pattern)
        matched = [fnmatchcase(item.name, pattern) for item in items]
        if not any(matched):
            warnings.append(
                SceneWarning("no-match", f"the pattern '{pattern}' of the level matches nothing", pattern)
            )
        items = tuple(
            change(item, table, path, pattern) if found else item
            for item, found in zip(items, matched, strict=True)
        )
    return items, warnings


def _light(light: PunctualLight, table: Mapping[str, Any], path: Path, label: str) -> PunctualLight:
    """Return a light with other intensity and colour; a missing one stays as in the file."""
    if table.get("off", False) is True:
        return replace(light, intensity=(0.0, 0.0, 0.0))
    if "intensity" not in table and "colour" not in table:
        return light
    level = max(light.intensity)
    colour: Sequence[float] = [v / level if level > 0 else 1.0 for v in light.intensity]
    colour = _positive(table, "colour", 3, colour, path, label)
    if "intensity" in table:
        level = _positive(table, "intensity", 1, [level], path, label)[0]
    red, green, blue = (level * v for v in colour)
    return replace(light, intensity=(red, green, blue))


def _material(material: Material, table: Mapping[str, Any], path: Path, label: str) -> Material:
    """Return a material with other factors. Textures stay, and are multiplied by the new factors."""
    red, green, blue = _positive(table, "base_colour", 3, material.base_colour[:3], path, label)
    er, eg, eb = _positive(table, "emission", 3, material.emission, path, label)
    double_sided = table.get("double_sided", material.double_sided)
    if not isinstance(double_sided, bool):
        raise InputError("'double_sided' is neither true nor false", file=str(path), object=label)
    return replace(
        material,
        base_colour=(red, green, blue, material.base_colour[3]),
        emission=(er, eg, eb),
        double_sided=double_sided,
    )


def _positive(
    table: Mapping[str, Any], key: str, count: int, default: Sequence[float], path: Path, label: str
) -> Sequence[float]:
    """Return numbers of a table that are 0 or more; a single number stands for all of them."""
    values = _numbers(table, key, count, default, path, label, one=lambda value: (value,) * count)
    if min(values) < 0.0:
        raise InputError(f"'{key}' is negative (was {table[key]!r})", file=str(path), object=label)
    return values
