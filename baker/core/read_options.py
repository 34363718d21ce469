"""Defines the options of reading a scene file that decide what the scene contains."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Self


@dataclass(frozen=True)
class ReadOptions:
    """Options of reading a scene file. Each is the setting of the same name in `BakeSettings`.

    Attributes
    ----------
    scene_name : str or None
        Name or number of the scene of a glTF file; None uses the default scene of the file.
    variant : str or None
        Name of the variant (KHR_materials_variants) whose materials are used; None uses none.
    animation : str or None
        Name or number of the animation that `time` refers to; None uses the first one.
    time : float or None
        Seconds from the start of the animation; None uses the pose that the nodes have in the file.
    missing_textures : str
        "error", or the colour of textures that cannot be read: "white", "grey" or "magenta".
    split : str
        What becomes a mesh of an OBJ file: "groups" (each object and group), "objects", or "none" (the whole
        file).
    unlit : str
        "block" or "lit": whether unlit materials only block light, or are like other materials.
    """

    scene_name: str | None = None
    variant: str | None = None
    animation: str | None = None
    time: float | None = None
    missing_textures: str = "error"
    split: str = "groups"
    unlit: str = "block"

    @classmethod
    def of(cls, settings: object) -> Self:
        """Return the options that a model of settings contains, with defaults for the others.

        Parameters
        ----------
        settings : object
            A model of settings.

        Returns
        -------
        ReadOptions
            The options.
        """
        names = (field.name for field in fields(cls))
        return cls(**{name: getattr(settings, name) for name in names if hasattr(settings, name)})


# Default options, with which the file is read as it is.
AS_IN_FILE = ReadOptions()
