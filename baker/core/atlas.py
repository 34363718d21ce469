"""Defines the atlas: the page and the lightmap uv of each instance.

A chart is a piece of surface that is connected in uv. A page is one image of the atlas.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from baker.core.result import Result
from baker.core.scene import SceneWarning


@dataclass(frozen=True, eq=False)
class SharedUv:
    """The TEXCOORD_1 that instances of a mesh share, and its place in the page of one of these instances.

    Attributes
    ----------
    number : int
        Instances with the same number share the mesh, with its TEXCOORD_1, in `scene.glb`.
    uv : (V', 2) float32
        TEXCOORD_1 of each lightmap vertex.
    scale, offset : (float, float)
        Page uv = `uv` x `scale` + `offset`, see `page_uv`.
    """

    number: int
    uv: NDArray[np.float32]
    scale: tuple[float, float]
    offset: tuple[float, float]


@dataclass(frozen=True, eq=False)
class InstanceLayout:
    """The lightmap uv of one instance. All triangles of an instance are on the same page.

    Unwrapping splits vertices at chart borders. The V' vertices after the split are called lightmap vertices.
    The mesh of the instance has T triangles.

    Attributes
    ----------
    instance : int
        Index into `Scene.instances`.
    page : int
        Index of the page, from 0.
    vertex : (V',) int32
        For each lightmap vertex, the index of the mesh vertex that it is a copy of.
    uv : (V', 2) float32
        Lightmap uv in the page, 0 to 1, with scale and offset applied; v = 0 is the first image row.
    triangle : (T, 3) int32
        Indices into the lightmap vertices. Row t is row t of `Mesh.triangle`, with the same order of corners.
    chart : (T,) int32
        Index of each triangle's chart. Charts are numbered from 0 over the whole atlas.
    kept : bool
        Whether the uv is TEXCOORD_1 of the scene file, up to scale and offset.
    texels_per_metre : float
        Mean number of texels along one metre of surface.
    receives : bool
        Whether the instance has texels in the lightmap. Otherwise its page is hidden, see `Atlas.n_hidden`.
    shared : SharedUv or None
        The TEXCOORD_1 that the instance shares with others; None if `uv` is its TEXCOORD_1.
    """

    instance: int
    page: int
    vertex: NDArray[np.int32]
    uv: NDArray[np.float32]
    triangle: NDArray[np.int32]
    chart: NDArray[np.int32]
    kept: bool
    texels_per_metre: float
    receives: bool = True
    shared: SharedUv | None = None

    @property
    def texcoord_1(self) -> NDArray[np.float32]:
        """Return the TEXCOORD_1 (V', 2) of the lightmap vertices in `scene.glb`."""
        return self.uv if self.shared is None else self.shared.uv


def page_uv(uv: NDArray[np.float32], scale: Sequence[float], offset: Sequence[float]) -> NDArray[np.float32]:
    """Return the uv in a page of a TEXCOORD_1.

    Unwrapping and the reader of `scene.glb` both call this function, so they get the same bits.

    Parameters
    ----------
    uv : (V, 2) float32
        TEXCOORD_1.
    scale, offset : sequence of two float
        Place in the page.

    Returns
    -------
    (V, 2) float32
        `uv` x `scale` + `offset`.
    """
    placed = uv.astype(np.float64) * np.asarray(scale, np.float64) + np.asarray(offset, np.float64)
    return placed.astype(np.float32)


@dataclass(frozen=True, eq=False, repr=False)
class Atlas(Result):
    """The layouts of all instances.

    Attributes
    ----------
    resolution : int
        Page width and height in texels.
    n_pages : int
        Number of pages of the lightmap.
    layouts : tuple of InstanceLayout, in the order of `Scene.instances`
    n_charts : int
    padding : int
        Number of empty texels between charts. Charts of a kept TEXCOORD_1 may be closer.
    warnings : tuple of SceneWarning
    n_hidden : int
        Number of hidden pages, whose numbers follow those of the lightmap. They contain the objects that
        reflect light and have no texels in the lightmap. They are not written.
    """

    resolution: int
    n_pages: int
    layouts: tuple[InstanceLayout, ...]
    n_charts: int
    padding: int
    warnings: tuple[SceneWarning, ...] = ()
    n_hidden: int = 0

    def summary(self) -> dict[str, Any]:
        """Return the names and values that `repr` and notebooks show."""
        return {
            "pages": f"{self.n_pages} of {self.resolution} x {self.resolution}",
            "objects": len(self.layouts),
            "charts": self.n_charts,
            "padding": self.padding,
            "warnings": len(self.warnings),
        }

    def to_dict(self) -> dict[str, Any]:
        """Return sizes, warnings and the layout of each instance without its arrays, as JSON values."""
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
