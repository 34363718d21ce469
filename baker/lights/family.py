"""What a family of lights without area offers to the bake, and the register of families."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from baker.core.registry import Registry
from baker.core.scene import PunctualLight


class LightFamily(Protocol):
    """Says, for points on surfaces, from where and how strongly a light shines if nothing is in the way."""

    def __call__(
        self,
        light: PunctualLight,
        origin: NDArray[np.float32],
        normal: NDArray[np.float32],
        ray: NDArray[np.float32],
        weight: NDArray[np.float32],
    ) -> None:
        """Fill `ray` and `weight`.

        Parameters
        ----------
        light : PunctualLight
        origin, normal : (n, 16, 3) float32, metres and unit, world
        ray : (n, 16, 4) float32, output
            Direction to the light and the ray's reach in units of the direction's length.
        weight : (n, 16) float32, output
            Irradiance for an intensity of 1; 0 where the light cannot shine.
        """


LIGHT_FAMILIES: Registry[LightFamily] = Registry("baker.lights.families")
