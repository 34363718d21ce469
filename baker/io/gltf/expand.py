"""Checks the extensions of a document, and replaces extensions by plain glTF before the document is read."""

from __future__ import annotations

from baker.core.errors import InputError
from baker.core.scene import SceneWarning
from baker.io.gltf.document import GltfDocument
from baker.io.gltf.extension import UNKNOWN
from baker.io.gltf.json import JsonObject
from baker.io.gltf.known_extensions import extension_of, known_extensions


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
    known = known_extensions().values()
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
        extension = extension_of(name)
        refused = UNKNOWN if extension is None else extension.refused
        if refused:
            raise InputError(
                f"the file requires the extension {name}, {refused}", file=root.file, object=name
            )
    warnings = []
    for name in root.strings("extensionsUsed"):
        extension = extension_of(name)
        if extension is None or extension.ignored:
            message = f"the extension {name} is not understood and was ignored"
            warnings.append(SceneWarning("extension-ignored", message, name))
    return warnings
