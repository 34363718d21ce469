"""Decodes KTX2 files with Basis Universal textures, with the transcoder of opengl_basisu."""

from __future__ import annotations

import struct

import numpy as np
from numpy.typing import NDArray


class BasisError(Exception):
    """A texture cannot be decoded; the text of the error says why and what to do."""


def basis_size(data: bytes) -> tuple[int, int]:
    """Return the width and height that the header of a KTX2 file states, texels.

    Parameters
    ----------
    data : bytes
        The content of a KTX2 file.

    Returns
    -------
    (int, int)
        Width and height.

    Raises
    ------
    BasisError
        If the data is too short.
    """
    if len(data) < 80:
        raise BasisError("the KTX2 file is cut off")
    width, height = struct.unpack_from("<II", data, 20)
    return width, height


def decode_basis(data: bytes) -> NDArray[np.uint8]:
    """Return the largest mip level of a KTX2 file with a Basis Universal texture.

    Parameters
    ----------
    data : bytes
        The content of a KTX2 file.

    Returns
    -------
    (H, W, 4) uint8
        RGBA, row 0 at the top, values as they are stored.

    Raises
    ------
    BasisError
        If opengl_basisu is not installed, or the data is not such a texture.
    """
    try:
        import opengl_basisu
    except ImportError:
        raise BasisError(
            "KTX2 textures need the package opengl-basisu: pip install opengl-basisu, "
            "or save the texture as PNG or JPEG"
        ) from None
    try:
        image = opengl_basisu.open(data).transcode("rgba8").data
    except (ValueError, IndexError) as error:
        why = " ".join(str(error).split())[:120]
        raise BasisError(
            f"the KTX2 texture cannot be decoded ({why}); save it again as PNG or JPEG"
        ) from None
    return np.ascontiguousarray(image, np.uint8)
