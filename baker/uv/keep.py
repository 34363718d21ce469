"""Tests whether TEXCOORD_1 of a mesh is a valid lightmap uv, and finds the charts of kept uv."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baker.core.errors import InputError
from baker.core.scene import Mesh, Scene, SceneWarning
from baker.topology.weld import connected_vertices, weld
from baker.uv.check import MOST_LOST, PAGE_TOLERANCE, RANGE_SLACK, page_overlap, uv_area


@dataclass(frozen=True)
class KeptUv:
    """Which of the I instances of a scene can keep their TEXCOORD_1.

    Attributes
    ----------
    usable : (I,) bool
        Whether TEXCOORD_1 of the instance is a valid lightmap uv. Overlap with other instances is not tested.
    together : bool
        Whether all instances fit one page with their TEXCOORD_1, without overlap. TEXCOORD_1 is then kept
        unchanged.
    warnings : tuple of SceneWarning
        One warning for each mesh that has a TEXCOORD_1 which is not valid.
    """

    usable: NDArray[np.bool_]
    together: bool
    warnings: tuple[SceneWarning, ...]


def lightmap_uv(mesh: Mesh) -> NDArray[np.float32] | None:
    """Return the TEXCOORD_1 (V, 2) float32 of a mesh, or None if it has none."""
    return mesh.texcoord[1] if len(mesh.texcoord) > 1 else None


def find_fault(mesh: Mesh, resolution: int) -> tuple[str, str] | None:
    """Return the reason why the TEXCOORD_1 of a mesh is not a valid lightmap uv.

    Parameters
    ----------
    mesh : Mesh
        The mesh, which need not have TEXCOORD_1.
    resolution : int
        Width of the page in texels. It determines the number of samples of the overlap test, and the area of
        a texel, which the uv area of a valid TEXCOORD_1 exceeds.

    Returns
    -------
    (str, str) or None
        Code of a warning, and the reason as a clause that starts with "it", "its" or a percentage. None if
        TEXCOORD_1 is valid.
    """
    uv = lightmap_uv(mesh)
    if uv is None:
        return "uv.missing", "it has no TEXCOORD_1"
    used = uv[mesh.triangle]
    if not np.isfinite(used).all():
        return "uv.not_finite", "its TEXCOORD_1 holds values that are not finite"
    low, high = float(used.min(initial=0.0)), float(used.max(initial=0.0))
    if low < -RANGE_SLACK or high > 1.0 + RANGE_SLACK:
        return "uv.out_of_range", f"its TEXCOORD_1 reaches from {low:.4g} to {high:.4g}, outside 0 to 1"
    area = uv_area(used)
    if not float(area.sum()) * resolution * resolution > 1.0:
        return "uv.degenerate", f"its TEXCOORD_1 covers less than one texel of a page of {resolution}"
    corner = mesh.position[mesh.triangle].astype(np.float64)
    real = np.linalg.norm(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1)
    lost = float(real[area == 0].sum()) / max(float(real.sum()), 1e-300)
    if lost > MOST_LOST:
        return "uv.degenerate", f"{100 * lost:.3g}% of its surface has no area in TEXCOORD_1"
    overlap = page_overlap(used, np.zeros(len(used), np.int64), resolution)
    if overlap.overlaps(PAGE_TOLERANCE)[0]:
        share = 100.0 * overlap.doubled[0] / overlap.covered[0]
        return "uv.overlap", f"its TEXCOORD_1 overlaps itself by {share:.3g}%"
    return None


def choose_kept(scene: Scene, resolution: int, mode: str) -> KeptUv:
    """Find the instances whose TEXCOORD_1 can be kept.

    Parameters
    ----------
    scene : Scene
        The scene.
    resolution : int
        Page width in texels.
    mode : str
        The setting `uv`: "auto", "keep" or "unwrap". An object's setting `uv` overrides it.

    Returns
    -------
    KeptUv
        The instances, and warnings.

    Raises
    ------
    InputError
        In mode "keep", for the first object whose TEXCOORD_1 cannot be used.
    """
    n = len(scene.instances)
    usable = np.zeros(n, bool)
    warnings: list[SceneWarning] = []
    modes = [instance.settings.uv or mode for instance in scene.instances]
    tested = {i.mesh for i, own in zip(scene.instances, modes, strict=True) if own != "unwrap"}
    fault = {m: find_fault(scene.meshes[m], resolution) for m in sorted(tested)}
    warned: set[int] = set()
    for k, (instance, own) in enumerate(zip(scene.instances, modes, strict=True)):
        if own == "unwrap":
            continue
        found = fault[instance.mesh]
        usable[k] = found is None
        if found is None:
            continue
        code, why = found
        name = instance.name or scene.meshes[instance.mesh].name
        if own == "keep":
            raise InputError(
                f"the lightmap uv cannot be kept, because {why}; repair it or use `uv='auto'`"
                " or `uv='unwrap'`",
                file=str(scene.path) if scene.path else None,
                object=name,
            )
        if code != "uv.missing" and instance.mesh not in warned:
            warned.add(instance.mesh)
            warnings.append(SceneWarning(code, f"'{name}' is unwrapped, because {why}", name))
    # An object's density changes the size of its layout, so the layouts of all objects are packed again.
    resized = any(instance.settings.resized for instance in scene.instances)
    together = bool(n) and bool(usable.all()) and not resized and _disjoint(scene, resolution)
    return KeptUv(usable, together, tuple(warnings))


def _disjoint(scene: Scene, resolution: int) -> bool:
    """Return whether the TEXCOORD_1 of all instances fit one page without overlap.

    False if two instances have the same mesh.
    """
    if len({i.mesh for i in scene.instances}) < len(scene.instances):
        return False
    uv, group = [], []
    for k, instance in enumerate(scene.instances):
        own = lightmap_uv(scene.meshes[instance.mesh])
        assert own is not None
        uv.append(own[scene.meshes[instance.mesh].triangle])
        group.append(np.full(len(uv[-1]), k, np.int64))
    overlap = page_overlap(np.concatenate(uv), np.concatenate(group), resolution)
    return not overlap.overlaps(PAGE_TOLERANCE).any()


def kept_charts(mesh: Mesh) -> NDArray[np.int32]:
    """Return the chart (T,) int32 of each triangle of a mesh with kept uv.

    The triangles of a chart are connected by vertices with equal position and equal uv.
    """
    uv = lightmap_uv(mesh)
    assert uv is not None
    label = weld(mesh.position, uv)
    return connected_vertices(label[mesh.triangle], len(label))


def close_charts(
    uv: Sequence[NDArray[np.floating]], chart: Sequence[NDArray[np.int32]], resolution: int, gap: int
) -> int:
    """Count the texels of one page that have a texel of another chart within `gap` texels.

    Parameters
    ----------
    uv : sequence of (T, 3, 2) float
        For each instance, page uv of its triangles' corners.
    chart : sequence of (T,) int32
        For each instance, charts of its triangles, numbered over all instances.
    resolution : int
        Page width in texels.
    gap : int
        Largest distance between the two texels, in rows and in columns.

    Returns
    -------
    int
        Number of texels.
    """
    from baker.uv.kernels.uv_overlap import count_close, mark_charts

    owner = np.zeros((resolution, resolution), np.int32)
    for corner, number in zip(uv, chart, strict=True):
        mark_charts(np.asarray(corner, np.float64) * resolution, number.astype(np.int32), owner)
    return int(count_close(owner, gap))
