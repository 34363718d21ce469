"""Changes the materials of objects as their settings require, without changes for other objects.

The keys `double_sided` and `emissive` change materials. Objects with `cast = false` do not emit either. Light
of emitters is estimated by shadow rays together with hemisphere rays that hit emitters, and no ray hits such
an object.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from baker.core.scene import Instance, Material, Mesh, Scene, SceneWarning


def with_object_materials(scene: Scene) -> Scene:
    """Return the scene in which the objects' settings `double_sided`, `emissive` and `cast` are applied.

    Parameters
    ----------
    scene : Scene
        The scene, with the settings of its instances.

    Returns
    -------
    Scene
        Changed materials are appended; their `original` is the index of the material that they replace. The
        meshes of objects that use them are copied.
    """
    materials, meshes = list(scene.materials), list(scene.meshes)
    number: dict[tuple[int, bool | None, bool], int] = {}
    copies: dict[tuple[int, bool | None, bool], int] = {}
    instances: list[Instance] = []
    warnings: list[SceneWarning] = []
    for instance in scene.instances:
        settings, mesh = instance.settings, meshes[instance.mesh]
        dark = not (settings.emissive and settings.cast)
        changed = {}
        for index in np.unique(mesh.material).tolist():
            material = _changed(materials[index], settings.double_sided, dark=dark)
            if material is not materials[index]:
                key = (index, settings.double_sided, dark)
                if key not in number:
                    number[key] = len(materials)
                    materials.append(replace(material, original=index))
                changed[index] = number[key]
                if settings.emissive and not settings.cast and max(materials[index].emission) > 0.0:
                    warnings.append(_no_emission(instance.name))
        if changed:
            key = (instance.mesh, settings.double_sided, dark)
            if key not in copies:
                copies[key] = len(meshes)
                meshes.append(_copy(mesh, changed))
            instance = replace(instance, mesh=copies[key])
        instances.append(instance)
    if len(meshes) == len(scene.meshes):
        return scene
    used = sorted({i.mesh for i in instances} | {i.mesh for i in scene.left_out if i.mesh >= 0})
    renumbered = {old: new for new, old in enumerate(used)}
    return replace(
        scene,
        materials=tuple(materials),
        meshes=tuple(meshes[k] for k in used),
        instances=tuple(replace(i, mesh=renumbered[i.mesh]) for i in instances),
        left_out=tuple(replace(i, mesh=renumbered.get(i.mesh, -1)) for i in scene.left_out),
        warnings=(*scene.warnings, *dict.fromkeys(warnings)),
    )


def _changed(material: Material, double_sided: bool | None, *, dark: bool) -> Material:
    """Return the material with other sidedness or without emission; the same object if nothing changes."""
    if dark and max(material.emission) > 0.0:
        material = replace(material, emission=(0.0, 0.0, 0.0), emission_texture=None)
    if double_sided is not None and material.double_sided != double_sided:
        material = replace(material, double_sided=double_sided)
    return material


def _copy(mesh: Mesh, changed: dict[int, int]) -> Mesh:
    """Return a mesh with other materials: `changed` has the new index of each material that is replaced."""
    table = np.arange(int(mesh.material.max()) + 1, dtype=np.int32)
    for old, new in changed.items():
        table[old] = new
    return replace(mesh, material=table[mesh.material])


def _no_emission(name: str) -> SceneWarning:
    message = f"'{name}' has an emissive material, and emits nothing because of cast=false"
    return SceneWarning("cast-emission", message, name)
