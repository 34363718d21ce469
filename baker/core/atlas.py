"""The atlas: page and lightmap uv of each instance.

A chart is a connected piece of uv; a page is one image; padding is the empty border of a chart.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from baker.core.result import Result
from baker.core.scene import SceneWarning


@dataclass(frozen=True, eq=False)
class InstanceLayout:
    """One instance's lightmap uv. An instance lies in exactly one page.

    Attributes
    ----------
    instance : int
        Index into `Scene.instances`.
    page : int
    vertex : (V',) int32
        The mesh vertex that each lightmap vertex comes from (unwrapping splits vertices at chart borders).
    uv : (V', 2) float32
        Lightmap uv in the page, 0 to 1; v = 0 is the first image row. These are the final page
        coordinates: scale and offset are already applied.
    triangle : (T, 3) int32
        Indices into the lightmap vertices; row t is the mesh's triangle t with its corner order.
    chart : (T,) int32
        Chart of each triangle, numbered from 0 over the whole atlas.
    kept : bool
        True if the uv is the input's own TEXCOORD_1, unchanged.
    texels_per_metre : float
    """

    instance: int
    page: int
    vertex: NDArray[np.int32]
    uv: NDArray[np.float32]
    triangle: NDArray[np.int32]
    chart: NDArray[np.int32]
    kept: bool
    texels_per_metre: float


@dataclass(frozen=True, eq=False, repr=False)
class Atlas(Result):
    """All instances' layouts.

    Attributes
    ----------
    resolution : int
        Page width and height in texels.
    n_pages : int
    layouts : tuple of InstanceLayout, in the order of `Scene.instances`
    n_charts : int
    warnings : tuple of SceneWarning
    """

    resolution: int
    n_pages: int
    layouts: tuple[InstanceLayout, ...]
    n_charts: int
    padding: int
    warnings: tuple[SceneWarning, ...] = ()

    def summary(self) -> dict[str, Any]:
        """Return the rows of the short text."""
        return {
            "pages": f"{self.n_pages} of {self.resolution} x {self.resolution}",
            "objects": len(self.layouts),
            "charts": self.n_charts,
            "padding": self.padding,
            "warnings": len(self.warnings),
        }

    def to_dict(self) -> dict[str, Any]:
        """Return sizes, and the page and density of each object, as plain values."""
        return {
            "resolution": self.resolution,
            "n_pages": self.n_pages,
            "n_charts": self.n_charts,
            "padding": self.padding,
            "layouts": [
                {
                    "instance": layout.instance,
                    "page": layout.page,
                    "triangles": len(layout.triangle),
                    "kept": layout.kept,
                    "texels_per_metre": float(layout.texels_per_metre),
                }
                for layout in self.layouts
            ],
            "warnings": [{"code": w.code, "message": w.message, "object": w.object} for w in self.warnings],
        }
