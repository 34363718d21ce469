"""Defines the record that describes how one glTF extension is handled, and the registry of these records.

The importer, the reader of materials and `docs/FORMATS.md` read the registry.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from baker.core.registry import Registry
from baker.io.gltf.document import GltfDocument


@dataclass(frozen=True)
class GltfExtension:
    """How the files of one extension are read, baked and written.

    Attributes
    ----------
    read : str
        What is read of the extension, for the docs; "nothing" if it is skipped.
    used : str
        What a bake does with it, for the docs; "nothing" if it has no effect on light.
    kept : str
        What `scene.glb` contains of it, for the docs.
    refused : str
        The end of the error message "the file requires the extension NAME, ...". Empty if files that require
        the extension are read.
    ignored : bool
        Whether a file that uses the extension gets the warning `extension-ignored`.
    replaces_colour : bool
        Whether the extension may contain the base colour of a material but is not read. A material with the
        extension and without any other base colour gets a default albedo and a warning.
    decode : callable or None
        Returns the document with the data of the extension as plain buffers, before anything else is read.
    expand : callable or None
        Changes the document in place: replaces the extension by nodes and members of plain glTF.
    """

    read: str
    used: str
    kept: str = "yes"
    refused: str = ""
    ignored: bool = False
    replaces_colour: bool = False
    decode: Callable[[GltfDocument], GltfDocument] | None = None
    expand: Callable[[GltfDocument], None] | None = None


EXTENSIONS: Registry[GltfExtension] = Registry("baker.io.gltf.extensions")
UNKNOWN = "which is not understood; export without it"
