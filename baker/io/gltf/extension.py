"""Defines the record that describes how one glTF extension is handled, and the registry of these records.

The importer, the reader of materials and `docs/FORMATS.md` read the registry.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from baker.core.errors import InputError
from baker.core.registry import Registry
from baker.core.scene import SceneWarning
from baker.io.gltf.document import GltfDocument
from baker.io.gltf.json import JsonObject


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
        The end of the sentence that refuses a file which requires the extension: "the file requires the
        extension NAME, ...". Empty if such files are read.
    ignored : bool
        Whether a file that uses the extension gets the warning `extension-ignored`.
    replaces_colour : bool
        Whether a material with the extension may have its base colour in the extension, so that a material
        without a base colour elsewhere gets a default albedo and a warning.
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


def register_all(names: tuple[str, ...], extension: GltfExtension) -> None:
    """Register extensions that are handled in the same way.

    Parameters
    ----------
    names : tuple of str
        Names of the extensions.
    extension : GltfExtension
        The record of all of them.
    """
    for name in names:
        EXTENSIONS.register(name)(extension)


def expand_document(document: GltfDocument) -> tuple[GltfDocument, list[SceneWarning]]:
    """Check the extensions of a document, decode its data, and expand extensions to plain glTF.

    Parameters
    ----------
    document : GltfDocument
        The document as it is in the file; its JSON may be changed in place.

    Returns
    -------
    document : GltfDocument
        The document with plain buffers and nodes.
    warnings : list of SceneWarning
        A warning for each extension that is ignored.

    Raises
    ------
    InputError
        If the file requires an extension that is not read.
    """
    warnings = check_extensions(document.root)
    known = [EXTENSIONS.require(name, "extension") for name in EXTENSIONS.names()]
    for extension in known:
        if extension.decode is not None:
            document = extension.decode(document)
    for extension in known:
        if extension.expand is not None:
            extension.expand(document)
    return document, warnings


def check_extensions(root: JsonObject) -> list[SceneWarning]:
    """Return a warning for each extension that the file uses and that is ignored.

    Parameters
    ----------
    root : JsonObject
        The document.

    Returns
    -------
    list of SceneWarning
        Warnings with the code `extension-ignored`.

    Raises
    ------
    InputError
        If the file requires an extension that is not read.
    """
    for name in root.strings("extensionsRequired"):
        extension = EXTENSIONS.get(name)
        refused = UNKNOWN if extension is None else extension.refused
        if refused:
            raise InputError(
                f"the file requires the extension {name}, {refused}", file=root.file, object=name
            )
    warnings = []
    for name in root.strings("extensionsUsed"):
        extension = EXTENSIONS.get(name)
        if extension is None or extension.ignored:
            message = f"the extension {name} is not understood and was ignored"
            warnings.append(SceneWarning("extension-ignored", message, name))
    return warnings
