"""Defines the texels that lie on surfaces, with the data of each texel that the ray stages read.

A texel buffer has n entries. Entries 0 to n_front - 1 are the front sides, one for each covered texel of the
pages. The back sides of texels that double-sided triangles cover follow. If another surface passes through a
texel, `baker.radiosity.sides` splits the texel and appends an entry for each further side. Only front entries
are stored in maps. All entries take part in light transport.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class TexelBuffer:
    """The n texel entries. Front entries are sorted by page, then in Morton order.

    Attributes
    ----------
    resolution, n_pages, n_front : int
        Side of a page in texels, number of pages, number of front entries.
    pixel : (n,) int64
        (page * resolution + row) * resolution + column; a back entry has the pixel of its front entry.
    back : (n,) bool
        Whether the entry is a back side.
    first : (n_front + 1,) int64
    entry : (m,) int32
    entry_area : (m,) float32
        Front texel k consists of the triangles entry[s] with the slice s = first[k] : first[k + 1]. These are
        the triangles of the texel's chart that touch its square. entry_area[s] are their areas inside the
        square, in texels.
    chart, instance : (n,) int32
        Indices of chart and instance.
    area : (n,) float32, m2
        Area of the triangles inside the texel, times their mean opacity.
    centroid : (n_front, 2) float32, texels
        Centroid (column, row) of the covered part of the texel's square, relative to the texel's centre.
    position : (n, 3) float32, metres, world, relative to `Geometry.origin`
        Position of the centroid on the surface.
    normal : (n, 3) float32
        Unit shading normal, world; reversed on back entries.
    albedo : (n, 3) float32, linear Rec.709
    lookup : (P * H * W,) int32
        Front entry of each pixel of the P pages. Pixels that are not covered have the entry of one of their
        eight neighbours, if one is covered, because rounding may move a hit on a chart's border to such a
        pixel. All other pixels have -1.
    back_entry : (n_front,) int32
        Entry of the back side of each front texel, or -1.
    region : (n_front,) int32
        Index of the part of the texel's chart, if other surfaces cut the chart into parts, see
        `baker.radiosity.sides`. Otherwise the index of the chart.
    """

    resolution: int
    n_pages: int
    n_front: int
    pixel: NDArray[np.int64]
    back: NDArray[np.bool_]
    first: NDArray[np.int64]
    entry: NDArray[np.int32]
    entry_area: NDArray[np.float32]
    chart: NDArray[np.int32]
    instance: NDArray[np.int32]
    area: NDArray[np.float32]
    centroid: NDArray[np.float32]
    position: NDArray[np.float32]
    normal: NDArray[np.float32]
    albedo: NDArray[np.float32]
    lookup: NDArray[np.int32]
    back_entry: NDArray[np.int32]
    region: NDArray[np.int32]

    @property
    def n(self) -> int:
        """Return the number of entries."""
        return len(self.pixel)

    def hit_image(self, value: NDArray[Any], fill: float | int = 0) -> NDArray[Any]:
        """Return (P * H * W, ...): for each pixel the value of its entry in `lookup`.

        Pixels without an entry have the value `fill`. If the buffer has entries other than front entries,
        P * H * W rows with the values of the pixels' back entries follow. Kernels index the rows with the
        result of `baker.kernels.triangle_lookup.hit_pixel`.

        value : (n, ...), values of all entries
        """
        sides = [self.lookup]
        if self.n > self.n_front:
            sides.append(np.where(self.lookup >= 0, self.back_entry[self.lookup], -1).astype(np.int32))
        entry = np.concatenate(sides)
        image = np.full((len(entry), *value.shape[1:]), fill, value.dtype)
        on = entry >= 0
        image[on] = value[entry[on]]
        return image

    def page_image(self, value: NDArray[Any], fill: float | int = 0, page: int | None = None) -> NDArray[Any]:
        """Return the values of front entries as images (P, H, W, ...), or one page as an image (H, W, ...).

        value : (m, ...) with m >= n_front; the first n_front rows are read
        fill : value of pixels without an entry
        page : index of the page to return; None for all pages
        """
        pixels = self.resolution * self.resolution
        pixel, value = self.pixel[: self.n_front], value[: self.n_front]
        n_pages = self.n_pages
        if page is not None:
            # The front texels are sorted by page.
            first, last = np.searchsorted(pixel // pixels, (page, page + 1))
            pixel, value, n_pages = pixel[first:last] - page * pixels, value[first:last], 1
        image = np.full((n_pages * pixels, *value.shape[1:]), fill, value.dtype)
        image[pixel] = value
        shape = (self.resolution, self.resolution, *value.shape[1:])
        return image.reshape(shape if page is not None else (n_pages, *shape))

    def without_hidden(self, n_pages: int) -> TexelBuffer:
        """Return the buffer without the front entries of hidden pages, which are the last front entries.

        n_pages : number of pages that are not hidden
        """
        pixels = self.resolution * self.resolution
        n_front = int(np.searchsorted(self.pixel[: self.n_front] // pixels, n_pages))
        return replace(self, n_pages=n_pages, n_front=n_front)

    def with_copies(self, entry: NDArray[np.int32]) -> TexelBuffer:
        """Return the buffer with copies of the entries `entry` (m,) appended.

        Only arrays of shape (n, ...) grow; `lookup` and `back_entry` do not refer to the copies.
        """
        names = ("pixel", "back", "chart", "instance", "area", "position", "normal", "albedo")
        longer: dict[str, Any] = {
            name: np.concatenate([getattr(self, name), getattr(self, name)[entry]]) for name in names
        }
        return replace(self, **longer)

    def without_surface(self) -> TexelBuffer:
        """Return the buffer with empty arrays for triangles, positions, normals, albedo and lookup."""
        none = np.zeros((0, 3), np.float32)
        return replace(
            self,
            entry=np.zeros(0, np.int32),
            entry_area=np.zeros(0, np.float32),
            first=np.zeros(1, np.int64),
            position=none,
            normal=none,
            albedo=none,
            lookup=np.zeros(0, np.int32),
        )
