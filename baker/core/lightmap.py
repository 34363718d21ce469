"""Defines the finished map of a channel, the status of texels, and the result of a bake."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from enum import IntEnum
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from baker.core.atlas import Atlas
from baker.core.result import Result
from baker.core.scene import Scene, SceneWarning

if TYPE_CHECKING:
    from baker.core.settings import BakeSettings


class TexelStatus(IntEnum):
    """Status of a texel of a page. The files `status_<page>.png` contain these values.

    An invalid texel has no valid point and is filled from other texels.
    """

    EMPTY = 0
    COVERED = 1
    DILATED = 2
    INVALID = 3
    UNCONVERGED = 4


@dataclass(frozen=True)
class ChannelDescription:
    """Meaning of the numbers of a channel.

    Attributes
    ----------
    unit : str
        Unit of the values: "lx", "1", ...
    quantity : str
        Name of the quantity, such as "irradiance".
    definition : str
        Definition of the quantity, as a formula or a phrase.
    components : tuple of str
        Names of the components in the order of the last axis of a map; they are the names of EXR channels.
        ("R", "G", "B") and ("Y",) have no layer; "L1.R" is channel R of the layer L1.
    signed : bool
        Whether values may be negative.
    colour : bool
        Whether the components are R, G and B of a linear Rec.709 colour.
    """

    unit: str
    quantity: str
    definition: str
    components: tuple[str, ...]
    signed: bool = False
    colour: bool = False

    @property
    def colour_space(self) -> str:
        """Return the name of the colour space, "none" if the components are not colours."""
        return "linear Rec.709, D65" if self.colour else "none"

    @property
    def groups(self) -> tuple[slice, ...]:
        """Return slices that divide the components into groups.

        A group is either R, G and B of one layer, or a single component. If `signed` is true, each component
        is a group.
        """
        groups, start = [], 0
        while start < len(self.components):
            three = self.components[start : start + 3]
            layer = three[0].rpartition(".")[0]
            prefix = f"{layer}." if layer else ""
            is_colour = not self.signed and three == tuple(prefix + name for name in "RGB")
            groups.append(slice(start, start + (3 if is_colour else 1)))
            start = groups[-1].stop
        return tuple(groups)


@dataclass(frozen=True, eq=False, repr=False)
class Lightmap(Result):
    """One channel of a bake.

    Attributes
    ----------
    channel : str
        "irradiance", "ao", ...
    value : (P, H, W, C) float32
        Value of component c at page p, row i and column j: `value[p, i, j, c]`. Row 0 is at v = 0.
    description : ChannelDescription
        Unit, quantity and components.
    """

    channel: str
    value: NDArray[np.float32]
    description: ChannelDescription

    @property
    def unit(self) -> str:
        """Return the unit of the values: "lx" for irradiance, "1" for AO."""
        return self.description.unit

    def summary(self) -> dict[str, Any]:
        """Return the names and values that `repr` and notebooks show."""
        pages, height, width, _ = self.value.shape
        return {
            "channel": self.channel,
            "unit": self.unit,
            "components": " ".join(self.description.components),
            "pages": f"{pages} of {width} x {height}",
        }

    def picture(self) -> NDArray[np.float32] | None:
        """Return page 0, (H, W, C), or None if C is neither 1 nor 3."""
        return self.value[0] if self.value.shape[-1] in (1, 3) else None

    def to_dict(self) -> dict[str, Any]:
        """Return channel, shape and description as JSON-serialisable values, without the texels."""
        meaning = {**asdict(self.description), "components": list(self.description.components)}
        return {"channel": self.channel, "shape": list(self.value.shape), **meaning}


@dataclass(frozen=True, eq=False, repr=False)
class BakeResult(Result):
    """The results of a bake.

    Attributes
    ----------
    lightmaps : dict of str to Lightmap
        Maps by channel.
    status : (P, H, W) uint8
        `TexelStatus` of each texel of the P pages.
    texel_count : (I,) int64
        Number of texels of each instance, in the order of `scene.instances`.
    statistics : dict of channel to {min, max, mean, clipped, invalid}
    suggested_exposure : float or None
        Factor on albedo x E / pi for a display. With this factor, the median luminance of the texels that are
        not black is 0.18 of white. It is 1 for a black bake, and None without the channel irradiance.
    timings : dict of stage to seconds
    rays : dict of stage to number of rays
    solve : dict
        Size, convergence and energy of the radiosity solution: {patches, nonzeros, iterations, residual,
        energy: {emitted, absorbed, escaped}, ...}; empty if nothing was solved.
    denoise : dict
        Name, version and filter of the denoiser; empty without denoising.
    out : Path or None
        The output folder, None if no folder was written.
    manifest : dict
        Content of `bake.json` in the output folder.
    """

    scene: Scene
    atlas: Atlas
    settings: BakeSettings
    lightmaps: dict[str, Lightmap]
    status: NDArray[np.uint8]
    texel_count: NDArray[np.int64]
    statistics: dict[str, dict[str, Any]] = field(default_factory=dict)
    suggested_exposure: float | None = None
    timings: dict[str, float] = field(default_factory=dict)
    rays: dict[str, int] = field(default_factory=dict)
    solve: dict[str, Any] = field(default_factory=dict)
    denoise: dict[str, Any] = field(default_factory=dict)
    warnings: tuple[SceneWarning, ...] = ()
    out: Path | None = None
    manifest: dict[str, Any] = field(default_factory=dict)

    def summary(self) -> dict[str, Any]:
        """Return the names and values that `repr` and notebooks show."""
        pages, height, width = self.status.shape
        rows: dict[str, Any] = {
            "pages": f"{pages} of {width} x {height}",
            "texels": int(self.texel_count.sum()),
        }
        for name, lightmap in self.lightmaps.items():
            mean = self.statistics.get(name, {}).get("mean")
            rows[name] = lightmap.unit if mean is None else f"mean {mean:.4g} {lightmap.unit}"
        rows["warnings"] = len(self.warnings)
        return rows if self.out is None else {**rows, "out": str(self.out)}

    def picture(self) -> NDArray[np.float32] | None:
        """Return the first page of the first channel, (H, W, C); None without channels."""
        return next((lightmap.value[0] for lightmap in self.lightmaps.values()), None)

    def to_dict(self) -> dict[str, Any]:
        """Return statistics, timings, rays, warnings and all keys of the manifest, as JSON values."""
        found = {
            "out": None if self.out is None else str(self.out),
            "statistics": self.statistics,
            "timings": self.timings,
            "rays": self.rays,
            "solve": self.solve,
            "denoise": self.denoise,
            "warnings": [{"code": w.code, "message": w.message, "object": w.object} for w in self.warnings],
        }
        return {**found, **self.manifest}
