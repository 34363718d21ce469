"""Adds the AO pages to materials as occlusion textures, and updates `texCoord` if a uv set was renumbered.

If primitives that share a material need different pages, places or uv sets, the material is copied. Copies
are appended, so existing indices stay valid.

Based on: Khronos Group, glTF 2.0 specification, 5.19 Material; KHR_texture_transform; KHR_materials_variants.
"""

from __future__ import annotations

import copy
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from baker.core.atlas import SharedUv
from baker.io.gltf.packer import Json, Packer, is_index, objects

TEXTURE_TRANSFORM = "KHR_texture_transform"


@dataclass(frozen=True)
class BakedUse:
    """A primitive with a lightmap uv.

    Attributes
    ----------
    primitive : dict
        The primitive in the output document.
    page : int
        Page of its lightmap.
    moved : int or None
        New TEXCOORD number of the uv set that was TEXCOORD_1 in the input; None if it was not renumbered.
    shared : SharedUv or None
        Place of TEXCOORD_1 in the page, see `InstanceLayout`; None if TEXCOORD_1 is the page uv.
    """

    primitive: Json
    page: int
    moved: int | None = None
    shared: SharedUv | None = None


def add_ao_textures(packer: Packer, ao_png: dict[int, bytes]) -> dict[int, int]:
    """Embed the AO pages, given as PNG by page number, and return the texture index by page number."""
    document = packer.document
    if not ao_png:
        return {}
    samplers = document.setdefault("samplers", [])
    # Filter linearly, without mip levels, which would mix charts; clamp, since a page does not repeat.
    samplers.append({"magFilter": 9729, "minFilter": 9729, "wrapS": 33071, "wrapT": 33071})
    textures: dict[int, int] = {}
    for page, data in sorted(ao_png.items()):
        image = {"bufferView": packer.add_bytes(data), "mimeType": "image/png", "name": f"ao_{page}"}
        document.setdefault("images", []).append(image)
        texture = {"sampler": len(samplers) - 1, "source": len(document["images"]) - 1, "name": f"ao_{page}"}
        document.setdefault("textures", []).append(texture)
        textures[page] = len(document["textures"]) - 1
    return textures


def reads_texcoord_1(document: Json, primitive: Json, *, occlusion: bool) -> bool:
    """Return whether a material of the primitive has a texture that reads TEXCOORD_1.

    Parameters
    ----------
    document : dict
        glTF JSON.
    primitive : dict
        A primitive of the document.
    occlusion : bool
        Whether to include the occlusion texture; pass False if the baked AO replaces it.

    Returns
    -------
    bool
        Materials of KHR_materials_variants are included.
    """
    for holder in material_holders(primitive):
        if _names_material(document, holder.get("material")):
            material = document["materials"][holder["material"]]
            if any(_texcoord(info) == 1 for info in _texture_infos(material, occlusion=occlusion)):
                return True
    return False


def reads_texture(document: Json, primitive: Json) -> bool:
    """Return whether a material of the primitive has any texture.

    Parameters
    ----------
    document : dict
        glTF JSON.
    primitive : dict
        A primitive of the document.

    Returns
    -------
    bool
        Materials of KHR_materials_variants are included.
    """
    return any(
        next(_texture_infos(document["materials"][holder["material"]], occlusion=True), None) is not None
        for holder in material_holders(primitive)
        if _names_material(document, holder.get("material"))
    )


def assign_materials(document: Json, uses: list[BakedUse], ao_texture: dict[int, int]) -> None:
    """Add AO textures to the materials of baked primitives, and update TEXCOORD numbers.

    A material is copied if its primitives need different changes.

    Parameters
    ----------
    document : dict
        Changed in place: materials, and the `material` of baked primitives.
    uses : list of BakedUse
        All baked primitives. Other primitives keep their materials unchanged.
    ao_texture : dict of int to int
        Texture index by page; empty if AO was not baked.
    """
    baked = {id(use.primitive): use for use in uses}
    wanted: dict[int, dict[_Change, list[Json]]] = {}
    for _, mesh in objects(document, "meshes"):
        for _, primitive in objects(mesh, "primitives"):
            use = baked.get(id(primitive))
            for holder in material_holders(primitive):
                index = holder.get("material", _NONE)
                if index != _NONE and not _names_material(document, index):
                    continue
                need = _need(document, index, use, ao_texture)
                wanted.setdefault(index, {}).setdefault(need, []).append(holder)
    for index, needs in sorted(wanted.items()):
        pristine = {} if index == _NONE else copy.deepcopy(document["materials"][index])
        # Apply the first change to the material itself, unless another primitive uses it unchanged.
        free = index != _NONE and _UNCHANGED not in needs
        for need in sorted(needs.keys() - {_UNCHANGED}):
            if free:
                material, free = document["materials"][index], False
            else:
                material = copy.deepcopy(pristine)
                document.setdefault("materials", []).append(material)
                for holder in needs[need]:
                    holder["material"] = len(document["materials"]) - 1
            _apply(material, need)
            if need.transform != _WHOLE:
                use_extension(document, TEXTURE_TRANSFORM)


class _Change(NamedTuple):
    """The change of a material that a primitive needs; -1 for no change.

    Attributes
    ----------
    texture : int
        Index of the AO texture.
    moved : int
        New TEXCOORD number of the old set 1.
    transform : (float, float, float, float)
        Scale and offset of TEXCOORD_1 in the AO texture.
    """

    texture: int
    moved: int
    transform: tuple[float, ...]


_NONE = -1
_WHOLE = (1.0, 1.0, 0.0, 0.0)
_UNCHANGED = _Change(-1, -1, _WHOLE)


def use_extension(document: Json, name: str) -> None:
    """Add `name` to the `extensionsUsed` of a document, unless it is there."""
    used = document.setdefault("extensionsUsed", [])
    if name not in used:
        used.append(name)


def texture_place(scale: Sequence[float], offset: Sequence[float]) -> Json:
    """Return the `extensions` of a texture info that reads TEXCOORD_1 x `scale` + `offset`."""
    return {TEXTURE_TRANSFORM: {"offset": list(offset), "scale": list(scale)}}


def _names_material(document: Json, index: object) -> bool:
    """Return whether `index`, which may be any JSON value, is the index of a material."""
    materials = document.get("materials", [])
    return is_index(index) and index < len(materials) and isinstance(materials[index], dict)


def _need(document: Json, index: int, use: BakedUse | None, ao_texture: dict[int, int]) -> _Change:
    """Return the change of a material that a primitive needs."""
    if use is None:
        return _UNCHANGED
    texture = ao_texture.get(use.page, -1)
    transform = _WHOLE if use.shared is None or texture < 0 else (*use.shared.scale, *use.shared.offset)
    if index == _NONE or use.moved is None:
        return _Change(texture, -1, transform)
    infos = _texture_infos(document["materials"][index], occlusion=texture < 0)
    return _Change(texture, use.moved if any(_texcoord(info) == 1 for info in infos) else -1, transform)


def _apply(material: Json, change: _Change) -> None:
    texture, moved, transform = change
    if texture >= 0:
        material["occlusionTexture"] = {"index": texture, "texCoord": 1, "strength": 1.0}
        if transform != _WHOLE:
            material["occlusionTexture"]["extensions"] = texture_place(transform[:2], transform[2:])
    if moved >= 0:
        for info in _texture_infos(material, occlusion=texture < 0):
            transform = info.get("extensions", {}).get(TEXTURE_TRANSFORM, {})
            for holder in (info, transform):
                if holder.get("texCoord") == 1:
                    holder["texCoord"] = moved


def _texcoord(info: Json) -> int:
    """Return the TEXCOORD number that a texture info reads; KHR_texture_transform takes precedence."""
    transform = info.get("extensions", {}).get(TEXTURE_TRANSFORM, {})
    return int(transform.get("texCoord", info.get("texCoord", 0)))


def _texture_infos(node: Json, *, occlusion: bool) -> Iterator[Json]:
    """Yield every texture info of a material and its extensions, occlusion textures only if `occlusion`."""
    for key, value in node.items():
        if isinstance(value, dict) and key != "extras" and (occlusion or key != "occlusionTexture"):
            if isinstance(value.get("index"), int):
                yield value
            yield from _texture_infos(value, occlusion=True)


def material_holders(primitive: Json) -> Iterator[Json]:
    """Yield the objects whose `material` applies to a primitive: the primitive and its variants.

    Parameters
    ----------
    primitive : dict
        glTF JSON.

    Yields
    ------
    dict
        Objects that may have a `material`.
    """
    yield primitive
    extensions = primitive.get("extensions")
    variants = extensions.get("KHR_materials_variants") if isinstance(extensions, dict) else None
    if isinstance(variants, dict):
        yield from (mapping for _, mapping in objects(variants, "mappings"))
