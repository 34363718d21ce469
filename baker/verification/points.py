"""Chooses the points at which a bake is compared.

These are random texels, outliers (texels that differ from all their neighbours), texels with the largest
gradients of light, points at edges, and additional texels of light levels with few random texels.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from baker.core.errors import InputError
from baker.core.geometry import Geometry
from baker.core.lightmap import TexelStatus
from baker.io.bake.read_bake import StoredBake
from baker.metrics.outliers import outlier_texels, steep_texels
from baker.metrics.sample_texels import choose_texels, scarce_texels
from baker.metrics.texel_area import SurfacePoints, instance_map, one_surface_point, surface_points
from baker.pathtracer.scene import Reference
from baker.verification.edges import edge_points
from baker.verification.settings import VerifySettings
from baker.verification.surroundings import find_surroundings

# Kinds of points, see `Points.kind`.
TEXEL, OUTLIER, STEEP, EDGE, SCARCE = 0, 1, 2, 3, 4
# Number of surface points at which the light of a texel is measured.
POINTS_PER_TEXEL = 64
# Numbers of points divided by the number of random texels: points at edges; outliers of each channel; steep
# texels of each channel.
_EDGES, _OUTLIERS, _STEEP = 0.35, 0.05, 0.1
# Smallest number of points at edges, unless `_EDGES` gives more.
_MIN_EDGES = 500
# Smallest number of texels in each light level (if it has as many), divided by the number of random texels.
_SCARCE = 0.1


@dataclass(frozen=True)
class Points:
    """The n compared points, each a texel or a point at an edge.

    Attributes
    ----------
    kind : (n,) int8
        TEXEL: random texel. OUTLIER: texel that differs from all its neighbours. STEEP: texel with a large
        gradient of light. EDGE: point at an edge. SCARCE: additional texel of a light level with few texels.
        Random texels come first.
    pixel : (n,) int64
        Texel of each point, (page * H + row) * W + column.
    owner, chart, room : (n,) int32
        Indices of object, chart and room; -1 for none. `baker.verification.surroundings` defines rooms.
    gap : (n,) bool
        Whether the point is in a narrow gap or inside geometry.
    valid_share : (n,) float64
        Share of the surface points that are valid.
    texel_area : (n,) float64, m2
        Area of the object's surface that a random texel represents; 0 for other kinds of points.
    surface : SurfacePoints
        The surface points at which the light of each point is path-traced. The map is looked up at
        `surface.offset` from the texel's centre.
    """

    kind: NDArray[np.int8]
    pixel: NDArray[np.int64]
    owner: NDArray[np.int32]
    chart: NDArray[np.int32]
    room: NDArray[np.int32]
    gap: NDArray[np.bool_]
    valid_share: NDArray[np.float64]
    texel_area: NDArray[np.float64]
    surface: SurfacePoints

    @property
    def position(self) -> NDArray[np.float64]:
        """Return (n, 3) float64, metres: the mean of each point's surface points, relative to the origin."""
        middle: NDArray[np.float64] = self.surface.position.mean(axis=1)
        return middle


@dataclass(frozen=True)
class Pages:
    """The texels of all pages.

    Attributes
    ----------
    owner : (P, H, W) int32
        Object whose triangle covers the largest area of each texel, -1 for none.
    covered : (P, H, W) bool
        Texels with a measured value.
    """

    owner: NDArray[np.int32]
    covered: NDArray[np.bool_]


def read_pages(bake: StoredBake, geometry: Geometry, names: list[str]) -> Pages:
    """Return the object on each texel, and the texels with a measured value.

    Raises
    ------
    InputError
        If pages of a channel are missing, or no texel with a measured value lies on a surface.
    """
    owner = instance_map(geometry, bake.atlas.n_pages, bake.atlas.resolution)
    if any(bake.maps[name].shape[:3] != owner.shape for name in names):
        raise InputError("the bake lacks pages of a channel; bake the scene again", file=str(bake.folder))
    covered = np.isin(bake.status, (TexelStatus.COVERED, TexelStatus.UNCONVERGED))
    if not (covered & (owner >= 0)).any():
        raise InputError(
            "no texel of the bake lies on a surface; bake the scene again", file=str(bake.folder)
        )
    return Pages(owner, covered)


def choose_points(
    reference: Reference,
    bake: StoredBake,
    geometry: Geometry,
    pages: Pages,
    names: list[str],
    settings: VerifySettings,
) -> tuple[Points, NDArray[np.float64]]:
    """Choose the n points to compare and find their rooms and gaps.

    Returns the points, and (m, 3) float64, metres: points in the air, see `baker.verification.surroundings`.
    """
    size, seed = bake.atlas.resolution, settings.seed
    owner, covered = pages.owner.reshape(-1), pages.covered.reshape(-1)
    brightness = bake.maps[names[0]].mean(axis=3, dtype=np.float64).reshape(-1)
    texel = choose_texels(owner, covered, brightness, settings.texels, seed)
    outlier, steep = _special_texels(bake, pages, names, settings.texels)
    wanted = int(_SCARCE * settings.texels)
    scarce = scarce_texels(covered & (owner >= 0), brightness, texel, wanted, seed)
    count = max(int(_EDGES * settings.texels), _MIN_EDGES)
    edge = edge_points(reference, geometry, pages.owner, pages.covered, count, POINTS_PER_TEXEL, seed)
    parts = texel, outlier, steep
    pixel = np.concatenate([*parts, edge.pixel, scarce])
    kinds = [TEXEL, OUTLIER, STEEP, EDGE, SCARCE]
    kind = np.repeat(kinds, [*map(len, parts), len(edge.pixel), len(scarce)]).astype(np.int8)
    spread = [surface_points(geometry, part, size, POINTS_PER_TEXEL, seed) for part in (*parts, scarce)]
    surface = joined([*spread[:-1], edge.surface, spread[-1]])
    around = find_surroundings(reference, surface, seed)
    each, back = np.unique(pixel, return_inverse=True)
    chart = chart_numbers(geometry)[one_surface_point(geometry, each, size, seed)[0]][back]
    n = len(bake.scene.instances)
    of_object = np.bincount(owner[covered & (owner >= 0)], minlength=n)
    texels = (of_object / np.maximum(np.bincount(owner[texel], minlength=n), 1))[owner[pixel]]
    points = Points(
        kind=kind,
        pixel=pixel,
        owner=owner[pixel],
        chart=chart,
        room=around.room,
        gap=around.gap,
        valid_share=around.valid_share,
        texel_area=np.where(kind == TEXEL, texels * around.points.surface, 0.0),
        surface=around.points,
    )
    return points, around.air


def _special_texels(
    bake: StoredBake, pages: Pages, names: list[str], texels: int
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the outliers of all channels, and the texels with the largest gradients of light.

    texels : int, number of random texels
    """
    on = pages.covered & (pages.owner >= 0)
    found = [
        np.unique(np.concatenate([choose(bake.maps[name], on, int(share * texels)) for name in names]))
        for choose, share in ((outlier_texels, _OUTLIERS), (steep_texels, _STEEP))
    ]
    return found[0], found[1]


def joined(parts: list[SurfacePoints]) -> SurfacePoints:
    """Return the concatenation of several sets of surface points."""
    columns = (np.concatenate([getattr(part, f.name) for part in parts]) for f in fields(SurfacePoints))
    return SurfacePoints(*columns)


def chart_numbers(geometry: Geometry) -> NDArray[np.int32]:
    """Return (T,) int32: the chart of each triangle.

    A chart is a set of triangles of one object that are connected in lightmap uv.
    """
    corner_instance = np.zeros(len(geometry.uv), np.int32)
    corner_instance[geometry.triangle] = geometry.instance[:, None]
    key = np.column_stack([corner_instance, geometry.uv.view(np.int32)])
    _, number = np.unique(key, axis=0, return_inverse=True)
    corner = number.reshape(-1)[geometry.triangle]
    n = int(corner.max(initial=-1)) + 1
    ends = np.concatenate([corner[:, 1], corner[:, 2]])
    graph = coo_array((np.ones(len(ends), np.int8), (np.tile(corner[:, 0], 2), ends)), (n, n))
    _, label = connected_components(graph, directed=False)
    return np.asarray(label[corner[:, 0]], np.int32)
