"""Traces camera rays to their first hits, and returns position, triangle, albedo and normal of each hit."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baker.kernels.transmittance import trace_transmittance_packet, transmittance
from baker.pathtracer.scene import (
    BASE_COLOUR,
    CORNER,
    FACE,
    MATERIAL,
    SHADING,
    TEXTURED,
    TWO_SIDED,
    Reference,
)
from baker.pathtracer.vertex import base_colour
from baker.trace.jit import kernel, scratch
from baker.trace.packets import (
    GEOM_ID,
    HIT_U,
    HIT_V,
    NO_HIT,
    PRIM_ID,
    TFAR,
    new_packet_buffers,
    set_ray,
    trace,
)

_new_colour = scratch((4,), np.float64)


@dataclass(frozen=True)
class FirstHits:
    """First hits of n rays.

    Attributes
    ----------
    triangle : (n,) int32
        The triangle that was hit, -1 without a hit.
    bary : (n, 2) float64
        Barycentrics of the hit: weights of corners 1 and 2.
    depth : (n,) float64
        Distance of the hit, metres; inf without a hit.
    albedo : (n, 3) float64
        Base colour with texture and vertex colour, linear Rec.709; 0 without a hit.
    position : (n, 3) float64
        Position of the hit, metres, relative to `reference.geometry.origin`; undefined without a hit.
    normal, face_normal : (n, 3) float64
        Unit shading normal and geometric normal, on the viewer's side; 0 without a hit.
    front : (n,) bool
        Whether the front of the triangle was hit.
    lit : (n,) bool
        Whether the side that was hit reflects light. Fronts do, and both sides of two-sided surfaces.
    kept : (n, 3) float64
        Product of lerp(1, c, a) over the `BLEND` surfaces that the ray passed, with colour c and alpha a. The
        factor 1 - a of their transmittance is the probability of passing: the ray stops at a `BLEND` surface
        with probability a.
    """

    triangle: NDArray[np.int32]
    bary: NDArray[np.float64]
    depth: NDArray[np.float64]
    albedo: NDArray[np.float64]
    position: NDArray[np.float64]
    normal: NDArray[np.float64]
    face_normal: NDArray[np.float64]
    front: NDArray[np.bool_]
    lit: NDArray[np.bool_]
    kept: NDArray[np.float64]


def first_hits(
    reference: Reference, origin: NDArray[np.float64], direction: NDArray[np.float64]
) -> FirstHits:
    """Trace n rays to their first hits.

    Parameters
    ----------
    reference : Reference
        The scene.
    origin : (3,) or (n, 3) float64
        One origin for all rays, or one for each ray; metres, relative to `reference.geometry.origin`.
    direction : (n, 3) float64
        Unit directions, world.

    Returns
    -------
    FirstHits
        The first hits of the n rays.
    """
    n = len(direction)
    triangle, bary = np.full(n, -1, np.int32), np.zeros((n, 2))
    depth, albedo = np.full(n, np.inf), np.zeros((n, 3))
    surfaces = reference.surfaces
    origin = np.ascontiguousarray(np.broadcast_to(origin, (n, 3)))
    buffers, kept = new_packet_buffers(reference.rays.tracer), np.zeros((n, 3))
    _meet(
        origin, direction, buffers, surfaces.row, surfaces.material, reference.shading, triangle, bary, depth,
        albedo, kept,
    )  # fmt: skip
    row = surfaces.row[triangle].astype(np.float64)
    weight = np.stack([1 - bary.sum(axis=1), bary[:, 0], bary[:, 1]], axis=1)
    met = triangle >= 0
    position = np.einsum("nk,nka->na", weight, row[:, CORNER : CORNER + 9].reshape(n, 3, 3))
    normal = np.einsum("nk,nka->na", weight, row[:, SHADING : SHADING + 9].reshape(n, 3, 3))
    face = row[:, FACE : FACE + 3]
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
    normal = np.where((normal * face).sum(axis=1, keepdims=True) <= 0, face, normal)
    front = met & ((face * direction).sum(axis=1) < 0)
    sign = np.where(front, 1.0, -1.0)[:, None] * met[:, None]
    lit = met & (front | (row[:, TWO_SIDED] > 0))
    return FirstHits(triangle, bary, depth, albedo, position, sign * normal, sign * face, front, lit, kept)


@kernel
def _meet(origin, direction, buffers, surface, material, shading, triangle, bary, depth, albedo, kept):  # type: ignore[no-untyped-def]
    """Trace n rays in packets, and write their hits to the outputs.

    origin, direction : (n, 3) float64; buffers : `PacketBuffers`
    surface : (T, 32), material : (M, 8) float32, see `Surfaces`; shading : `Shading`
    triangle (n,) int32; bary (n, 2), depth (n,), albedo, kept (n, 3) float64 : outputs, see `FirstHits`
    """
    width, scene, intersect = buffers.width, buffers.scene, buffers.intersect
    valid, floats, words = buffers.valid, buffers.floats, buffers.words
    colour = _new_colour()
    for group in range(0, len(direction), width):
        for lane in range(width):
            i = group + lane
            valid[lane] = -1 if i < len(direction) else 0
            if i < len(direction):
                set_ray(
                    floats, words, width, lane, origin[i, 0], origin[i, 1], origin[i, 2],
                    direction[i, 0], direction[i, 1], direction[i, 2],
                    np.float32(1.0e30),
                )  # fmt: skip
        trace(intersect, scene, valid, floats)
        trace_transmittance_packet(buffers.blend, buffers.occluded, width, valid, floats, True)
        for lane in range(width):
            i = group + lane
            if i >= len(direction):
                continue
            for c in range(3):
                kept[i, c] = transmittance(buffers.blend, c, lane)
            if words[GEOM_ID * width + lane] == NO_HIT:
                continue
            prim = np.int64(words[PRIM_ID * width + lane])
            u, v = np.float64(floats[HIT_U * width + lane]), np.float64(floats[HIT_V * width + lane])
            triangle[i], bary[i, 0], bary[i, 1], depth[i] = prim, u, v, floats[TFAR * width + lane]
            m = np.int64(surface[prim, MATERIAL])
            for c in range(3):
                albedo[i, c] = material[m, BASE_COLOUR + c]
            if surface[prim, TEXTURED] > 0.0:
                base_colour(shading, prim, m, u, v, colour)
                for c in range(3):
                    albedo[i, c] *= colour[c]
