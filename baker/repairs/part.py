"""One primitive as mending sees it: what its file holds of it, byte for byte, and what may be done to it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baker.core.source_mesh import SourcePrimitive


@dataclass(frozen=True)
class Part:
    """A primitive with all that decides how it may be mended.

    Attributes
    ----------
    arrays : SourcePrimitive
        Positions, normals and triangles in numbers.
    column : dict of str to (V, B) uint8
        Every vertex attribute by its name in the file, as raw bytes of each vertex.
    double_sided : bool
        The material shows both sides.
    blends : bool
        The material is translucent: a face drawn twice covers more than one drawn once.
    reads_lightmap_uv : bool
        A texture of the material reads TEXCOORD_1.
    locked : str
        Why the primitive must stay as it is, as the end of a sentence; empty if it may be mended.
    """

    arrays: SourcePrimitive
    column: dict[str, NDArray[np.uint8]]
    double_sided: bool = False
    blends: bool = False
    reads_lightmap_uv: bool = False
    locked: str = ""
