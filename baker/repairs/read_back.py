"""Checks that a bake could read a fixed scene, before the scene is written."""

from __future__ import annotations

from pathlib import Path

from baker.core.errors import InputError, ResourceError
from baker.core.light_limits import check_brightness
from baker.io.gltf.data_ranges import range_faults
from baker.io.gltf.document import open_document
from baker.io.gltf.expand import expand_document
from baker.io.load import IMPORTERS, SceneFile, load_scene, read_scene_file
from baker.io.scene_folder import SceneFolder


def check_readable(out: Path, data: bytes, scene: Path, *, allow_outside: bool) -> None:
    """Check that a bake can read a fixed scene, and that fixing broke none of its data.

    Parameters
    ----------
    out : Path
        The file that will be written.
    data : bytes
        The content of the file, a GLB.
    scene : Path
        The scene file that was fixed.
    allow_outside : bool
        Whether the scene may refer to files outside its folder.

    Raises
    ------
    InputError
        If a defect of `scene` was not fixed and prevents a bake.
    ResourceError
        If the fixed scene cannot be read for another reason.
    """
    try:
        check_brightness(
            IMPORTERS.require(".glb", "importer")(SceneFile(out, data, allow_outside=allow_outside))
        )
        _check_ranges(out, data, scene, allow_outside=allow_outside)
    except InputError as error:
        _check_input(scene, allow_outside=allow_outside)
        what = f"{error.object}: {error.message}" if error.object else error.message
        message = f"the fixed scene cannot be read back ({what}), so nothing was written; please report this"
        raise ResourceError(message, file=str(out)) from None


def _check_ranges(out: Path, data: bytes, scene: Path, *, allow_outside: bool) -> None:
    """Raise `InputError` for the first buffer view or accessor that fixing has made unreadable."""
    faults = _faults(out, data, allow_outside)
    if faults and scene.suffix.lower() in (".glb", ".gltf"):
        # Ignore views and accessors that were unreadable before the fix. Fixing keeps their indices.
        before = _faults(scene, read_scene_file(scene), allow_outside)
        faults = {where: fault for where, fault in faults.items() if where not in before}
    for fault in faults.values():
        raise fault


def _faults(path: Path, data: bytes, allow_outside: bool) -> dict[tuple[str, int], InputError]:
    """Return the unreadable buffer views and accessors of a file."""
    document, _ = expand_document(open_document(path, data, SceneFolder(path.parent, allow_outside)))
    return range_faults(document)


def _check_input(scene: Path, *, allow_outside: bool) -> None:
    """Raise the error with which a bake refuses the scene before the fix, if there is one."""
    try:
        load_scene(scene, allow_outside=allow_outside)
    except InputError as error:
        message = f"{error.message}; this is not fixed automatically, so nothing was written"
        raise InputError(message, file=error.file, object=error.object) from None
