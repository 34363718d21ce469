"""Writes scene.glb with light maps in its materials, by the extension MOZ_lightmap of Mozilla Hubs.

A loader shows albedo x texel x intensity / pi. The texels are E / intensity, so the numbers on the screen are
cd/m2. `intensity` is such that 99 % of the lit texels are at most 1. The texture has two pictures: a Radiance
HDR, by the extension MOZ_texture_rgbe, and for loaders without it an 8-bit linear PNG, in which the brightest
1 % are white. All pictures are in the file, because Hubs loads single files.

Hubs ignores KHR_texture_transform of a light map. Therefore each object has a mesh whose TEXCOORD_1 is the uv
in the page; instances share all other vertex data.

Based on: Mozilla Hubs, `gltf-model-plus.js` (loader) and `io_hubs_addon` (exporter); T. Aoyagi, MOZ_lightmap.
"""

from __future__ import annotations

import copy
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from baker.core.atlas import page_uv
from baker.encodings.hdr import hdr_file
from baker.exporters.common import SCENE_NAME, black_lights, decode_page, irradiance_pages, separate_meshes
from baker.exporters.unlit import exposure_for
from baker.io.gltf.accessor import read_accessor
from baker.io.gltf.ao_materials import material_holders
from baker.io.gltf.chunks import split_glb
from baker.io.gltf.document import open_document
from baker.io.gltf.packer import Json, Packer, is_index, objects
from baker.io.png import encode_png
from baker.io.scene_folder import SceneFolder

LIGHTMAP, RADIANCE = "MOZ_lightmap", "MOZ_texture_rgbe"


def lightmap_glb(bake: Path, manifest: dict[str, Any]) -> tuple[bytes, float]:
    """Return scene.glb with a light map in each material of a baked object, and the intensity.

    Materials are diffuse and have no occlusion texture, and the lights of the file are black, because the
    light maps contain occlusion and all light. Unlit materials are not changed.

    Parameters
    ----------
    bake : Path
        Folder of the bake.
    manifest : dict
        Content of bake.json.

    Returns
    -------
    tuple of bytes and float
        The GLB, and the irradiance of a texel of 1, lx.
    """
    pages = np.stack([decode_page(bake, page["file"]).pixels for page in irradiance_pages(manifest)])
    intensity = 1.0 / exposure_for(pages, pages.max(axis=-1) > 0.0) if pages.any() else 1.0
    data = (bake / SCENE_NAME).read_bytes()
    chunks = split_glb(data, SCENE_NAME)
    document: Json = json.loads(chunks.json)
    count = len(document.get("buffers", []))
    packer = Packer(
        document, (chunks.binary or b"", *[b""] * (count - 1)), missing=frozenset(range(1, count))
    )
    packer.chunks = chunks.others
    first = _add_textures(packer, pages / np.float32(intensity))
    page_of = _place_uv(packer, manifest, data)
    _add_lightmaps(document, {mesh: first + page for mesh, page in page_of.items()}, intensity)
    black_lights(document)
    used = document.setdefault("extensionsUsed", [])
    used += [name for name in (LIGHTMAP, RADIANCE) if name not in used]
    return packer.glb(), intensity


def _place_uv(packer: Packer, manifest: dict[str, Any], data: bytes) -> dict[int, int]:
    """Give each object a mesh whose TEXCOORD_1 is its uv in the page; return the page by mesh.

    data : bytes, scene.glb
    """
    document = packer.document
    source = open_document(Path(SCENE_NAME), data, SceneFolder(Path()))
    mesh_of = separate_meshes(document, manifest)
    known: dict[int, NDArray[np.float32]] = {}
    for entry in manifest["instances"]:
        scale, offset = entry["uv_scale"], entry["uv_offset"]
        if (scale, offset) == ([1.0, 1.0], [0.0, 0.0]):
            continue
        for _, primitive in objects(document["meshes"][mesh_of[entry["node"]]], "primitives"):
            number = primitive.get("attributes", {}).get("TEXCOORD_1")
            if number is None:
                continue
            if number not in known:
                known[number] = read_accessor(source, number, types=("VEC2",))
            primitive["attributes"]["TEXCOORD_1"] = packer.add_floats(page_uv(known[number], scale, offset))
    return {mesh_of[entry["node"]]: entry["page"] for entry in manifest["instances"]}


def _add_textures(packer: Packer, pages: NDArray[np.float32]) -> int:
    """Add a texture for each page, and return the index of the first."""
    document = packer.document
    samplers, images, textures = (document.setdefault(key, []) for key in ("samplers", "images", "textures"))
    # Filter linearly, without mip levels, which would mix charts; clamp, since a page does not repeat.
    samplers.append({"magFilter": 9729, "minFilter": 9729, "wrapS": 33071, "wrapT": 33071})
    first = len(textures)
    for number, page in enumerate(pages):
        levels = np.rint(np.clip(page, 0.0, 1.0) * 255.0).astype(np.uint8)
        pictures = {"image/png": encode_png(levels), "image/vnd.radiance": hdr_file(page, {})}
        for kind, data in pictures.items():
            view = packer.add_bytes(data)
            images.append({"bufferView": view, "mimeType": kind, "name": f"irradiance_{number}"})
        textures.append(
            {
                "sampler": len(samplers) - 1,
                "source": len(images) - 2,
                "name": f"irradiance_{number}",
                "extensions": {RADIANCE: {"source": len(images) - 1}},
            }
        )
    return first


def _add_lightmaps(document: Json, texture_of: Mapping[int, int], intensity: float) -> None:
    """Give the primitives of each mesh copies of their materials, with the mesh's texture as light map."""
    materials = document.setdefault("materials", [])
    copies: dict[tuple[int, int], int] = {}
    for mesh, item in objects(document, "meshes"):
        if mesh not in texture_of:
            continue
        for _, primitive in objects(item, "primitives"):
            for holder in material_holders(primitive):
                index = holder.get("material")
                # A primitive without a material has the default material of glTF, which is a metal.
                old = materials[index] if is_index(index) and index < len(materials) else {}
                if not isinstance(old, dict) or "KHR_materials_unlit" in old.get("extensions", {}):
                    continue
                key = (index if is_index(index) else -1, texture_of[mesh])
                if key not in copies:
                    copies[key] = len(materials)
                    materials.append(_lit(old, texture_of[mesh], intensity))
                holder["material"] = copies[key]


def _lit(material: Json, texture: int, intensity: float) -> Json:
    """Return a diffuse copy of a material with a light map on TEXCOORD_1."""
    lit = copy.deepcopy(material)
    lit.pop("occlusionTexture", None)
    lit.setdefault("pbrMetallicRoughness", {})["metallicFactor"] = 0.0
    lightmap = {"index": texture, "texCoord": 1, "intensity": intensity}
    lit.setdefault("extensions", {})[LIGHTMAP] = lightmap
    return lit
