"""Finds the buffer views and accessors of a glTF document that cannot be read."""

from __future__ import annotations

from baker.core.errors import InputError
from baker.io.gltf.accessor import MAX_ZEROS
from baker.io.gltf.accessor_bytes import fault_of
from baker.io.gltf.document import GltfDocument
from baker.io.gltf.packer import objects


def range_faults(document: GltfDocument) -> dict[tuple[str, int], InputError]:
    """Return the errors of all buffer views and accessors that cannot be read, whether they are used or not.

    Parameters
    ----------
    document : GltfDocument
        The document.

    Returns
    -------
    dict of (str, int) to InputError
        By the name of the list ("bufferViews" or "accessors") and the index in it.
    """
    root = document.root.value
    found: dict[tuple[str, int], InputError] = {}
    for number, _ in objects(root, "bufferViews"):
        try:
            document.view(number)
        except InputError as error:
            found["bufferViews", number] = error
    for number, accessor in objects(root, "accessors"):
        count = accessor.get("count")
        if "bufferView" not in accessor and isinstance(count, int) and count > MAX_ZEROS:
            message = f"it has {count} elements but no data"
            found["accessors", number] = InputError(message, object=f"accessors[{number}]")
        elif (fault := fault_of(root, document.buffers, number, 1)) is not None:
            found["accessors", number] = fault
    return found
