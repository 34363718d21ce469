"""Reads a finished output folder: scene, lightmap uv, maps, status, manifest.

Verification, comparison, rendering, exports and the viewer use `read_bake`. They work on files and not on
arrays in memory.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from baker.core.atlas import Atlas, InstanceLayout, page_uv
from baker.core.encoding import encoding_of
from baker.core.errors import InputError, SettingsError
from baker.core.read_options import ReadOptions
from baker.core.scene import Mesh, Scene, SceneWarning
from baker.core.settings import make_settings
from baker.io.bake.output_folder import AS_BAKED, MANIFEST_NAME, file_state, is_file
from baker.io.bake.read_manifest import read_manifest
from baker.io.load import load_scene
from baker.io.object_rules import apply_recorded
from baker.io.png import decode_palette_png

SCENE_NAME = "scene.glb"


@dataclass(frozen=True)
class StoredBake:
    """A bake that was read from its output folder.

    Attributes
    ----------
    folder : Path
        The output folder.
    manifest : dict
        The content of `bake.json`.
    scene : Scene
        The objects of `scene.glb` that were baked; the sky is in `manifest["settings"]`.
    atlas : Atlas
        The lightmap uv are `TEXCOORD_1 x uv_scale + uv_offset`. Page numbers are from the manifest. All
        triangles of an instance form one chart, whose number is the index of the instance. The uv of
        instances without texels are 0.
    maps : dict of str to (P, H, W, C) float32
        For each channel, P pages of H x W texels with C components.
    status : (P, H, W) uint8, `baker.core.lightmap.TexelStatus`
    warnings : tuple of SceneWarning
        One warning for each file of the manifest that changed or disappeared since the bake.
    """

    folder: Path
    manifest: dict[str, Any]
    scene: Scene
    atlas: Atlas
    maps: dict[str, NDArray[np.float32]]
    status: NDArray[np.uint8]
    warnings: tuple[SceneWarning, ...]

    @property
    def sky(self) -> tuple[float, float, float]:
        """Return the radiance of the sky in this bake, linear RGB, cd/m2."""
        baked = self.manifest.get("settings", {})
        known = {key: baked[key] for key in ("sky", "sky_strength") if baked.get(key) is not None}
        return make_settings(known).sky_radiance

    def with_texels(self) -> StoredBake:
        """Return the bake without the instances that have no texels."""
        lit = [k for k, layout in enumerate(self.atlas.layouts) if layout.receives]
        if len(lit) == len(self.atlas.layouts):
            return self
        instances = tuple(self.scene.instances[k] for k in lit)
        layouts = tuple(replace(self.atlas.layouts[k], instance=n) for n, k in enumerate(lit))
        scene, atlas = replace(self.scene, instances=instances), replace(self.atlas, layouts=layouts)
        return replace(self, scene=scene, atlas=atlas)


def read_bake(folder: Path | str) -> StoredBake:
    """Read the output folder of a bake.

    Parameters
    ----------
    folder : Path or str
        The folder, or its `bake.json`.

    Returns
    -------
    StoredBake
        The bake.

    Raises
    ------
    InputError
        If the folder holds no bake, if a needed file is missing or unreadable, or if the manifest contradicts
        the maps or `scene.glb`.
    """
    folder = Path(folder)
    if folder.name == MANIFEST_NAME:
        folder = folder.parent
    manifest = read_manifest(folder)
    warnings = tuple(_changed(folder, entry) for entry in manifest["files"] if _differs(folder, entry))
    settings = manifest["settings"]
    scene = _scene(folder, settings)
    try:
        scene = apply_recorded(scene, manifest)
    except SettingsError as error:
        raise _damaged(folder, error) from None
    pages, rows = manifest["pages"], {row["node"]: row for row in manifest["instances"]}
    maps = {name: _pages(folder, manifest, name) for name in dict.fromkeys(p["channel"] for p in pages)}
    resolution, n_pages = pages[0]["width"], 1 + max(page["page"] for page in pages)
    layouts = tuple(
        _layout(folder, scene, index, rows.get(instance.node))
        for index, instance in enumerate(scene.instances)
    )
    padding = int(settings["padding"])
    atlas = Atlas(resolution, n_pages, layouts, len(layouts), padding)
    status = np.stack([_status(folder, page, resolution) for page in range(n_pages)])
    bake = StoredBake(folder, manifest, scene, atlas, maps, status, warnings)
    try:
        bake.sky  # noqa: B018
    except SettingsError as error:
        raise _damaged(folder, error) from None
    return bake


def _scene(folder: Path, settings: Mapping[str, Any]) -> Scene:
    """Return the scene of a bake; `settings` are those of the manifest."""
    names = [field.name for field in fields(ReadOptions)]
    try:
        known = make_settings({name: settings[name] for name in names if settings.get(name) is not None})
        options = ReadOptions.of(known)
        return load_scene(_present(folder, SCENE_NAME), options=options, self_contained=True)
    except SettingsError as error:
        raise _damaged(folder, error) from None


def _damaged(folder: Path, error: SettingsError) -> InputError:
    """Return the error for a manifest with an invalid setting."""
    why = error.message.replace("`", "")
    message = f"the manifest is damaged: {why}; bake the scene again"
    return InputError(message, file=str(folder / MANIFEST_NAME))


def _present(folder: Path, name: str) -> Path:
    path = folder / name
    if not is_file(path):
        raise InputError("this file of the bake is missing; bake the scene again", file=str(path))
    return path


def _differs(folder: Path, entry: dict[str, Any]) -> bool:
    return file_state(folder / entry["file"], str(entry["sha256"])) != AS_BAKED


def _changed(folder: Path, entry: dict[str, Any]) -> SceneWarning:
    name = str(entry["file"])
    if is_file(folder / name):
        return SceneWarning("changed-file", f"{name} is not as it was baked; it is read as it is", name)
    return SceneWarning("missing-file", f"{name} is missing", name)


def _pages(folder: Path, manifest: dict[str, Any], channel: str) -> NDArray[np.float32]:
    """Return (P, H, W, C) float32: the pages of a channel, components in the order of the manifest."""
    images = []
    pages = [page for page in manifest["pages"] if page["channel"] == channel]
    components = manifest.get("channels", {}).get(channel, {}).get("components")
    for entry in sorted(pages, key=lambda p: int(p["page"])):
        path = _present(folder, entry["file"])
        encoding = encoding_of(path.name)
        if encoding is None:
            raise InputError(f"'{path.suffix}' is not a known image format", file=str(path))
        wanted = (entry["width"], entry["height"])
        _check_size(path, encoding.size(path), wanted)
        image = encoding.decode(path)
        pixels = image.pixels
        _check_size(path, (pixels.shape[1], pixels.shape[0]), wanted)
        if components is not None and components != list(image.channels):
            if sorted(components) != sorted(image.channels):
                message = f"the map has the channels {', '.join(image.channels)}"
                raise InputError(f"{message}, the manifest says {', '.join(components)}", file=str(path))
            pixels = pixels[:, :, [image.channels.index(name) for name in components]]
        images.append(pixels)
    return np.stack(images)


def _check_size(path: Path, found: tuple[int, int] | None, wanted: tuple[int, int]) -> None:
    """Raise `InputError` if the size of a map is not (width, height) of the manifest."""
    if found is not None and found != wanted:
        message = f"the map is {found[0]} x {found[1]}, the manifest says {wanted[0]} x {wanted[1]}"
        raise InputError(message, file=str(path))


def _layout(folder: Path, scene: Scene, index: int, row: dict[str, Any] | None) -> InstanceLayout:
    instance = scene.instances[index]
    mesh = scene.meshes[instance.mesh]
    uv = mesh.texcoord[1] if len(mesh.texcoord) > 1 else None
    if not instance.settings.receive:
        return _without_texels(index, mesh)
    if row is None or uv is None:
        message = "the object has no lightmap uv or is not in the manifest; bake the scene again"
        raise InputError(message, file=str(folder / SCENE_NAME), object=instance.name)
    return InstanceLayout(
        instance=index,
        page=int(row["page"]),
        vertex=np.arange(len(mesh.position), dtype=np.int32),
        uv=page_uv(uv, row["uv_scale"], row["uv_offset"]),
        triangle=mesh.triangle,
        chart=np.full(len(mesh.triangle), index, np.int32),
        kept=row.get("uv") == "kept",
        texels_per_metre=float(row["density"]),
    )


def _without_texels(index: int, mesh: Mesh) -> InstanceLayout:
    """Return the layout of an instance that has no texels: its lightmap uv have no area."""
    n = len(mesh.position)
    return InstanceLayout(
        instance=index,
        page=0,
        vertex=np.arange(n, dtype=np.int32),
        uv=np.zeros((n, 2), np.float32),
        triangle=mesh.triangle,
        chart=np.full(len(mesh.triangle), index, np.int32),
        kept=False,
        texels_per_metre=0.0,
        receives=False,
    )


def _status(folder: Path, page: int, resolution: int) -> NDArray[np.uint8]:
    path = _present(folder, f"status_{page}.png")
    try:
        return decode_palette_png(path, resolution)
    except InputError as error:
        raise InputError(f"{error.message}; bake the scene again", file=str(path)) from None
