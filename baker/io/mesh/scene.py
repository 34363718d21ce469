"""Builds a `Scene` from meshes of formats that define neither nodes nor a unit nor an up axis."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from baker.core.errors import InputError
from baker.core.scene import Instance, Material, Mesh, Scene, SceneWarning
from baker.core.source_mesh import SourceInstance, SourceMesh, SourcePrimitive, SourceScene
from baker.io.load import SceneFile
from baker.io.mesh.build import build_mesh, sound_meshes


def to_world(vector: NDArray[np.float64], up: str, scale: float) -> NDArray[np.float32]:
    """Transform vectors to +Y up and metres.

    Parameters
    ----------
    vector : (N, 3) float64
        Positions or directions in the axes of the file.
    up : str
        "y" leaves the axes as they are. "z" rotates by -90 degrees about x: (x, y, z) becomes (x, z, -y).
    scale : float
        Metres per unit.

    Returns
    -------
    (N, 3) float32
        The transformed vectors.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        turned = np.stack([vector[:, 0], vector[:, 2], -vector[:, 1]], axis=1) if up == "z" else vector
        scaled: NDArray[np.float32] = (turned * scale).astype(np.float32)
    return scaled


def scene_of_meshes(
    source: SceneFile,
    groups: Sequence[tuple[str, Sequence[SourcePrimitive]]],
    materials: Sequence[Material],
    warnings: Sequence[SceneWarning],
    sha256: str,
) -> Scene:
    """Build a scene with one mesh, one instance and one node for each named group of primitives.

    Parameters
    ----------
    source : SceneFile
        The file. Name and path of the scene come from it.
    groups : sequence of (str, sequence of SourcePrimitive)
        Name and primitives of each mesh, in world space.
    materials : sequence of Material
        Materials that the primitives refer to by index.
    warnings : sequence of SceneWarning
        Warnings to put before those about the meshes.
    sha256 : str
        Hash of the file and of all files that it refers to.

    Returns
    -------
    Scene
        The scene. Groups without a valid triangle are left out, with a warning if they have invalid ones.

    Raises
    ------
    InputError
        If no triangle is left, unless the source is read leniently.
    """
    found = list(warnings)
    meshes: list[Mesh] = []
    instances: list[Instance] = []
    sound = sound_meshes([primitives for _, primitives in groups])
    for (name, primitives), valid in zip(groups, sound, strict=True):
        mesh, defects = build_mesh(name, primitives, materials, sound=valid)
        found += defects
        if mesh is not None:
            instances.append(Instance(len(meshes), name, len(meshes), np.eye(4)))
            meshes.append(mesh)
        elif any(len(p.triangle) for p in primitives):
            found.append(
                SceneWarning("no-triangles", "the mesh has no usable triangle and is left out", name)
            )
    if not meshes and not source.lenient:
        detail = "; ".join(f"{w.object}: {w.message}" if w.object else w.message for w in found[:3])
        why = f" ({detail})" if detail else ""
        message = f"there is nothing to bake: the file holds no usable triangle{why}"
        raise InputError(message, file=str(source.path))
    return Scene(
        name=source.path.name.split(".")[0],
        path=source.path,
        meshes=tuple(meshes),
        materials=tuple(materials),
        instances=tuple(instances),
        warnings=tuple(found),
        sha256=sha256,
        source_scene=_source_scene(groups) if source.lenient else None,
    )


def _source_scene(groups: Sequence[tuple[str, Sequence[SourcePrimitive]]]) -> SourceScene:
    meshes = tuple(SourceMesh(name, tuple(primitives)) for name, primitives in groups)
    instances = tuple(SourceInstance(k, mesh.name, k, np.eye(4)) for k, mesh in enumerate(meshes))
    return SourceScene(meshes, instances)
