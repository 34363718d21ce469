"""Builds the data of the viewer page: a JSON object, and arrays that the browser uploads to the GPU.

World-space triangles are sorted by page and material, so that the browser needs one draw call for each pair
of page and material.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import PurePath
from typing import Any

import numpy as np
from numpy.typing import NDArray

from baker.core.colour import LUMINANCE_WEIGHTS
from baker.core.geometry import Geometry, world_geometry
from baker.core.lightmap import TexelStatus
from baker.core.printable import printable
from baker.core.scene import Material, Texture
from baker.io.bake.read_bake import StoredBake
from baker.shading.materials import corner_uv, vertex_colour

# Rec.709 luminance weights of linear R, G, B.
LUMINANCE = np.array(LUMINANCE_WEIGHTS)
_TYPES = {"float32": "float", "uint32": "uint"}


@dataclass(frozen=True)
class SceneData:
    """The header, geometry and textures of a bake, as the browser receives them.

    Attributes
    ----------
    header : dict
        The content of `scene.json`.
    geometry : bytes
        All arrays, concatenated. `header["sections"]` has, by name of the array, its byte offset, number of
        rows, number of columns and type.
    images : tuple of (H, W, 4) uint8 or float32
        Textures of base colour and emission: the arrays of `Texture.image`.
    """

    header: dict[str, Any]
    geometry: bytes
    images: tuple[NDArray[Any], ...]


def scene_data(bake: StoredBake) -> SceneData:
    """Return the data of a bake for the viewer page.

    Parameters
    ----------
    bake : StoredBake
        The bake.

    Returns
    -------
    SceneData
        Header, geometry and textures.
    """
    geometry = world_geometry(bake.scene, bake.atlas)
    images: list[NDArray[Any]] = []
    order = np.lexsort((geometry.material, geometry.page))
    sections, content = _pack(_arrays(bake, geometry, order))
    position = geometry.position[np.unique(geometry.triangle)] if len(order) else np.zeros((1, 3), np.float32)
    source = str(bake.manifest.get("input", {}).get("path") or "")
    header = {
        # Use the name of the input file, because `scene.glb` has the same name in every bake.
        "name": printable(PurePath(source).stem or bake.folder.resolve().name),
        "folder": printable(str(bake.folder.resolve())),
        "input": printable(source),
        "baker": bake.manifest.get("versions", {}).get("baker", ""),
        "created": bake.manifest.get("created", ""),
        "resolution": bake.atlas.resolution,
        "pages": bake.atlas.n_pages,
        "triangles": len(geometry.triangle),
        "box": {"min": position.min(axis=0).tolist(), "max": position.max(axis=0).tolist()},
        # World position that vertex positions, the box and the camera are relative to.
        "origin": geometry.origin.tolist(),
        "camera": _camera(bake),
        "suggestedExposure": bake.manifest.get("suggested_exposure"),
        "channels": [_channel(bake, name) for name in bake.maps],
        "status": np.bincount(bake.status.ravel(), minlength=len(TexelStatus)).tolist(),
        "instances": [_instance(bake, index) for index in range(len(bake.scene.instances))],
        "materials": [_material(material, images) for material in bake.scene.materials],
        "groups": _groups(geometry, order),
        "sections": sections,
        "warnings": [warning.message for warning in bake.warnings],
    }
    header["images"] = [
        {"width": i.shape[1], "height": i.shape[0], "srgb": i.dtype == np.uint8} for i in images
    ]
    return SceneData(header, content, tuple(images))


def _arrays(bake: StoredBake, geometry: Geometry, order: NDArray[Any]) -> dict[str, NDArray[Any]]:
    materials = bake.scene.materials
    arrays: dict[str, NDArray[Any]] = {
        "position": geometry.position,
        "normal": geometry.normal,
        "pageUv": geometry.uv,
        "colourUv": corner_uv(bake.scene, geometry, [m.base_colour_texture for m in materials]),
        "emissionUv": corner_uv(bake.scene, geometry, [m.emission_texture for m in materials]),
        "colour": vertex_colour(bake.scene, geometry),
    }
    n_vertices = len(geometry.position)
    wide = {  # repeat the row of attributes that have one row for all vertices
        name: np.broadcast_to(array, (n_vertices, array.shape[1])) if len(array) == 1 else array
        for name, array in arrays.items()
    }
    return {
        **{name: np.ascontiguousarray(array, np.float32) for name, array in wide.items()},
        "triangle": np.ascontiguousarray(geometry.triangle[order], np.uint32),
        "instance": np.ascontiguousarray(geometry.instance[order, None], np.uint32),
    }


def _pack(arrays: dict[str, NDArray[Any]]) -> tuple[dict[str, Any], bytes]:
    sections: dict[str, Any] = {}
    offset = 0
    for name, array in arrays.items():
        rows, width = array.shape
        sections[name] = {"offset": offset, "rows": rows, "width": width, "type": _TYPES[array.dtype.name]}
        offset += array.nbytes
    return sections, b"".join(array.tobytes() for array in arrays.values())


def _groups(geometry: Geometry, order: NDArray[Any]) -> list[dict[str, int]]:
    page, material = geometry.page[order], geometry.material[order]
    new = np.ones(len(order), bool)
    new[1:] = (np.diff(page) != 0) | (np.diff(material) != 0)
    start = np.flatnonzero(new)
    count = np.diff(np.append(start, len(order)))
    return [
        {"page": int(page[s]), "material": int(material[s]), "start": int(s), "count": int(n)}
        for s, n in zip(start, count, strict=True)
    ]


def _instance(bake: StoredBake, index: int) -> dict[str, Any]:
    instance, layout = bake.scene.instances[index], bake.atlas.layouts[index]
    return {
        "name": printable(instance.name),
        "node": instance.node,
        "page": layout.page,
        "density": layout.texels_per_metre,
        "kept": layout.kept,
    }


def _material(material: Material, images: list[NDArray[Any]]) -> dict[str, Any]:
    def texture(used: Texture | None) -> dict[str, Any] | None:
        if used is None:
            return None
        number = next((k for k, image in enumerate(images) if image is used.image), len(images))
        if number == len(images):
            images.append(used.image)
        return {"image": number, "wrap": list(used.wrap)}

    return {
        "name": printable(material.name),
        "colour": list(material.base_colour),
        "colourMap": texture(material.base_colour_texture),
        "emission": list(material.emission),
        "emissionMap": texture(material.emission_texture),
        "doubleSided": material.double_sided,
        "alphaMode": material.alpha_mode,
        "alphaCutoff": material.alpha_cutoff,
    }


def _camera(bake: StoredBake) -> dict[str, Any] | None:
    if not bake.scene.cameras:
        return None
    camera = bake.scene.cameras[0]
    return {
        "position": list(bake.scene.to_local(camera.position)),
        "forward": list(camera.forward),
        "fov": math.degrees(camera.fov),
    }


def _channel(bake: StoredBake, name: str) -> dict[str, Any]:
    """Return a channel's name, unit, files, number of components, and percentiles at texels on surfaces.

    The percentiles 1, 50 and 99 are those of the luminance if the channel has three components, and otherwise
    those of the first component.
    """
    pages = [page for page in bake.manifest["pages"] if page["channel"] == name]
    value = bake.maps[name]
    covered = (bake.status != TexelStatus.EMPTY) & (bake.status != TexelStatus.DILATED)
    level = value[covered] @ LUMINANCE if value.shape[3] == 3 else value[covered][:, 0]
    level = level[np.isfinite(level)]
    low, median, high = np.percentile(level, (1, 50, 99)) if len(level) else (0.0, 0.0, 0.0)
    return {
        "name": name,
        "unit": pages[0].get("unit", ""),
        "files": [page["file"] for page in sorted(pages, key=lambda page: int(page["page"]))],
        "width": value.shape[3],
        "low": float(low),
        "median": float(median),
        "high": float(high),
    }
