"""Makes the outlines to pack, and computes the uv of instances from packed outlines."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baker.uv.charts import MeshCharts
from baker.uv.check import chart_bounds, uv_area
from baker.uv.pack import Packing, Shapes


@dataclass(frozen=True)
class CutInstance:
    """An instance whose mesh was cut into charts, which are packed separately.

    Attributes
    ----------
    charts : int
        Index of the mesh's charts in the list of `MeshCharts`.
    factor : float
        Metres per unit of the charts' uv, multiplied by the instance's factor on density (`density_shares`).
    """

    charts: int
    factor: float


@dataclass(frozen=True)
class RigidInstance:
    """An instance that keeps its uv layout, which is only moved and scaled as a whole.

    Attributes
    ----------
    uv : (V, 2) float64
        Uv of each vertex.
    low, high : (2,) float64
        Lower and upper bounds of the uv of all vertices that triangles use.
    factor : float
        Metres per unit of uv, multiplied by the instance's factor on density (`density_shares`).
    """

    uv: NDArray[np.float64]
    low: NDArray[np.float64]
    high: NDArray[np.float64]
    factor: float


@dataclass(frozen=True)
class Outlines:
    """All outlines of a scene of N instances, as items to pack.

    An item is one chart of a `CutInstance`, or a whole `RigidInstance`, whose outline is the bounding
    rectangle of its uv. Items are sorted by instance.

    Attributes
    ----------
    shapes : Shapes
        The S different outlines.
    turned : (S,) bool
        Whether u and v are exchanged in the shape, which makes its width at least its height. Always false
        for a `RigidInstance`.
    item_shape : (I,) int64
        Shape of each item.
    first_item : (N + 1,) int64
        Instance i has the items `first_item[i]` to `first_item[i + 1]` - 1.
    """

    shapes: Shapes
    turned: NDArray[np.bool_]
    item_shape: NDArray[np.int64]
    first_item: NDArray[np.int64]


def make_outlines(
    placements: Sequence[CutInstance | RigidInstance], meshes: Sequence[MeshCharts]
) -> Outlines:
    """Make the items of all instances, and one shape for all items with the same chart and size.

    Parameters
    ----------
    placements : sequence of CutInstance or RigidInstance
        Placement of each instance.
    meshes : sequence of MeshCharts
        Charts of each mesh, indexed by `CutInstance.charts`.

    Returns
    -------
    Outlines
        Shapes and items.
    """
    corner: list[NDArray[np.float64]] = []
    count: list[NDArray[np.int64]] = []
    extent: list[NDArray[np.float64]] = []
    turned: list[NDArray[np.bool_]] = []
    rigid: list[NDArray[np.bool_]] = []
    base: dict[tuple[int, float], int] = {}
    n_shapes = 0
    items: list[NDArray[np.int64]] = []
    for placement in placements:
        if isinstance(placement, RigidInstance):
            w, h = (placement.high - placement.low) * placement.factor
            corner.append(np.array([[[0, 0], [w, 0], [w, h]], [[0, 0], [w, h], [0, h]]], dtype=np.float64))
            count.append(np.array([2]))
            extent.append(np.array([[w, h]]))
            turned.append(np.zeros(1, bool))
            rigid.append(np.ones(1, bool))
            items.append(np.array([n_shapes], np.int64))
            n_shapes += 1
            continue
        key = (placement.charts, placement.factor)
        charts = meshes[placement.charts]
        if key not in base:
            order = np.argsort(charts.chart, kind="stable")
            uv = charts.uv[charts.triangle[order]] * placement.factor
            sorted_chart = charts.chart[order]
            size = chart_bounds(uv, sorted_chart, charts.n_charts)[1]
            turn = size[:, 1] > size[:, 0]
            uv = np.where(turn[sorted_chart][:, None, None], uv[..., ::-1], uv)
            corner.append(uv)
            count.append(np.bincount(sorted_chart, minlength=charts.n_charts))
            extent.append(np.where(turn[:, None], size[:, ::-1], size))
            turned.append(turn)
            rigid.append(np.zeros(charts.n_charts, bool))
            base[key] = n_shapes
            n_shapes += charts.n_charts
        items.append(base[key] + np.arange(charts.n_charts))
    all_corner = np.ascontiguousarray(np.concatenate(corner))
    first = np.concatenate([[0], np.cumsum(np.concatenate(count))])
    area = np.add.reduceat(uv_area(all_corner), first[:-1])
    return Outlines(
        Shapes(all_corner, first, np.concatenate(extent), area, np.concatenate(rigid)),
        np.concatenate(turned),
        np.concatenate(items),
        np.concatenate([[0], np.cumsum([len(i) for i in items])]),
    )


def place_uv(
    outlines: Outlines,
    instance: int,
    placement: CutInstance | RigidInstance,
    meshes: Sequence[MeshCharts],
    packing: Packing,
    position: NDArray[np.int32],
    resolution: int,
) -> NDArray[np.float32]:
    """Return the page uv of an instance whose items have been packed.

    Parameters
    ----------
    outlines : Outlines
        Outlines of all instances.
    instance : int
        Index of the instance in `outlines`.
    placement : CutInstance or RigidInstance
        Placement of the instance.
    meshes : sequence of MeshCharts
        Charts of each mesh, indexed by `CutInstance.charts`.
    packing : Packing
        Packing of the page of the instance.
    position : (n, 2) int32
        Column and row of the lower corners of the instance's n items.
    resolution : int
        Page width in texels.

    Returns
    -------
    (V', 2) float32
        Page uv of each lightmap vertex.
    """
    first = int(outlines.first_item[instance])
    if isinstance(placement, RigidInstance):
        scale = packing.scale[outlines.item_shape[first]] * placement.factor
        texel = (placement.uv - placement.low) * scale + position[0] + 0.5
        return np.asarray(texel / resolution, dtype=np.float32)
    charts = meshes[placement.charts]
    shape = outlines.item_shape[first + charts.vertex_chart]
    uv = charts.uv * placement.factor
    uv = np.where(outlines.turned[shape][:, None], uv[:, ::-1], uv)
    texel = uv * packing.scale[shape] + position[charts.vertex_chart] + 0.5
    return np.asarray(texel / resolution, dtype=np.float32)
