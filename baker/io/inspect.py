"""Describes the content of a scene file, an output folder or an image, as plain JSON values."""

from __future__ import annotations

import math
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from baker.core.encoding import encoding_of
from baker.core.errors import InputError
from baker.core.lightmap import TexelStatus
from baker.core.scene import Scene
from baker.core.settings import BakeSettings
from baker.io.bake.recovery import MANIFEST_NAME, recover
from baker.io.output_path import not_text
from baker.io.regular_file import read_regular

if TYPE_CHECKING:
    from baker.io.settings import LoadSettings


def inspect_path(
    path: Path | str, settings: LoadSettings | None = None, objects: BakeSettings | None = None
) -> dict[str, Any]:
    """Describe a scene file, an output folder (or its bake.json), or an image that baker can read.

    Parameters
    ----------
    path : Path or str
        A file or a folder.
    settings : LoadSettings, optional
        How a scene file is read.
    objects : BakeSettings, optional
        For a scene: list the objects with the settings that they have in a bake with these settings. The
        other contents of the scene are left out.

    Returns
    -------
    dict
        `kind` is "scene", "bake", "image" or "status" (a file such as `status_0.png`); the other keys depend
        on `kind`.

    Raises
    ------
    InputError
        If `path` does not exist, or is neither a scene nor a bake nor an image.
    """
    path = Path(path)
    if path.name == MANIFEST_NAME:
        path = path.parent
    recover(path)
    if not path.exists():
        raise InputError("there is no such file or folder", file=str(path))
    if path.is_dir():
        return _bake(path)
    if not path.is_file():
        raise InputError("it is a device, a pipe or a socket, not a regular file", file=str(path))
    if path.suffix.lower() == ".png" and (found := _status(path)) is not None:
        return found
    encoding = encoding_of(path.name)
    if encoding is not None and (why := not_text(path)):
        raise InputError(f"{why}; rename it", file=str(path))
    if encoding is not None:
        return _image(path, encoding.decode(path))
    from baker.io.load import load_scene_as
    from baker.io.settings import LoadSettings

    scene = load_scene_as(path, settings or LoadSettings())
    return _scene(path, scene) if objects is None else _objects(path, scene, objects)


def _objects(path: Path, scene: Scene, settings: BakeSettings) -> dict[str, Any]:
    """Return each object of a scene, the settings that it has in a bake, and where they come from."""
    from baker.io.object_rules import apply_object_settings

    baked = apply_object_settings(scene, settings)
    found = []
    for instance in sorted((*baked.instances, *baked.left_out), key=lambda i: i.node):
        given = instance.settings.given()
        found.append(
            {
                "node": instance.node,
                "name": instance.name,
                "baked": not instance.settings.exclude,
                "settings": given,
                "reasons": {key: instance.reasons[key] for key in given},
            }
        )
    warnings = [w for w in baked.warnings if w not in scene.warnings]
    return {
        "kind": "objects",
        "path": str(path),
        "objects": found,
        "warnings": [{"code": w.code, "message": w.message, "object": w.object} for w in warnings],
    }


def _bake(folder: Path) -> dict[str, Any]:
    """Return the main entries of a manifest, and whether each file is as baked, changed or missing."""
    from baker.io.bake.output_folder import file_state
    from baker.io.bake.read_manifest import read_manifest

    manifest = read_manifest(folder)
    files = [
        {**entry, "state": file_state(folder / entry["file"], entry["sha256"])} for entry in manifest["files"]
    ]
    settings = manifest.get("settings", {})
    return {
        "kind": "bake",
        "path": str(folder),
        "whole": all(entry["state"] == "as baked" for entry in files),
        "baker": manifest["versions"]["baker"],
        "created": manifest.get("created"),
        "input": manifest.get("input"),
        "channels": manifest.get("channels", {}),
        "pages": manifest.get("pages", []),
        "files": files,
        "instances": manifest.get("instances", []),
        "texels": sum(entry["texels"] for entry in manifest.get("instances", [])),
        "lights": manifest.get("lights", []),
        "statistics": manifest.get("statistics", {}),
        "warnings": manifest.get("warnings", []),
        "seconds": sum(v for v in manifest.get("timings", {}).values() if isinstance(v, int | float)),
        "settings": settings,
    }


def _status(path: Path) -> dict[str, Any] | None:
    """Count the texels of each status in a file such as `status_0.png`; return None for any other PNG."""
    from baker.io.png import decode_palette_png

    try:
        data = read_regular(path)
        # Recognise the file by the text chunk `Legend`, which only status images have.
        if b"tEXtLegend\x00" not in data:
            return None
        index = decode_palette_png(path)
    except (OSError, ValueError, InputError):
        return None
    count = np.bincount(index.ravel(), minlength=len(TexelStatus))
    if count[len(TexelStatus) :].any():
        return None
    height, width = index.shape
    return {
        "kind": "status",
        "path": str(path),
        "width": width,
        "height": height,
        "texels": {status.name.lower(): int(count[status]) for status in TexelStatus},
    }


def _image(path: Path, image: Any) -> dict[str, Any]:
    height, width, _ = image.pixels.shape
    channels = []
    for index, name in enumerate(image.channels):
        plane = image.pixels[:, :, index]
        finite = plane[np.isfinite(plane)]
        empty = not finite.size
        channels.append(
            {
                "channel": name,
                "min": None if empty else float(finite.min()),
                "max": None if empty else float(finite.max()),
                "mean": None if empty else float(finite.mean(dtype=np.float64)),
                "not_finite": int(plane.size - finite.size),
            }
        )
    return {
        "kind": "image",
        "path": str(path),
        "width": width,
        "height": height,
        "type": image.dtype,
        "channels": channels,
        "header": image.header,
    }


def _scene(path: Path, scene: Scene) -> dict[str, Any]:
    uses = Counter(instance.mesh for instance in scene.instances)
    low, high = _box(scene)
    return {
        "kind": "scene",
        "path": str(path),
        "name": scene.name,
        "sha256": scene.sha256,
        "triangles": scene.n_triangles,
        "box": {"min": low.tolist(), "max": high.tolist(), "diagonal": float(np.linalg.norm(high - low))},
        "meshes": [
            {
                "name": mesh.name,
                "triangles": len(mesh.triangle),
                "vertices": len(mesh.position),
                "instances": uses[index],
                "texcoords": [number for number, uv in enumerate(mesh.texcoord) if uv is not None],
                "vertex_colours": mesh.colour is not None,
            }
            for index, mesh in enumerate(scene.meshes)
        ],
        "instances": [
            {"node": i.node, "name": i.name, "mesh": i.mesh, "triangles": len(scene.meshes[i.mesh].triangle)}
            for i in scene.instances
        ],
        "materials": [
            {
                "name": m.name,
                "base_colour": list(m.base_colour),
                "base_colour_texture": m.base_colour_texture is not None,
                "emission": list(m.emission),
                "emission_texture": m.emission_texture is not None,
                "double_sided": m.double_sided,
                "alpha_mode": m.alpha_mode,
            }
            for m in scene.materials
        ],
        "lights": [
            {
                "kind": light.kind,
                "name": light.name,
                "node": light.node,
                "intensity": list(light.intensity),
                **({"range": light.range} if math.isfinite(light.range) else {}),
            }
            for light in scene.lights
        ],
        "cameras": [
            {"name": c.name, "node": c.node, "position": list(c.position), "fov": math.degrees(c.fov)}
            for c in scene.cameras
        ],
        "warnings": [{"code": w.code, "message": w.message, "object": w.object} for w in scene.warnings],
    }


def _box(scene: Scene) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the lowest and the highest world position of the used vertices, (3,) float64 each."""
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for instance in scene.instances:
        matrix = instance.world_from_object
        mesh = scene.meshes[instance.mesh]
        is_used = np.zeros(len(mesh.position), dtype=bool)
        is_used[mesh.triangle] = True
        used = mesh.position[is_used].astype(np.float64)
        world = used @ matrix[:3, :3].T + matrix[:3, 3]
        low, high = np.minimum(low, world.min(axis=0)), np.maximum(high, world.max(axis=0))
    return low, high
