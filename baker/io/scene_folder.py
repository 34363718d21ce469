"""The folder of a scene file, and which of the files that the scene names are read.

A scene may come from anywhere, and what it names is copied into `scene.glb`. So a name must not lead out of
the folder, unless the user allows it.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

from baker.core.errors import InputError
from baker.io.regular_file import LARGEST, read_regular


class OutsideError(InputError):
    """A scene names a file outside its folder; it is refused even if a bake does not need that file."""


class OutsideName(Exception):  # noqa: N818 - a reason, which becomes an OutsideError with file and object
    """A name leads out of the folder of the scene; the message is the reason."""


@dataclass(frozen=True)
class SceneFolder:
    """The folder that names in a scene refer to.

    Attributes
    ----------
    path : Path
        The folder.
    allow_outside : bool
        Names may lead out of the folder.
    self_contained : bool
        The scene holds all its data, as `scene.glb` of a bake does: no file that it names is read.
    """

    path: Path
    allow_outside: bool = False
    self_contained: bool = False

    def read(self, name: str, *, base: Path | None = None, most: int = LARGEST) -> bytes:
        """Return the content of a file that the scene names.

        Parameters
        ----------
        name : str
            The name as a path, relative to `base`.
        base : Path, optional
            Folder of the file in which the name stands; default: the folder of the scene.
        most : int
            A longer file is refused, bytes.

        Returns
        -------
        bytes
            The content.

        Raises
        ------
        OutsideName
            If the file, with all links followed, is not below the folder of the scene. Nothing is read, and
            the error does not depend on whether the file exists.
        OSError
            If the file is missing, unreadable, not a regular file, longer than `most`, or a Git LFS pointer.
        ValueError
            If no file can have this name.
        """
        path = (self.path if base is None else base) / name
        if self.self_contained:
            raise OSError(0, "the scene of a bake holds all its data, so no other file is read", str(path))
        if self.allow_outside:
            return read_regular(path, most=most)
        real = Path(os.path.realpath(path))
        if not real.is_relative_to(os.path.realpath(self.path)):
            raise OutsideName(
                "is outside of the scene's folder; move it into the folder, or pass `allow_outside=True`"
            )
        return read_regular(real, most=most)
