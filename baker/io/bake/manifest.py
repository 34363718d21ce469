"""Builds `bake.json`, the manifest of a bake: its files, the page of each object, settings and versions.

Repeating a bake with the same library versions and the same folders gives an equal manifest, except for
`created` and `timings`.
"""

from __future__ import annotations

import json
import math
import os
import platform
from datetime import UTC, datetime
from importlib import metadata, resources
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from baker.core.atlas import InstanceLayout
from baker.core.light_kind import kind_of
from baker.core.lightmap import BakeResult, Lightmap
from baker.core.printable import json_text
from baker.core.scene import Instance, SceneWarning
from baker.core.version import VERSION as BAKER_VERSION

if TYPE_CHECKING:
    from baker.core.settings import BakeSettings

# Version of the manifest's layout; it changes when the name or the meaning of a key changes.
VERSION = 1

# Key in `versions` of the manifest -> installed distribution, for libraries that can change the output.
_LIBRARIES = {
    "embree": "embreex", "xatlas": "xatlas", "numba": "numba", "numpy": "numpy",
    "scipy": "scipy", "openimagedenoise": "pyoidn", "openexr": "OpenEXR", "pillow": "Pillow",
    "zstd": "backports.zstd",
}  # fmt: skip


def make_manifest(
    result: BakeResult,
    out: Path,
    *,
    pages: list[dict[str, Any]],
    files: list[dict[str, Any]],
    instance_mesh: tuple[int, ...],
    warnings: tuple[SceneWarning, ...] = (),
    created: datetime | None = None,
) -> dict[str, Any]:
    """Return the manifest of a bake as plain JSON values.

    Parameters
    ----------
    result : BakeResult
        The bake.
    out : Path
        The output folder; `input.path` in the manifest is relative to it.
    pages : list of dict
        One entry {channel, page, file, sha256, width, height, unit, clipped, ...} for each page of each
        channel.
    files : list of dict
        One entry {file, sha256} for each file of the folder except the manifest.
    instance_mesh : tuple of int
        For each instance, the index of its mesh in `scene.glb`.
    warnings : tuple of SceneWarning
        Warnings about clipping and banding in the written maps.
    created : datetime or None
        Value of `created`; None uses the current time.

    Returns
    -------
    dict
        The manifest.
    """
    moment = (created or datetime.now(UTC)).astimezone(UTC)
    manifest = {
        "version": VERSION,
        "settings": _settings(result),
        "versions": library_versions(),
        "input": {"path": _relative(result.scene.path, out), "sha256": result.scene.sha256 or None},
        "created": moment.isoformat(timespec="seconds").replace("+00:00", "Z"),
        "channels": {name: _channel(lightmap) for name, lightmap in result.lightmaps.items()},
        "pages": pages,
        "instances": _instances(result, instance_mesh),
        "objects": _objects(result),
        "lights": _lights(result),
        "timings": result.timings,
        "rays": result.rays,
        "solve": result.solve,
        "statistics": {
            channel: {
                **_statistics(result, channel),
                "clipped": sum(int(page["clipped"]) for page in pages if page["channel"] == channel),
            }
            for channel in result.lightmaps
        },
        "suggested_exposure": result.suggested_exposure,
        "warnings": _warnings(result, warnings),
        "denoise": result.denoise,
        "files": files,
    }
    values: dict[str, Any] = _plain(manifest)
    return values


def manifest_text(manifest: dict[str, Any]) -> str:
    """Return the manifest as the text of `bake.json`."""
    return json_text(manifest, indent=2) + "\n"


def manifest_schema() -> dict[str, Any]:
    """Return the JSON schema (draft 2020-12) of `bake.json`."""
    text = resources.files("baker.io.bake").joinpath("manifest_schema.json").read_text("utf-8")
    schema: dict[str, Any] = json.loads(text)
    return schema


def resolved_settings(settings: BakeSettings) -> dict[str, Any]:
    """Return all settings, with each sample count that was left at its default replaced by the number used.

    `threads` is left out because it does not affect the result.

    Parameters
    ----------
    settings : BakeSettings
        The settings of a bake.

    Returns
    -------
    dict
        Name of each setting to its value, as plain JSON.
    """
    values = settings.model_dump(mode="json", exclude={"threads"})
    samples = settings.hemisphere_samples
    values["samples"] = samples
    values["light_samples"] = settings.light_samples or samples
    values["ao_samples"] = settings.ao_samples or samples
    return values


def _channel(lightmap: Lightmap) -> dict[str, Any]:
    """Return the manifest entry of a channel: unit, quantity, components, signedness and definition."""
    keys = ("unit", "quantity", "components", "signed", "definition")
    return {key: getattr(lightmap.description, key) for key in keys}


def _settings(result: BakeResult) -> dict[str, Any]:
    metres = result.settings.ao_reach(_diagonal(result))
    return {**resolved_settings(result.settings), "ao_distance_metres": metres}


def _diagonal(result: BakeResult) -> float:
    """Return the diagonal of the box around all baked surfaces, metres."""
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for instance, layout in zip(result.scene.instances, result.atlas.layouts, strict=True):
        matrix = instance.world_from_object
        vertex = np.unique(layout.vertex[layout.triangle])
        local = result.scene.meshes[instance.mesh].position[vertex].astype(np.float64)
        world = (local @ matrix[:3, :3].T + matrix[:3, 3]).astype(np.float32)
        if len(world):
            low, high = np.minimum(low, world.min(axis=0)), np.maximum(high, world.max(axis=0))
    return float(np.linalg.norm(high - low)) if np.isfinite(low).all() else 0.0


def library_versions() -> dict[str, str | None]:
    """Return the versions of baker, Python and the libraries that can change the output of a bake.

    Returns
    -------
    dict of str to str or None
        Name to version; None if the library is not installed.
    """
    versions: dict[str, str | None] = {}
    for name, distribution in _LIBRARIES.items():
        try:
            versions[name] = metadata.version(distribution)
        except metadata.PackageNotFoundError:
            versions[name] = None
    return {"baker": BAKER_VERSION, "python": platform.python_version(), **versions}


def _relative(path: Path | None, out: Path) -> str | None:
    if path is None:
        return None
    try:
        relative = Path(os.path.relpath(path.resolve(), out.resolve())).as_posix()
    except ValueError:
        # On Windows there is no relative path from one drive to another.
        relative = path.resolve().as_posix()
    # A name that is not text has no other form in JSON.
    return relative.encode("utf-8", "backslashreplace").decode()


def _instances(result: BakeResult, instance_mesh: tuple[int, ...]) -> list[dict[str, Any]]:
    rows = zip(result.scene.instances, result.atlas.layouts, instance_mesh, result.texel_count, strict=True)
    return [
        {
            "node": instance.node,
            "name": instance.name,
            "mesh": mesh,
            "page": layout.page,
            "uv_offset": [0.0, 0.0] if layout.shared is None else list(layout.shared.offset),
            "uv_scale": [1.0, 1.0] if layout.shared is None else list(layout.shared.scale),
            "texels": texels,
            "density": layout.texels_per_metre,
            **_density_loss(result, instance, layout),
            "uv": "kept" if layout.kept else "unwrapped",
        }
        for instance, layout, mesh, texels in rows
        if instance.settings.receive
    ]


def _density_loss(result: BakeResult, instance: Instance, layout: InstanceLayout) -> dict[str, float]:
    """Return the lost share of the density that was asked for, 0 to 1, if a density was asked for."""
    asked = instance.settings.texels_per_metre
    if asked is None and result.settings.density is not None:
        asked = result.settings.density * instance.settings.density_factor
    if asked is None or result.settings.budget is None:
        return {}
    return {"density_loss": round(max(0.0, 1.0 - layout.texels_per_metre / asked), 6)}


def _objects(result: BakeResult) -> list[dict[str, Any]]:
    """Return the settings of all objects that have any, and where they come from, ordered by node."""
    rows = [
        {
            "node": i.node,
            "name": i.name,
            "settings": given,
            "reasons": {key: i.reasons[key] for key in given if key in i.reasons},
        }
        for i in (*result.scene.instances, *result.scene.left_out)
        if (given := i.settings.given())
    ]
    return sorted(rows, key=lambda row: row["node"])


def _lights(result: BakeResult) -> list[dict[str, Any]]:
    """List the punctual lights, the materials in use that emit light, and the sky if it is not black."""
    lights: list[dict[str, Any]] = []
    for light in result.scene.lights:
        kind = kind_of(light)
        entry: dict[str, Any] = {"kind": light.kind, "name": light.name, "node": light.node}
        entry["intensity"] = light.intensity
        entry["unit"] = kind.unit
        entry |= kind.describe(light)
        lights.append(entry)
    used = {int(m) for i in result.scene.instances for m in np.unique(result.scene.meshes[i.mesh].material)}
    for index in sorted(used):
        material = result.scene.materials[index]
        if any(material.emission):
            number = index if material.original is None else material.original
            entry = {"kind": "emissive", "name": material.name, "material": number}
            lights.append({**entry, "radiance": material.emission, "unit": "cd/m2"})
    if any(result.settings.sky_radiance):
        sky = {"kind": "sky", "name": "sky", "radiance": result.settings.sky_radiance, "unit": "cd/m2"}
        lights.append(sky)
    return lights


def _statistics(result: BakeResult, channel: str) -> dict[str, Any]:
    """Return a channel's entry of `result.statistics`, or compute it without the empty and dilated texels."""
    if channel in result.statistics:
        return result.statistics[channel]
    covered = np.isin(result.status, (1, 3, 4))
    value = result.lightmaps[channel].value[covered]
    range_and_mean = (
        {"min": value.min(), "max": value.max(), "mean": value.mean(dtype=np.float64)} if value.size else {}
    )
    return {
        "min": 0.0,
        "max": 0.0,
        "mean": 0.0,
        **range_and_mean,
        "clipped": 0,
        "invalid": (result.status == 3).sum(),
    }


def _warnings(result: BakeResult, more: tuple[SceneWarning, ...]) -> list[dict[str, str]]:
    found = [*result.scene.warnings, *result.atlas.warnings, *result.warnings, *more]
    return [{"code": w.code, "message": w.message, "object": w.object} for w in dict.fromkeys(found)]


def _plain(value: Any) -> Any:
    """Return `value` in plain JSON types: numbers that are not finite become null, other objects strings."""
    if isinstance(value, dict):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, np.ndarray):
        return _plain(value.tolist())
    if isinstance(value, np.generic):
        return _plain(value.item())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if value is None or isinstance(value, bool | int | str):
        return value
    return str(value)
