"""Adds the AO pages to materials as occlusion textures, and updates `texCoord` if a uv set was renumbered.

If primitives that share a material need different pages or uv sets, the material is copied. Copies are
appended, so existing indices stay valid.

Based on: Khronos Group, glTF 2.0 specification, 5.19 Material; KHR_texture_transform; KHR_materials_variants.
"""

from __future__ import annotations

import copy
from collections.abc import Iterator
from dataclasses import dataclass

from baker.io.gltf.packer import Json, Packer, is_index, objects


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
    """

    primitive: Json
    page: int
    moved: int | None = None


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
    wanted: dict[int, dict[tuple[int, int], list[Json]]] = {}
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
            _apply(material, *need)


_NONE = -1
_UNCHANGED = (-1, -1)


def _names_material(document: Json, index: object) -> bool:
    """Return whether `index`, which may be any JSON value, is the index of a material."""
    materials = document.get("materials", [])
    return is_index(index) and index < len(materials) and isinstance(materials[index], dict)


def _need(document: Json, index: int, use: BakedUse | None, ao_texture: dict[int, int]) -> tuple[int, int]:
    """Return the change of a material that a primitive needs.

    The change is (index of the AO texture, new TEXCOORD number of the old set 1), each -1 for no change.
    """
    if use is None:
        return _UNCHANGED
    texture = ao_texture.get(use.page, -1)
    if index == _NONE or use.moved is None:
        return texture, -1
    infos = _texture_infos(document["materials"][index], occlusion=texture < 0)
    return texture, use.moved if any(_texcoord(info) == 1 for info in infos) else -1


def _apply(material: Json, texture: int, moved: int) -> None:
    if texture >= 0:
        material["occlusionTexture"] = {"index": texture, "texCoord": 1, "strength": 1.0}
    if moved >= 0:
        for info in _texture_infos(material, occlusion=texture < 0):
            transform = info.get("extensions", {}).get("KHR_texture_transform", {})
            for holder in (info, transform):
                if holder.get("texCoord") == 1:
                    holder["texCoord"] = moved


def _texcoord(info: Json) -> int:
    """Return the TEXCOORD number that a texture info reads; KHR_texture_transform takes precedence."""
    transform = info.get("extensions", {}).get("KHR_texture_transform", {})
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
