"""Chooses the material of a primitive for a variant of KHR_materials_variants.

Based on: Khronos Group, KHR_materials_variants.
"""

from __future__ import annotations

from baker.core.errors import SettingsError
from baker.core.names import unknown_name
from baker.io.gltf.document import GltfDocument
from baker.io.gltf.json import JsonObject

VARIANTS = "KHR_materials_variants"


def variant_number(document: GltfDocument, name: str | None) -> int | None:
    """Return the index of a variant.

    Parameters
    ----------
    document : GltfDocument
        The document.
    name : str or None
        Name of the variant.

    Returns
    -------
    int or None
        None if no name is given.

    Raises
    ------
    SettingsError
        If the file has no variant of that name. The message lists the names.
    """
    if name is None:
        return None
    extension = document.root.extension(VARIANTS)
    known = [v.string("name", "") for v in extension.children("variants")] if extension is not None else []
    file = document.root.file
    if not known:
        message = f"the file has no material variants (`variant` was '{name}')"
        raise SettingsError(message, file=file, object="variant")
    if name not in known:
        raise unknown_name("variant", name, known, file=file, object="variant")
    return known.index(name)


def material_of(primitive: JsonObject, variant: int | None, n_materials: int) -> int:
    """Return the index of the material of a primitive.

    Parameters
    ----------
    primitive : JsonObject
        The primitive.
    variant : int or None
        Index of the variant. Without a mapping for it, the primitive has its own material.
    n_materials : int
        Number of materials of the file.

    Returns
    -------
    int
        Index of the material; `n_materials` for the default material.
    """
    extension = primitive.extension(VARIANTS) if variant is not None else None
    for mapping in extension.children("mappings") if extension is not None else ():
        if variant in mapping.indices("variants", 2**31, "variants"):
            return mapping.index("material", n_materials, "materials")
    return primitive.index("material", n_materials, "materials") if "material" in primitive else n_materials
