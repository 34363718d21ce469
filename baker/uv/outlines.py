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
class BlockInstance:
    """An instance whose charts are packed in a rectangle, with the same layout as those of other instances.

    Attributes
    ----------
    charts : int
        Index of the mesh's charts in the list of `MeshCharts`.
    factor : float
        Metres per unit of the charts' uv, multiplied by the instance's factor on density (`density_shares`).
    block : int
        Number of the layout. Instances with the same number have the same layout.
    """

    charts: int
    factor: float
    block: int


Placement = CutInstance | RigidInstance | BlockInstance


@dataclass(frozen=True)
class Outlines:
    """All outlines of a scene of N instances, as items to pack.

    An item is one chart of a `CutInstance`, or a whole `RigidInstance` or `BlockInstance`, whose outline is a
    rectangle. Items are sorted by instance.

    Attributes
    ----------
    shapes : Shapes
        The S different outlines.
    turned : (S,) bool
        Whether u and v are exchanged in the shape, which makes its width at least its height. Always false
        for rectangles.
    item_shape : (I,) int64
        Shape of each item.
    first_item : (N + 1,) int64
        Instance i has the items `first_item[i]` to `first_item[i + 1]` - 1.
    """

    shapes: Shapes
    turned: NDArray[np.bool_]
    item_shape: NDArray[np.int64]
    first_item: NDArray[np.int64]


def make_outlines(placements: Sequence[Placement], meshes: Sequence[MeshCharts]) -> Outlines:
    """Make the items of all instances, and one shape for all items with the same outline and size.

    The shape of a `BlockInstance` has a provisional size, until `baker.uv.blocks.with_blocks` is called.

    Parameters
    ----------
    placements : sequence of CutInstance, RigidInstance or BlockInstance
        Placement of each instance.
    meshes : sequence of MeshCharts
        Charts of each mesh, indexed by `charts` of placements.

    Returns
    -------
    Outlines
        Shapes and items.
    """
    parts: list[_ShapeArrays] = []
    base: dict[tuple[int, float, int], int] = {}
    n_shapes = 0
    items: list[NDArray[np.int64]] = []
    for placement in placements:
        if isinstance(placement, RigidInstance):
            parts.append(_rectangle((placement.high - placement.low) * placement.factor))
            items.append(np.array([n_shapes], np.int64))
            n_shapes += 1
            continue
        charts = meshes[placement.charts]
        block = placement.block if isinstance(placement, BlockInstance) else -1
        key = (placement.charts, placement.factor, block)
        if key not in base:
            if block >= 0:
                parts.append(_rectangle(_block_size(charts) * placement.factor))
            else:
                parts.append(_chart_shapes(charts, placement.factor))
            base[key] = n_shapes
            n_shapes += len(parts[-1].count)
        items.append(base[key] + np.arange(1 if block >= 0 else charts.n_charts))
    corner = np.ascontiguousarray(np.concatenate([part.corner for part in parts]))
    first = np.concatenate([[0], np.cumsum(np.concatenate([part.count for part in parts]))])
    area = np.add.reduceat(uv_area(corner), first[:-1])
    extent = np.concatenate([part.extent for part in parts])
    rigid = np.concatenate([np.full(len(part.count), part.rigid) for part in parts])
    return Outlines(
        Shapes(corner, first, extent, area, rigid),
        np.concatenate([part.turned for part in parts]),
        np.concatenate(items),
        np.concatenate([[0], np.cumsum([len(i) for i in items])]),
    )


@dataclass(frozen=True)
class _ShapeArrays:
    """The columns of `Shapes` and `Outlines` for some shapes; `count` (n,) is their number of triangles."""

    corner: NDArray[np.float64]
    count: NDArray[np.int64]
    extent: NDArray[np.float64]
    turned: NDArray[np.bool_]
    rigid: bool


def _rectangle(size: NDArray[np.float64]) -> _ShapeArrays:
    w, h = size
    corner = np.array([[[0, 0], [w, 0], [w, h]], [[0, 0], [w, h], [0, h]]], dtype=np.float64)
    return _ShapeArrays(corner, np.array([2]), np.array([[w, h]]), np.zeros(1, bool), True)


def _block_size(charts: MeshCharts) -> NDArray[np.float64]:
    """Return an estimate (2,) of the size of a block without gaps: a square of the charts' rectangles."""
    size = chart_bounds(charts.uv[charts.triangle], charts.chart, charts.n_charts)[1]
    if charts.n_charts == 1:
        return np.sort(size[0])[::-1]
    return np.full(2, max(float(np.sqrt(size.prod(axis=1).sum())), float(size.max())))


def _chart_shapes(charts: MeshCharts, factor: float) -> _ShapeArrays:
    order = np.argsort(charts.chart, kind="stable")
    uv = charts.uv[charts.triangle[order]] * factor
    sorted_chart = charts.chart[order]
    size = chart_bounds(uv, sorted_chart, charts.n_charts)[1]
    turn = size[:, 1] > size[:, 0]
    uv = np.where(turn[sorted_chart][:, None, None], uv[..., ::-1], uv)
    count = np.bincount(sorted_chart, minlength=charts.n_charts)
    return _ShapeArrays(uv, count, np.where(turn[:, None], size[:, ::-1], size), turn, False)


def place_uv(
    outlines: Outlines,
    instance: int,
    placement: Placement,
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
        Placement of the instance. For a `BlockInstance`, see `baker.uv.blocks.layout_uv`.
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
