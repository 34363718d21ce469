"""Computes the hash of a scene file and the files that it refers to, if possible without loading the scene.

The hash equals `Scene.sha256`. A batch compares it with the manifest to find out whether a bake is up to
date.
"""

from __future__ import annotations

import hashlib
from pathlib import Path

from baker.io.load import load_scene, read_scene_file
from baker.io.scene_folder import SceneFolder


def scene_sha256(path: Path, *, allow_outside: bool = False) -> str:
    """Return the hash of a scene file followed by the files that it refers to.

    Parameters
    ----------
    path : Path
        A file of any format that `load_scene` reads.
    allow_outside : bool
        As in `load_scene`.

    Returns
    -------
    str
        SHA-256, hexadecimal; equal to `Scene.sha256`.

    Raises
    ------
    InputError
        If the file is missing, unreadable or malformed, or refers to a file outside the folder of the scene.
    """
    folder = SceneFolder(path.parent, allow_outside)
    suffix = path.suffix.lower()
    if suffix in (".glb", ".gltf"):
        from baker.io.gltf.document import open_document

        return open_document(path, read_scene_file(path), folder).sha256
    if suffix == ".obj":
        from baker.io.importers.obj import obj_sha256

        return obj_sha256(path, read_scene_file(path), folder)
    if suffix in (".ply", ".stl", ".off"):
        return hashlib.sha256(read_scene_file(path)).hexdigest()
    # Load scenes of other formats completely, because only their importers can list the files that they use.
    return load_scene(path, allow_outside=allow_outside).sha256
