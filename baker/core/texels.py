"""The texels that lie on surfaces, with the data of each that the ray stages read.

Entries 0 to n_front - 1 are the texels of the pages. They are followed by the back sides of texels on
double-sided surfaces, then by further sides of texels that another surface passes through
(`radiosity.sides`): these take part in light transport but are not stored in any map.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class TexelBuffer:
    """Texels in Morton order of their pages (neighbours in the list are neighbours on the surface).

    Attributes
    ----------
    resolution, n_pages, n_front : int
    pixel : (n,) int64
        (page * resolution + row) * resolution + column; a back entry has its front's pixel.
    back : (n,) bool, True for back sides
    first : (n_front + 1,) int64, `entry` : (m,) int32, `entry_area` : (m,) float32
        Triangles that each front texel's square touches, and their areas inside it in texels.
    chart, instance : (n,) int32
    area : (n,) float32, m2 of surface inside the texel, times opacity
    centroid : (n_front, 2) float32, of that surface in the page, texels, relative to the texel's centre
    position : (n, 3) float32, metres, at that centroid
    normal : (n, 3) float32, unit, shading, flipped on back entries
    albedo : (n, 3) float32, linear Rec.709
    lookup : (P * H * W,) int32
        Entry of each pixel. Pixels just outside a chart, to which rounding may move a hit on its border, have
        the entry of a covered neighbour; all others -1.
    back_entry : (n_front,) int32, entry of the back side of each front texel, or -1
    region : (n_front,) int32
        Number of the part of its chart in which neighbouring texels see each other along the surface
        (`radiosity.sides`); the number of the chart where no other surface cuts it.
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
        """Return the number of entries, back sides included."""
        return len(self.pixel)

    def hit_image(self, value: NDArray[Any], fill: float | int = 0) -> NDArray[Any]:
        """Copy values of entries (n, ...) to the pixels (P * H * W, ...) at which `lookup` finds them.

        If there are back sides, their pixels follow, twice P * H * W rows in all. This is the order of
        `kernels.triangle_lookup.hit_pixel`. Pixels without a texel get `fill`.
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
        """Scatter values of front texels (n_front, ...) to images (P, H, W, ...), or one page (H, W, ...)."""
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

    def with_copies(self, entry: NDArray[np.int32]) -> TexelBuffer:
        """Return the buffer with copies of entries (m,) appended; `lookup` does not refer to them."""
        names = ("pixel", "back", "chart", "instance", "area", "position", "normal", "albedo")
        longer: dict[str, Any] = {
            name: np.concatenate([getattr(self, name), getattr(self, name)[entry]]) for name in names
        }
        return replace(self, **longer)

    def without_surface(self) -> TexelBuffer:
        """Return the buffer without the arrays of the ray stages: triangles, positions, normals, albedo."""
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
