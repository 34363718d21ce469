"""What an image encoding is: one file of `baker.encodings` that writes and reads one format.

Callers find an encoding by its name in `ENCODINGS` and never import it, so a new format is one new file.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from baker.core.registry import Registry


@dataclass(frozen=True)
class DecodedImage:
    """An image read back.

    Attributes
    ----------
    pixels : (H, W, C) float32, row 0 is v = 0
    header : dict of str to str, what the file says of itself
    dtype : str
        Number format in the file: "half", "float" or "uint".
    channels : tuple of str, names in the order of the last axis
    """

    pixels: NDArray[np.float32]
    header: dict[str, str]
    dtype: str
    channels: tuple[str, ...]


class Encoding(Protocol):
    """Writes and reads one image format."""

    suffix: str

    def encode(
        self, path: Path, pixels: NDArray[np.float32], *, half: bool, header: Mapping[str, str]
    ) -> int:
        """Write pixels (H, W, C) and return how many texels did not fit the format and were clipped."""

    def decode(self, path: Path) -> DecodedImage:
        """Read a file of this format."""


ENCODINGS: Registry[Encoding] = Registry("baker.encodings")
