"""The interface of channels: a channel is a map that is computed from the light transport of all texels."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from baker.core.lightmap import ChannelDescription, Lightmap
from baker.core.registry import Registry

if TYPE_CHECKING:
    # Not at run time: the registry is also read where no kernels are needed.
    from baker.radiosity.direct import DirectLight
    from baker.radiosity.final_gather import Gathered


@dataclass(frozen=True)
class Transport:
    """Results of the ray stages for the front texels; None where no channel needs them.

    Attributes
    ----------
    direct : DirectLight or None
    gathered : Gathered or None
    ambient_occlusion : (n_front,) float32 or None
        Cosine-weighted share of the hemisphere without a hit within the AO distance, 1 = open.
    ao_samples : int
        Rays per value of `ambient_occlusion`.
    gap : (n_front,) bool or None
        Texels in a gap about a texel wide.
    """

    direct: DirectLight | None = None
    gathered: Gathered | None = None
    ambient_occlusion: NDArray[np.float32] | None = None
    ao_samples: int = 0
    gap: NDArray[np.bool_] | None = None


@dataclass(frozen=True)
class Layer:
    """A part of a map that is denoised separately; a map is the sum of its layers.

    Attributes
    ----------
    value : (n_front, C) float32
    error : (n_front,) float32, or (n_front, G) float32
        Standard error of the mean of each of the channel's G groups of components (`Channel.groups`); one
        column is the error of each group. A channel of one group may leave the second axis out.
    bound : bool
        Whether that is an upper bound, perhaps a loose one.
    kept : (n_front,) bool or None
        Texels that are not denoised.
    """

    value: NDArray[np.float32]
    error: NDArray[np.float32]
    bound: bool = False
    kept: NDArray[np.bool_] | None = None


@dataclass(frozen=True, kw_only=True)
class Channel(ChannelDescription):
    """A kind of map.

    Attributes
    ----------
    lower, upper : float
        Smallest and largest possible value; `lower` is negative for signed channels.
    needs_light : bool
        Whether it reads `direct`, `gathered` and `gap` of `Transport`.
    needs_ambient_occlusion : bool
        Whether it reads `ambient_occlusion` and `ao_samples` of `Transport`.
    layers : function from `Transport` to its layers
    """

    lower: float = 0.0
    upper: float = float("inf")
    needs_light: bool = False
    needs_ambient_occlusion: bool = False
    layers: Callable[[Transport], tuple[Layer, ...]]

    def __post_init__(self) -> None:
        """Refuse bounds that contradict `signed`."""
        if self.signed != (self.lower < 0.0):
            raise ValueError("a channel is signed if and only if its lower bound is negative")


CHANNELS: Registry[Channel] = Registry("baker.channels")


def chosen_channels(names: tuple[str, ...]) -> dict[str, Channel]:
    """Look channels up.

    Parameters
    ----------
    names : tuple of str
        Registered names.

    Returns
    -------
    dict of str to Channel
        In the order of `names`.

    Raises
    ------
    SettingsError
        If there is no channel of a name.
    """
    return {name: CHANNELS.require(name, "channel", setting="channels") for name in names}


def make_lightmap(name: str, value: NDArray[np.float32]) -> Lightmap:
    """Make the map of a registered channel.

    Parameters
    ----------
    name : str
        Registered name of the channel.
    value : (P, H, W, C) float32
        Finished pages, in the unit of the channel.

    Returns
    -------
    Lightmap
        With the description of the channel.
    """
    channel = CHANNELS.require(name, "channel", setting="channels")
    fields = {key: getattr(channel, key) for key in ChannelDescription.__dataclass_fields__}
    return Lightmap(name, value, ChannelDescription(**fields))
