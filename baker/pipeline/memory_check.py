"""Estimates the peak memory of a bake, and refuses a bake that will not fit into the free memory."""

from __future__ import annotations

from collections.abc import Mapping

from baker.channels.channel import Channel, chosen_channels
from baker.core.budget import Workload, image_bytes, surface_area, texels_and_pages
from baker.core.errors import ResourceError
from baker.core.processes import free_memory, used_memory
from baker.core.scene import Scene
from baker.core.settings import BakeSettings

_GIB = 2**30
# Smallest resolution and density that a message recommends.
_LOWEST_RESOLUTION, _LOWEST_DENSITY = 64, 0.1


def estimate_peak_of(
    scene: Scene, settings: BakeSettings, channels: Mapping[str, Channel] | None = None
) -> int:
    """Estimate the peak memory of a bake, bytes.

    Parameters
    ----------
    scene : Scene
        The scene.
    settings : BakeSettings
        Settings of the bake.
    channels : mapping of str to Channel, optional
        Channels to bake; those of the settings by default.

    Returns
    -------
    int
        The same estimate as in the finding `cost` of `baker check --cost`.
    """
    chosen = (chosen_channels(settings.channels) if channels is None else channels).values()
    area = surface_area(scene) if settings.density is not None else 0.0
    texels, pages = texels_and_pages(settings, area)
    workload = Workload(
        texels=texels,
        pages=pages,
        triangles=scene.n_triangles,
        image_bytes=image_bytes(scene),
        light=any(channel.needs_light for channel in chosen),
        ambient_occlusion=any(channel.needs_ambient_occlusion for channel in chosen),
    )
    return workload.peak_bytes(settings)


def check_memory(scene: Scene, settings: BakeSettings, channels: Mapping[str, Channel]) -> None:
    """Raise an error if the estimated memory of a bake exceeds the free memory.

    Parameters
    ----------
    scene : Scene
        The scene, which is in memory already.
    settings : BakeSettings
        Settings of the bake.
    channels : mapping of str to Channel
        Channels to bake.

    Raises
    ------
    ResourceError
        If the bake will not fit. The message has the estimate, the free memory, and the setting to lower.
    """
    need, free = estimate_peak_of(scene, settings, channels), free_memory()
    # Add the memory that this process uses already, because the estimate includes libraries and the scene.
    usable = free + used_memory()
    if need <= usable:
        return
    advice = _advice(scene, settings, channels, usable)
    message = (
        f"the bake needs about {need / _GIB:.2g} GiB of memory, and {usable / _GIB:.2g} GiB are free for it"
    )
    raise ResourceError(f"{message}; {advice}, or bake anyway with `force`", object=scene.name)


def _advice(scene: Scene, settings: BakeSettings, channels: Mapping[str, Channel], usable: int) -> str:
    """Return the setting to lower, and the value with which the bake fits if there is one, as a phrase."""
    name, lowest, value = "resolution", float(_LOWEST_RESOLUTION), float(settings.resolution)
    if settings.density is not None:
        name, lowest, value = "density", _LOWEST_DENSITY, settings.density
    while value > lowest:
        value = value // 2 if name == "resolution" else float(f"{value / 2:.2g}")
        number = int(value) if name == "resolution" else value
        if estimate_peak_of(scene, settings.changed(**{name: number}), channels) <= usable:
            return f"lower `{name}` to {value:g}"
    if settings.denoise:
        return f"lower `{name}`, turn `denoise` off or use smaller textures"
    return f"lower `{name}` or use smaller textures"
