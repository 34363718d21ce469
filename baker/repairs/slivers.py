"""Makes scans of needle-shaped triangles anew, in triangles of about equal sides."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baker.io.gltf.edited_primitive import ReplacedPrimitive
from baker.repairs import meshlab
from baker.repairs.plan import PartPlan
from baker.repairs.surface import Surface

# A needle is less than this times as high as long.
NEEDLE = 0.02
# Share of needles, and number of faces, from which a mesh is made anew: a scan, not a wall of two triangles.
MOST_NEEDLES = 0.1
FEWEST_FACES = 500


@dataclass(frozen=True)
class Remeshing:
    """What came of it.

    Attributes
    ----------
    made : ReplacedPrimitive
    n_before, n_after : int
        Needles.
    lost : tuple of str
        Attributes that the new vertices do not have.
    """

    made: ReplacedPrimitive
    n_before: int
    n_after: int
    lost: tuple[str, ...]


def needles(position: NDArray[np.float32], triangle: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Tell which faces are needles, (T,) bool."""
    a, b, c = (position[triangle[:, k]].astype(np.float64) for k in range(3))
    longest = np.max([np.linalg.norm(v, axis=1) for v in (b - a, c - b, a - c)], axis=0)
    height = np.linalg.norm(np.cross(b - a, c - a), axis=1) / np.maximum(longest, 1e-300)
    return np.asarray(height < NEEDLE * longest)


def is_needle_mesh(surface: Surface) -> bool:
    """Tell whether a surface is to be made anew."""
    if len(surface.triangle) < FEWEST_FACES:
        return False
    return bool(needles(surface.position, surface.triangle).mean() >= MOST_NEEDLES)


def remesh_part(surface: Surface, plan: PartPlan) -> Remeshing:
    """Make the one primitive of a surface anew, with as many faces if all were equal.

    Parameters
    ----------
    surface : Surface
    plan : PartPlan
        The primitive, with the surface's faces in their order. Normals and vertex colours come along, from
        the nearest points of the old surface.
    """
    corner = surface.position[surface.triangle].astype(np.float64)
    area = (
        0.5 * np.linalg.norm(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1).sum()
    )
    # An equilateral triangle of side s has the area sqrt(3) / 4 s^2.
    side = float(np.sqrt(4.0 / np.sqrt(3.0) * area / len(surface.triangle)))
    position, triangle = meshlab.remesh(surface.position, surface.triangle, side)
    # Values stand at corners, since vertices at creases have several normals for one place.
    arrays = plan.part.arrays
    soup = surface.position[surface.triangle].reshape(-1, 3)
    own = np.arange(len(soup)).reshape(-1, 3)
    normal = colour = None
    if arrays.normal is not None:
        value = arrays.normal[plan.triangle] if plan.normal is None else plan.normal
        normal = meshlab.transfer(soup, own, np.nan_to_num(value).reshape(-1, 3), position)
        normal = normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), np.float32(1e-20))
    if arrays.colour is not None:
        value = arrays.colour[plan.triangle].reshape(-1, 4)
        colour = np.clip(meshlab.transfer(soup, own, value, position), 0.0, 1.0)
    kept = {"POSITION", "NORMAL", "COLOR_0"}
    return Remeshing(
        ReplacedPrimitive(position, triangle, normal, colour),
        int(needles(surface.position, surface.triangle).sum()),
        int(needles(position, triangle).sum()),
        tuple(sorted(set(plan.part.column) - kept)),
    )
