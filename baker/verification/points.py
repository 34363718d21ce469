"""Which points of a bake are judged: texels at their middles, texels that stand out, points at edges,
texels of light levels that have few.
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
from baker.metrics.sample_texels import choose_texels, scarce_texels
from baker.metrics.suspects import steep_texels, suspect_texels
from baker.metrics.texel_area import TexelPlaces, instance_map, texel_places, texel_points
from baker.pathtracer.scene import Reference
from baker.verification.edges import edge_points
from baker.verification.settings import VerifySettings
from baker.verification.surroundings import look_around

TEXEL, SUSPECT, STEEP, EDGE, SCARCE = 0, 1, 2, 3, 4
PLACES = 64
# Points at edges, texels that stand out, and steep ones, in each channel, for each judged texel.
_EDGES, _SUSPECTS, _STEEP = 0.35, 0.05, 0.1
_LEAST_EDGES = 500
# Texels that each light level should have, for each judged texel.
_SCARCE = 0.1


@dataclass(frozen=True)
class Points:
    """What is judged: n points.

    Attributes
    ----------
    kind : (n,) int8
        TEXEL (chosen by chance), SUSPECT (it stands out), STEEP (light changes there), EDGE or
        SCARCE (its light level has few texels); texels first.
    pixel : (n,) int64
        (page * H + row) * W + column.
    owner, chart, room : (n,) int32
        Object; piece of its lightmap uv; room (-1: none), see `surroundings`.
    gap : (n,) bool
        In a narrow gap.
    free : (n,) float64
        Share of its places that lie in no solid.
    stands_for : (n,) float64, m2
        Surface of its object that a texel stands for; 0 for other kinds.
    places : TexelPlaces
        Where light is measured; the map is looked up `places.middle` beside the texel's centre.
    """

    kind: NDArray[np.int8]
    pixel: NDArray[np.int64]
    owner: NDArray[np.int32]
    chart: NDArray[np.int32]
    room: NDArray[np.int32]
    gap: NDArray[np.bool_]
    free: NDArray[np.float64]
    stands_for: NDArray[np.float64]
    places: TexelPlaces

    @property
    def position(self) -> NDArray[np.float64]:
        """Return the middle of each point's places (n, 3), world, relative to the geometry's origin."""
        middle: NDArray[np.float64] = self.places.position.mean(axis=1)
        return middle


@dataclass(frozen=True)
class Pages:
    """The texels of all pages.

    Attributes
    ----------
    owner : (P, H, W) int32
        Object that covers most of each texel, -1 for none.
    covered : (P, H, W) bool
        They hold a measured value.
    """

    owner: NDArray[np.int32]
    covered: NDArray[np.bool_]


def read_pages(bake: StoredBake, geometry: Geometry, names: list[str]) -> Pages:
    """Find what lies on each texel.

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
    """Choose what is judged and look around it; return also points (m, 3) in the air that see it."""
    size, seed = bake.atlas.resolution, settings.seed
    owner, covered = pages.owner.reshape(-1), pages.covered.reshape(-1)
    brightness = bake.maps[names[0]].mean(axis=3, dtype=np.float64).reshape(-1)
    texel = choose_texels(owner, covered, brightness, settings.texels, seed)
    suspect, steep = _telling_texels(bake, pages, names, settings.texels)
    wanted = int(_SCARCE * settings.texels)
    scarce = scarce_texels(covered & (owner >= 0), brightness, texel, wanted, seed)
    count = max(int(_EDGES * settings.texels), _LEAST_EDGES)
    edge = edge_points(reference, geometry, pages.owner, pages.covered, count, PLACES, seed)
    parts = texel, suspect, steep
    pixel = np.concatenate([*parts, edge.pixel, scarce])
    kinds = [TEXEL, SUSPECT, STEEP, EDGE, SCARCE]
    kind = np.repeat(kinds, [*map(len, parts), len(edge.pixel), len(scarce)]).astype(np.int8)
    spread = [texel_places(geometry, part, size, PLACES, seed) for part in (*parts, scarce)]
    places = joined([*spread[:-1], edge.places, spread[-1]])
    around = look_around(reference, places, seed)
    each, back = np.unique(pixel, return_inverse=True)
    chart = chart_numbers(geometry)[texel_points(geometry, each, size, seed)[0]][back]
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
        free=around.free,
        stands_for=np.where(kind == TEXEL, texels * around.places.surface, 0.0),
        places=around.places,
    )
    return points, around.air


def _telling_texels(
    bake: StoredBake, pages: Pages, names: list[str], texels: int
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the texels of all channels that stand out, and those where light changes most."""
    on = pages.covered & (pages.owner >= 0)
    found = [
        np.unique(np.concatenate([choose(bake.maps[name], on, int(share * texels)) for name in names]))
        for choose, share in ((suspect_texels, _SUSPECTS), (steep_texels, _STEEP))
    ]
    return found[0], found[1]


def joined(parts: list[TexelPlaces]) -> TexelPlaces:
    """Return the places of several sets of points as one."""
    columns = (np.concatenate([getattr(part, f.name) for part in parts]) for f in fields(TexelPlaces))
    return TexelPlaces(*columns)


def chart_numbers(geometry: Geometry) -> NDArray[np.int32]:
    """Return the chart (T,) of each triangle: triangles of an object that share corners in the page."""
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
