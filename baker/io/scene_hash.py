"""The hash of a scene file and of all files it names, without decoding them.

The same number as `Scene.sha256`: what decides whether a bake is still that of its scene.
"""

from __future__ import annotations

import hashlib
from pathlib import Path

from baker.io.load import load_scene, read_scene_file


def scene_sha256(path: Path) -> str:
    """Return the hash over a scene file and every file it names, in order of mention.

    Parameters
    ----------
    path : Path
        A file of any format that `load_scene` reads.

    Raises
    ------
    InputError
        If the file, or one it names, is missing or unreadable, or names nothing that can be read.
    """
    suffix = path.suffix.lower()
    if suffix in (".glb", ".gltf"):
        from baker.io.gltf.document import open_document

        return open_document(path, read_scene_file(path)).sha256
    if suffix == ".obj":
        from baker.io.importers.obj import obj_sha256

        return obj_sha256(path, read_scene_file(path))
    if suffix in (".ply", ".stl", ".off"):
        return hashlib.sha256(read_scene_file(path)).hexdigest()
    # The importer alone knows what other files such a format names.
    return load_scene(path).sha256
