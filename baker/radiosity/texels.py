"""Finds the texels of the atlas, the triangles in each texel, and the texel's position, normal and albedo."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from baker.core.atlas import Atlas
from baker.core.geometry import Geometry
from baker.core.parallel import run_tiles
from baker.core.progress import Progress
from baker.core.stage import Stage
from baker.core.texels import TexelBuffer
from baker.kernels.sampling import sobol_reversed
from baker.kernels.shading import Shading
from baker.kernels.surface import N_POINTS, Surface
from baker.kernels.texel_info import texel_albedo, texel_geometry
from baker.radiosity.kernels.texel_raster import keep_main_chart, list_overlaps, morton_keys

# Texels per tile.
_TILE = 4096


def build_texels(
    geometry: Geometry, shading: Shading, atlas: Atlas, *, seed: int, threads: int, progress: Progress
) -> tuple[TexelBuffer, Surface]:
    """Find the texels of all pages, and the area, position, normal and albedo of each texel.

    Parameters
    ----------
    geometry : Geometry
        Triangles with lightmap uv.
    shading : Shading
        Materials of the same triangles.
    atlas : Atlas
        Number and size of pages.
    seed : int
        Seed of the sample points in texels.
    threads : int
        Threads of this process.
    progress : Progress
        Called between tiles.

    Returns
    -------
    TexelBuffer
        Fronts first, then the backs of texels on double-sided surfaces.
    Surface
        The same entries as arrays for kernels, which compute ray origins from them.
    """
    n_pages = atlas.n_pages + atlas.n_hidden
    found = _overlaps(geometry, atlas.resolution, n_pages)
    n_front = len(found.pixel)
    front = np.concatenate([np.arange(n_front), _two_sided(geometry, found)]).astype(np.int32)
    surface = _surface(geometry, atlas, found, front, seed)
    back = surface.back
    mean = _means(geometry, shading, surface, n_front, threads, progress)
    back_entry = np.full(n_front, -1, np.int32)
    back_entry[front[n_front:]] = np.arange(n_front, len(front), dtype=np.int32)
    main = geometry.instance[found.entry[found.first[:-1]]] if n_front else np.zeros(0, np.int32)
    texels = TexelBuffer(
        resolution=atlas.resolution,
        n_pages=n_pages,
        n_front=n_front,
        pixel=surface.pixel,
        back=back,
        first=found.first,
        entry=found.entry,
        entry_area=found.area,
        chart=found.chart[front],
        instance=main[front],
        area=_with_backs(mean.area, front, back),
        centroid=mean.centroid,
        position=_with_backs(mean.position, front, back),
        normal=_with_backs(mean.normal, front, back, -1.0),
        albedo=_with_backs(mean.albedo, front, back),
        lookup=_lookup(found.pixel, atlas.resolution, n_pages),
        back_entry=back_entry,
        region=found.chart,
    )
    return texels, surface


class _Overlaps(NamedTuple):
    """The n covered texels in Morton order, and for each texel the triangles of its chart that cover it.

    pixel : (n,) int64, (page * resolution + row) * resolution + column of each texel
    first : (n + 1,) int64, texel i is covered by the triangles `entry[first[i] : first[i + 1]]`
    entry : (m,) int32, triangles
    area : (m,) float32, area of each of these triangles inside its texel, texels
    chart : (n,) int32, chart that covers the largest area of each texel
    """

    pixel: NDArray[np.int64]
    first: NDArray[np.int64]
    entry: NDArray[np.int32]
    area: NDArray[np.float32]
    chart: NDArray[np.int32]


class _Means(NamedTuple):
    """Attributes of the n_front front texels; all float32. See `kernels.texel_info`.

    area : (n_front,), m2 of surface inside the texel; centroid : (n_front, 2), texels from the texel centre
    position, normal : (n_front, 3), world; albedo : (n_front, 3)
    """

    area: NDArray[np.float32]
    centroid: NDArray[np.float32]
    position: NDArray[np.float32]
    normal: NDArray[np.float32]
    albedo: NDArray[np.float32]


def _surface(
    geometry: Geometry, atlas: Atlas, found: _Overlaps, front: NDArray[np.int32], seed: int
) -> Surface:
    """Return the n entries as arrays for kernels; `front` (n,) int32 is the front entry of each entry."""
    return Surface(
        position=geometry.position,
        normal=geometry.normal,
        uv=geometry.uv,
        triangle=geometry.triangle,
        face_normal=geometry.face_normal,
        size=atlas.resolution,
        pixel=found.pixel[front],
        front=front,
        back=np.arange(len(front)) >= len(found.pixel),
        first=found.first,
        entry=found.entry,
        entry_area=found.area,
        sobol_points=sobol_reversed(N_POINTS, seed, 7),
        min_offset_scale=np.float32(0.05 * geometry.diagonal),
    )


def _two_sided(geometry: Geometry, found: _Overlaps) -> NDArray[np.int64]:
    """Return the texels that a double-sided triangle covers, (k,) int64, ascending."""
    two_sided = np.zeros(len(found.pixel), bool)
    if geometry.double_sided.any():
        owner = np.repeat(np.arange(len(found.pixel)), np.diff(found.first))
        two_sided[owner[geometry.double_sided[found.entry]]] = True
    return np.flatnonzero(two_sided)


def _means(
    geometry: Geometry, shading: Shading, surface: Surface, n_front: int, threads: int, progress: Progress
) -> _Means:
    """Compute the attributes of all front texels."""
    area, centroid = np.zeros(n_front, np.float32), np.zeros((n_front, 2), np.float32)
    position, normal = np.zeros((n_front, 3), np.float32), np.zeros((n_front, 3), np.float32)
    scale = _metres2_per_texel(geometry, surface.size)
    every = np.full(n_front, 0xFFFF, np.uint16)
    varied = len(shading.colour) > 1 or (shading.base_texture >= 0).any() or len(shading.alpha.row) > 0
    if varied:
        albedo = np.zeros((n_front, 3), np.float32)
    else:
        albedo = _untextured_albedo(shading, surface.first, surface.entry, surface.entry_area)

    def work(begin: int, end: int) -> None:
        texel_geometry(surface, scale, begin, end, area, centroid, position, normal)
        if varied:
            texel_albedo(surface, shading, every, begin, end, albedo, area)

    run_tiles(n_front, _TILE, work, threads=threads, stage=Stage.TEXELS, progress=progress)
    return _Means(area, centroid, position, normal, albedo)


def _overlaps(geometry: Geometry, size: int, n_pages: int) -> _Overlaps:
    """Return the texels of all pages that triangles cover; a page has `size` x `size` texels."""
    at = np.zeros(n_pages * size * size, np.int64)
    nothing = np.zeros(0, np.int32), np.zeros(0, np.float32)
    list_overlaps(geometry.uv, geometry.triangle, geometry.page, size, at, *nothing)
    pixel = np.flatnonzero(at)
    pixel = pixel[np.argsort(morton_keys(pixel, size), kind="stable")]
    first = np.zeros(len(pixel) + 1, np.int64)
    np.cumsum(at[pixel], out=first[1:])
    at[pixel] = first[:-1]
    entry = np.zeros(first[-1], np.int32)
    area = np.zeros(first[-1], np.float32)
    list_overlaps(geometry.uv, geometry.triangle, geometry.page, size, at, entry, area)
    chart = np.zeros(len(pixel), np.int32)
    kept = np.zeros(len(entry), bool)
    keep_main_chart(first, entry, area, geometry.chart, chart, kept)
    before = np.zeros(len(kept) + 1, np.int64)
    np.cumsum(kept, out=before[1:])
    return _Overlaps(pixel, before[first], entry[kept], area[kept], chart)


def _untextured_albedo(
    shading: Shading, first: NDArray[np.int64], entry: NDArray[np.int32], entry_area: NDArray[np.float32]
) -> NDArray[np.float32]:
    """Return (n_front, 3) float32: the area-weighted mean base colour of each texel, if nothing is textured.

    first, entry, entry_area : see `TexelBuffer`
    """
    owner = np.repeat(np.arange(len(first) - 1), np.diff(first))
    weight = np.maximum(entry_area, 1e-9)
    total = np.bincount(owner, weight, len(first) - 1)
    colour = shading.base[shading.material[entry]]
    summed = [np.bincount(owner, weight * colour[:, c], len(first) - 1) for c in range(3)]
    return (np.stack(summed, axis=1) / total[:, None]).astype(np.float32)


def _with_backs(
    value: NDArray[np.float32], front: NDArray[np.int32], back: NDArray[np.bool_], factor: float = 1.0
) -> NDArray[np.float32]:
    """Append the values of backs, which are `factor` times the values of their fronts.

    value : (n_front, ...) float32; front (n,) int32, back (n,) bool : see `Surface`
    Returns (n, ...) float32.
    """
    if not back.any():
        return value
    return np.concatenate([value, np.float32(factor) * value[front[back]]])


def _lookup(pixel: NDArray[np.int64], size: int, n_pages: int) -> NDArray[np.int32]:
    """Return (P * H * W,) int32: the front entry of each pixel, -1 for none.

    A pixel without an entry gets the entry of a neighbour that shares an edge. If there is none, it gets the
    entry of a neighbour that shares a corner.
    """
    pages = np.full((n_pages, size + 2, size + 2), -1, np.int32)
    inner = pages[:, 1:-1, 1:-1]
    page, rest = np.divmod(pixel, size * size)
    inner[page, rest // size, rest % size] = np.arange(len(pixel), dtype=np.int32)
    covered = pages.copy()
    for down, right in ((0, 1), (1, 0), (1, 2), (2, 1), (0, 0), (0, 2), (2, 0), (2, 2)):
        beside = covered[:, down : down + size, right : right + size]
        np.copyto(inner, beside, where=(inner < 0) & (beside >= 0))
    return np.ascontiguousarray(inner).reshape(-1)


def _metres2_per_texel(geometry: Geometry, size: int) -> NDArray[np.float32]:
    """Return (T,) float32: m2 per texel of each triangle, 0 for triangles without uv area."""
    corner = geometry.uv[geometry.triangle].astype(np.float64) * size
    a, b = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
    texels = 0.5 * np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
    return np.where(texels > 1e-9, geometry.area / np.maximum(texels, 1e-9), 0.0).astype(np.float32)
