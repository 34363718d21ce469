"""Computes properties of the lightmap uv of a mesh that several rules use: ranges, areas and charts."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from baker.checks.mesh_facts import MeshFacts
from baker.topology.weld import connected_vertices, weld
from baker.uv.check import RANGE_SLACK

LIGHTMAP_SET = 1


class UvFacts:
    """One uv set, TEXCOORD_1 by default, of the F good faces whose primitives have this set.

    Attributes
    ----------
    rows : (F,) int64
        The faces, as indices into `MeshFacts.good`.
    triangle : (F, 3) int64
        Vertices of the faces, as indices into `MeshFacts.position`.
    uv : (F, 3, 2) float64
        The uv of the corners.
    """

    def __init__(self, facts: MeshFacts, number: int = LIGHTMAP_SET) -> None:
        self.facts = facts
        have = np.array([number in p.texcoord for p in facts.source.primitives], bool)
        self.rows: NDArray[np.int64] = np.flatnonzero(have[facts.primitive[facts.good]])
        blank = [np.zeros((len(p.position), 2), np.float32) for p in facts.source.primitives]
        parts = [p.texcoord.get(number, zero) for p, zero in zip(facts.source.primitives, blank, strict=True)]
        self._vertex = np.concatenate(parts) if parts else np.zeros((0, 2), np.float32)
        self.triangle: NDArray[np.int64] = facts.triangle[facts.good[self.rows]]
        self.uv: NDArray[np.float64] = self._vertex[self.triangle].astype(np.float64)

    @property
    def faces(self) -> NDArray[np.int64]:
        """Return the indices of the faces in the mesh, (F,) int64."""
        return self.facts.good[self.rows]

    @cached_property
    def finite(self) -> NDArray[np.bool_]:
        """Return (F,) bool: the faces with finite uv."""
        return np.asarray(np.isfinite(self.uv).all(axis=(1, 2)))

    @cached_property
    def valid(self) -> bool:
        """Return whether F > 0, and all uv are finite and inside 0..1 within `RANGE_SLACK`."""
        return bool(len(self.rows)) and bool(self.finite.all()) and not self.outside.any()

    @cached_property
    def outside(self) -> NDArray[np.bool_]:
        """Return (F,) bool: the faces with a uv outside 0..1 by more than `RANGE_SLACK`."""
        with np.errstate(invalid="ignore"):
            return np.asarray(((self.uv < -RANGE_SLACK) | (self.uv > 1.0 + RANGE_SLACK)).any(axis=(1, 2)))

    @cached_property
    def signed_area(self) -> NDArray[np.float64]:
        """Return the signed uv area of each face, (F,) float64; the page has area 1."""
        e1, e2 = self.uv[:, 1] - self.uv[:, 0], self.uv[:, 2] - self.uv[:, 0]
        area: NDArray[np.float64] = 0.5 * (e1[:, 0] * e2[:, 1] - e1[:, 1] * e2[:, 0])
        return area

    @cached_property
    def area(self) -> NDArray[np.float64]:
        """Return the area of each face in object space, (F,) float64."""
        return self.facts.area[self.rows]

    @cached_property
    def chart(self) -> NDArray[np.int32]:
        """Return the chart of each face, (F,) int32.

        Faces that share a corner with the same position and the same uv are parts of one chart.
        """
        label = weld(self.facts.position, self._vertex)
        return connected_vertices(label[self.triangle], int(label.max(initial=-1)) + 1)

    @cached_property
    def n_charts(self) -> int:
        """Return the number of charts, C."""
        return int(self.chart.max(initial=-1)) + 1

    def per_chart(self, value: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return (C,) float64: for each chart, the sum of the values (F,) of its faces."""
        return np.bincount(self.chart, value, self.n_charts).astype(np.float64)
