"""Reads the files that a scene refers to, and refuses files outside the folder of the scene.

A scene may come from an untrusted source, and the files that it refers to are copied into `scene.glb`.
Therefore a file outside the folder of the scene is read only if the user allows it.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

from baker.core.errors import InputError
from baker.io.regular_file import LARGEST, LARGEST_PART, read_regular


class OutsideError(InputError):
    """Raised if a scene refers to a file outside its folder, even if a bake does not need the file."""


class OutsideName(Exception):  # noqa: N818 - its callers raise an OutsideError instead
    """Raised if a file name leads outside the folder of the scene.

    The message continues a sentence about the file: "is outside of the scene's folder; ...".
    """


@dataclass(frozen=True)
class SceneFolder:
    """The folder that the file names in a scene are relative to.

    Attributes
    ----------
    path : Path
        The folder.
    allow_outside : bool
        Whether files outside the folder may be read.
    self_contained : bool
        Whether the scene contains all its data, like `scene.glb` of a bake; then no other file is read.
    """

    path: Path
    allow_outside: bool = False
    self_contained: bool = False

    def read(self, name: str, *, base: Path | None = None, first: int | None = None) -> bytes:
        """Return the content of a file that the scene refers to.

        Parameters
        ----------
        name : str
            Path of the file, relative to `base`.
        base : Path, optional
            Folder of the file that contains the name; by default the folder of the scene.
        first : int, optional
            Read at most this number of bytes, from the start of the file.

        Returns
        -------
        bytes
            The content.

        Raises
        ------
        OutsideName
            If the file, after resolving symbolic links, is not inside the folder of the scene. The error is
            the same whether the file exists or not.
        OSError
            If the file is missing, unreadable, not a regular file, a Git LFS pointer, or longer than
            `LARGEST_PART` bytes. With `first`, if more than `LARGEST` bytes would be read. Always if
            `self_contained` is True.
        ValueError
            If no file can have this name.
        """
        most = LARGEST_PART if first is None else LARGEST
        path = (self.path if base is None else base) / name
        if self.self_contained:
            raise OSError(0, "the scene of a bake holds all its data, so no other file is read", str(path))
        if self.allow_outside:
            return read_regular(path, most=most, first=first)
        real = Path(os.path.realpath(path))
        if not real.is_relative_to(os.path.realpath(self.path)):
            raise OutsideName(
                "is outside of the scene's folder; move it into the folder, or pass `allow_outside=True`"
            )
        return read_regular(real, most=most, first=first)
