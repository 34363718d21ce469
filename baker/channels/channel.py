"""What a channel is: a map that can be baked, made from the light transport of all texels."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baker.core.registry import Registry
from baker.radiosity.direct import DirectLight
from baker.radiosity.final_gather import Gathered


@dataclass(frozen=True)
class Transport:
    """What the ray stages found for the front texels; None where no channel asked for it.

    Attributes
    ----------
    direct : DirectLight or None
    gathered : Gathered or None
    open : (n_front,) float32 or None
        Cosine-weighted share of the hemisphere that is open within the AO distance.
    ao_samples : int
        Rays behind each value of `open`.
    gap : (n_front,) bool or None
        Whether a texel lies in a gap about a texel wide.
    """

    direct: DirectLight | None = None
    gathered: Gathered | None = None
    open: NDArray[np.float32] | None = None
    ao_samples: int = 0
    gap: NDArray[np.bool_] | None = None


@dataclass(frozen=True)
class Layer:
    """A part of a map that is denoised by itself; a map is the sum of its layers.

    Attributes
    ----------
    value : (n_front, C) float32
    error : (n_front,) float32
        Standard error of the mean of the C values.
    bound : bool
        Whether that is an upper bound, perhaps a loose one.
    kept : (n_front,) bool or None
        Texels that are not denoised.
    """

    value: NDArray[np.float32]
    error: NDArray[np.float32]
    bound: bool = False
    kept: NDArray[np.bool_] | None = None


@dataclass(frozen=True)
class Channel:
    """A kind of map.

    Attributes
    ----------
    unit : str
    quantity : str
        What the numbers are, for headers and docs.
    components : int
        1 or 3.
    upper : float
        Largest possible value.
    needs_light, needs_open : bool
        Which parts of `Transport` it reads.
    layers : function from `Transport` to its layers
    """

    unit: str
    quantity: str
    components: int
    upper: float
    needs_light: bool
    needs_open: bool
    layers: Callable[[Transport], tuple[Layer, ...]]


CHANNELS: Registry[Channel] = Registry("baker.channels")
