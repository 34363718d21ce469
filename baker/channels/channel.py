"""The interface of channels. A channel computes a map from the results of light transport at all texels."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from baker.core.lightmap import ChannelDescription, Lightmap
from baker.core.registry import Registry

if TYPE_CHECKING:
    # Do not import these modules at run time, because code that needs no kernels also reads the registry.
    from baker.radiosity.direct import DirectLight
    from baker.radiosity.final_gather import Gathered


@dataclass(frozen=True)
class Transport:
    """Results of light transport for the n_front front texels, which are stored in the pages.

    A result that no channel needs is None.

    Attributes
    ----------
    direct : DirectLight or None
        Direct light of all texel entries; the first n_front entries are the front texels.
    gathered : Gathered or None
        Results of the final gather.
    ambient_occlusion : (n_front,) float32 or None
        Cosine-weighted share of the hemisphere without a hit within the AO distance; 1 is unoccluded.
    ao_samples : (n_front,) int32 or int
        Number of rays for each value of `ambient_occlusion`.
    gap : (n_front,) bool or None
        True for texels in a gap about a texel wide.
    """

    direct: DirectLight | None = None
    gathered: Gathered | None = None
    ambient_occlusion: NDArray[np.float32] | None = None
    ao_samples: NDArray[np.int32] | int = 0
    gap: NDArray[np.bool_] | None = None


@dataclass(frozen=True)
class Layer:
    """A part of a map that is denoised separately. A map is the sum of its layers.

    Attributes
    ----------
    value : (n_front, C) float32
        The C components of the channel at each front texel.
    error : (n_front, G), (n_front, 1) or (n_front,) float32
        Standard error of the mean of the components in each of the channel's G groups (`Channel.groups`).
        With shape (n_front, 1) or (n_front,), all groups have the same error.
    bound : bool
        Whether `error` is an upper bound, which may be several times the true error.
    kept : (n_front,) bool or None
        True for texels that are not denoised; None if all texels are denoised.
    """

    value: NDArray[np.float32]
    error: NDArray[np.float32]
    bound: bool = False
    kept: NDArray[np.bool_] | None = None

    def first(self, n: int) -> Layer:
        """Return the layer of the first `n` texels."""
        kept = None if self.kept is None else self.kept[:n]
        return replace(self, value=self.value[:n], error=self.error[:n], kept=kept)


@dataclass(frozen=True, kw_only=True)
class Channel(ChannelDescription):
    """A quantity that can be baked.

    Attributes
    ----------
    lower, upper : float
        Smallest and largest possible value. `lower` is negative for signed channels.
    needs_light : bool
        Whether `layers` reads `direct`, `gathered` and `gap` of `Transport`.
    needs_ambient_occlusion : bool
        Whether `layers` reads `ambient_occlusion` and `ao_samples` of `Transport`.
    layers : function of Transport
        Returns the layers of the map.
    """

    lower: float = 0.0
    upper: float = float("inf")
    needs_light: bool = False
    needs_ambient_occlusion: bool = False
    layers: Callable[[Transport], tuple[Layer, ...]]

    def __post_init__(self) -> None:
        """Raise ValueError if `signed` is true and `lower` is not negative, or the other way round."""
        if self.signed != (self.lower < 0.0):
            raise ValueError("a channel is signed if and only if its lower bound is negative")


CHANNELS: Registry[Channel] = Registry("baker.channels")


def chosen_channels(names: tuple[str, ...]) -> dict[str, Channel]:
    """Return the channels with the given names.

    Parameters
    ----------
    names : tuple of str
        Registered names.

    Returns
    -------
    dict of str to Channel
        Channels by name, in the order of `names`.

    Raises
    ------
    SettingsError
        If a name is not registered.
    """
    return {name: CHANNELS.require(name, "channel", setting="channels") for name in names}


def make_lightmap(name: str, value: NDArray[np.float32]) -> Lightmap:
    """Make a lightmap from pages and the description of a registered channel.

    Parameters
    ----------
    name : str
        Registered name of the channel.
    value : (P, H, W, C) float32
        P pages of C components, in the unit of the channel.

    Returns
    -------
    Lightmap
        The pages with name and description of the channel.
    """
    channel = CHANNELS.require(name, "channel", setting="channels")
    fields = {key: getattr(channel, key) for key in ChannelDescription.__dataclass_fields__}
    return Lightmap(name, value, ChannelDescription(**fields))
