"""The points at which a bake is compared: random texels, outliers, steep texels, points at edges, and
further texels of light levels that have few.
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
from baker.verification.surroundings import look_around

TEXEL, OUTLIER, STEEP, EDGE, SCARCE = 0, 1, 2, 3, 4
POINTS_PER_TEXEL = 64
# Points at edges, outliers and steep texels for each random texel, the latter two in each channel.
_EDGES, _OUTLIERS, _STEEP = 0.35, 0.05, 0.1
_MIN_EDGES = 500
# Texels that each light level should have, for each random texel.
_SCARCE = 0.1


@dataclass(frozen=True)
class Points:
    """The n compared points, each a texel or a point at an edge.

    Attributes
    ----------
    kind : (n,) int8
        TEXEL (random texel), OUTLIER (differs from its neighbours), STEEP (light changes there), EDGE or
        SCARCE (its light level has few texels); random texels first.
    pixel : (n,) int64
        (page * H + row) * W + column.
    owner, chart, room : (n,) int32
        Object; chart; room, -1 for none, see `surroundings`.
    gap : (n,) bool
        In a narrow gap, or inside geometry.
    valid_share : (n,) float64
        Share of the surface points that are valid.
    texel_area : (n,) float64, m2
        Surface of its object that a random texel represents; 0 for other kinds.
    surface : SurfacePoints
        The surface points at which light is measured; the map is looked up at `surface.offset` from the
        texel's centre.
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
        """Return the mean of each point's surface points (n, 3), relative to the geometry's origin."""
        middle: NDArray[np.float64] = self.surface.position.mean(axis=1)
        return middle


@dataclass(frozen=True)
class Pages:
    """The texels of all pages.

    Attributes
    ----------
    owner : (P, H, W) int32
        Object that covers most of each texel, -1 for none.
    covered : (P, H, W) bool
        Texels with a measured value.
    """

    owner: NDArray[np.int32]
    covered: NDArray[np.bool_]


def read_pages(bake: StoredBake, geometry: Geometry, names: list[str]) -> Pages:
    """Find the object on each texel, and which texels have a measured value.

    Raises
    ------
    InputError
        If a channel lacks pages, or no texel lies on a surface.
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
    """Choose the points to compare and find their surroundings; return also points (m, 3) in the air."""
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
    around = look_around(reference, surface, seed)
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
    """Return the outliers of all channels, and the texels where light changes most."""
    on = pages.covered & (pages.owner >= 0)
    found = [
        np.unique(np.concatenate([choose(bake.maps[name], on, int(share * texels)) for name in names]))
        for choose, share in ((outlier_texels, _OUTLIERS), (steep_texels, _STEEP))
    ]
    return found[0], found[1]


def joined(parts: list[SurfacePoints]) -> SurfacePoints:
    """Concatenate surface points."""
    columns = (np.concatenate([getattr(part, f.name) for part in parts]) for f in fields(SurfacePoints))
    return SurfacePoints(*columns)


def chart_numbers(geometry: Geometry) -> NDArray[np.int32]:
    """Return the chart (T,) of each triangle: a connected set of triangles of an object in lightmap uv."""
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
