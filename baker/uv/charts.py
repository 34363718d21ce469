"""Cuts meshes into charts. Each triangle gets a chart, and charts hardly overlap themselves (`uv.check`)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baker.core.progress import Progress
from baker.topology.weld import number_by_first, weld
from baker.uv.check import CHART_TOLERANCE, chart_overlap, uv_area
from baker.uv.parts import JOB_TRIANGLES, cut_parts
from baker.uv.planar import planar_charts
from baker.uv.pool import run_jobs
from baker.uv.xatlas_charts import ChartJob, FlatCharts


@dataclass(frozen=True)
class MeshCharts:
    """Charts of a mesh.

    A lightmap vertex is a mesh vertex with a uv. A mesh vertex on a seam becomes several lightmap vertices.

    Attributes
    ----------
    vertex : (V',) int32
        Mesh vertex of each lightmap vertex.
    uv : (V', 2) float64, unit of the positions
        Uv of each lightmap vertex. The lower corner of each chart's bounding box is at 0.
    triangle : (T, 3) int32
        Lightmap vertices of each triangle.
    chart : (T,) int32
        Chart of each triangle, from 0.
    vertex_chart : (V',) int32
        Chart of each lightmap vertex.
    n_repaired : int
        Number of triangles of nonzero area that `planar_charts` laid out.
    """

    vertex: NDArray[np.int32]
    uv: NDArray[np.float64]
    triangle: NDArray[np.int32]
    chart: NDArray[np.int32]
    vertex_chart: NDArray[np.int32]
    n_repaired: int

    @property
    def n_charts(self) -> int:
        """Return the number of charts."""
        return int(self.chart.max()) + 1 if len(self.chart) else 0


@dataclass(frozen=True)
class _Welded:
    """A mesh whose vertices with equal positions have been merged.

    Attributes
    ----------
    position : (P, 3) float64
        Vertices.
    triangle : (T, 3) int32
        Vertex indices of each triangle.
    part : (T,) int32
        Part of each triangle, see `uv.parts.cut_parts`.
    """

    position: NDArray[np.float64]
    triangle: NDArray[np.int32]
    part: NDArray[np.int32]


def chart_meshes(
    meshes: Sequence[tuple[NDArray[np.float64], NDArray[np.int32]]],
    threads: int,
    progress: Progress,
    until: float,
) -> list[MeshCharts]:
    """Cut meshes into charts.

    Parameters
    ----------
    meshes : sequence of (position (V, 3) float64, triangle (T, 3) int32)
        Vertices and vertex indices of the triangles of each mesh.
    threads : int
        Largest number of worker processes. The result does not depend on it.
    progress : Progress
        Called with fractions of the stage from 0 to `until`.
    until : float
        Fraction of the stage to report when all meshes are cut.

    Returns
    -------
    list of MeshCharts
        Charts of each mesh.
    """
    welded = [_weld_mesh(position, triangle) for position, triangle in meshes]
    jobs, origin = _make_jobs(welded)
    answers = run_jobs(jobs, threads, progress, until)
    uv = [np.zeros((len(w.triangle), 3, 2)) for w in welded]
    chart = [np.full(len(w.triangle), -1, np.int64) for w in welded]
    base = 0
    for answer, pieces in zip(answers, origin, strict=True):
        # Offset the chart numbers of each job, which start at 0.
        number = np.where(answer.chart >= 0, answer.chart.astype(np.int64) + base, -1)
        base = int(number.max(initial=base - 1)) + 1
        row = 0
        for mesh, face in pieces:
            rows = slice(row, row + len(face))
            row += len(face)
            uv[mesh][face] = answer.uv[rows]
            chart[mesh][face] = number[rows]
    return [
        _finish(triangle, w, FlatCharts(u, number_by_first(c)))
        for (_, triangle), w, u, c in zip(meshes, welded, uv, chart, strict=True)
    ]


def _weld_mesh(position: NDArray[np.float64], triangle: NDArray[np.int32]) -> _Welded:
    """Weld vertices with equal positions, so that vertices split for normals do not separate charts."""
    label = weld(position)
    welded = np.zeros((int(label.max(initial=-1)) + 1, 3))
    welded[label] = position
    joined = label[triangle]
    return _Welded(welded, joined, cut_parts(welded, joined))


def _make_jobs(welded: Sequence[_Welded]) -> tuple[list[ChartJob], list[list[tuple[int, NDArray[np.int64]]]]]:
    """Bundle parts into jobs of at most `JOB_TRIANGLES` triangles. A larger part is a separate job.

    Also return the parts of each job, as pairs of mesh index and face indices. The jobs do not depend on the
    number of threads.
    """
    jobs: list[ChartJob] = []
    origin: list[list[tuple[int, NDArray[np.int64]]]] = []
    bundle: list[tuple[int, NDArray[np.int64]]] = []
    size = 0

    def close() -> None:
        nonlocal bundle, size
        if bundle:
            jobs.append(_bundle_job(welded, bundle))
            origin.append(bundle)
        bundle, size = [], 0

    for m, mesh in enumerate(welded):
        order = np.argsort(mesh.part, kind="stable")
        for face in np.split(order, np.flatnonzero(np.diff(mesh.part[order])) + 1):
            if size and size + len(face) > JOB_TRIANGLES:
                close()
            bundle.append((m, face))
            size += len(face)
    close()
    return jobs, origin


def _bundle_job(welded: Sequence[_Welded], bundle: Sequence[tuple[int, NDArray[np.int64]]]) -> ChartJob:
    position, triangle = [], []
    first_vertex, first_triangle = [0], [0]
    for mesh, face in bundle:
        used, local = np.unique(welded[mesh].triangle[face], return_inverse=True)
        position.append(welded[mesh].position[used])
        triangle.append(local.reshape(-1, 3).astype(np.int32))
        first_vertex.append(first_vertex[-1] + len(used))
        first_triangle.append(first_triangle[-1] + len(face))
    return ChartJob(
        np.concatenate(position), np.concatenate(triangle), np.array(first_vertex), np.array(first_triangle)
    )


def _finish(triangle: NDArray[np.int32], welded: _Welded, flat: FlatCharts) -> MeshCharts:
    """Lay out triangles without a valid chart by `planar_charts`, and merge corners to lightmap vertices.

    triangle : (T, 3) int32, vertices of the original mesh; flat : charts of the welded mesh
    """
    uv, chart = flat.uv.copy(), flat.chart.astype(np.int64)
    good = np.flatnonzero(chart >= 0)
    if len(good):
        overlapping = chart_overlap(uv[good], flat.chart[good]).overlaps(CHART_TOLERANCE)
        chart[good[overlapping[flat.chart[good]]]] = -1
    missing = np.flatnonzero(chart < 0)
    if len(missing):
        uv[missing], own = planar_charts(welded.position, welded.triangle[missing])
        chart[missing] = int(chart.max(initial=-1)) + 1 + own
    chart32 = number_by_first(chart)
    n_charts = int(chart32.max(initial=-1)) + 1
    corner_chart = np.repeat(chart32, 3)
    flat_uv = uv.reshape(-1, 2)
    low = np.full((n_charts, 2), np.inf)
    np.minimum.at(low, corner_chart, flat_uv)
    flat_uv = flat_uv - low[corner_chart]
    # Merge corners with equal mesh vertex, chart and uv to one lightmap vertex.
    key = np.stack([triangle.reshape(-1).astype(np.float64), corner_chart.astype(np.float64)], axis=1)
    label = weld(key, flat_uv)
    _, first = np.unique(label, return_index=True)
    return MeshCharts(
        vertex=triangle.reshape(-1)[first].astype(np.int32),
        uv=flat_uv[first],
        triangle=label.reshape(-1, 3),
        chart=chart32,
        vertex_chart=corner_chart[first],
        n_repaired=int(np.count_nonzero(uv_area(uv[missing]) > 0)) if len(missing) else 0,
    )
