"""Converts a scene of the reference path tracer to Mitsuba 3, with the same triangles.

Only features with the same meaning in both programs are converted: Lambertian fronts with constant or
textured colours and constant emission, black backs, flat normals, and point and directional lights. Callers
must first choose a variant with `mitsuba.set_variant`.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import mitsuba as mi
import numpy as np

from baker.core.scene import Camera, Scene
from baker.kernels.textures import STORAGE, decoded, level_rows
from baker.pathtracer.scene import FACE, SHADING, Reference


def flat(reference: Reference) -> Reference:
    """Return the reference with face normals as shading normals."""
    row = reference.surfaces.row.copy()
    row[:, SHADING : SHADING + 9] = np.tile(row[:, FACE : FACE + 3], 3)
    return replace(reference, surfaces=reference.surfaces._replace(row=row))


def mitsuba_scene(scene: Scene, reference: Reference, **more: Any) -> Any:
    """Return the Mitsuba scene; `more` are additional objects, by their name in Mitsuba's dictionary.

    Raises
    ------
    ValueError
        If the scene has a feature that is not converted.
    """
    geometry, shading = reference.geometry, reference.shading
    if geometry.double_sided.any() or len(shading.alpha.slot) or len(shading.colour) > 1:
        raise ValueError("two-sided, transparent and vertex-coloured surfaces are not handed over")
    if (shading.emission_texture >= 0).any():
        raise ValueError("textured emission is not handed over")
    parts: dict[str, Any] = {"type": "scene", **more}
    for m in np.unique(geometry.material):
        vertex = geometry.triangle[geometry.material == m].ravel()
        properties = mi.Properties()
        properties["bsdf"] = mi.load_dict({"type": "diffuse", "reflectance": _colour(shading, m)})
        if shading.emission[m].any():
            radiance = {"type": "rgb", "value": shading.emission[m].tolist()}
            properties["emitter"] = mi.load_dict({"type": "area", "radiance": radiance})
        mesh = mi.Mesh(
            f"material{m}", len(vertex), len(vertex) // 3, has_vertex_texcoords=True, props=properties
        )
        values = mi.traverse(mesh)
        values["vertex_positions"] = geometry.position[vertex].astype(np.float32).ravel()
        if len(shading.base_uv) > 1:
            values["vertex_texcoords"] = shading.base_uv[vertex].astype(np.float32).ravel()
        values["faces"] = np.arange(len(vertex), dtype=np.uint32)
        values.update()
        parts[f"material{m}"] = mesh
    for k, light in enumerate(scene.lights):
        colour = {"type": "rgb", "value": list(light.intensity)}
        if light.kind == "point":
            parts[f"light{k}"] = {"type": "point", "position": list(light.position), "intensity": colour}
        elif light.kind == "directional":
            parts[f"light{k}"] = {
                "type": "directional",
                "direction": list(light.direction),
                "irradiance": colour,
            }
        else:
            raise ValueError("Mitsuba's spots fall off in another way than glTF's")
    # Switch optimisation off: it merges equal objects, but an irradiance meter can have only one parent.
    return mi.load_dict(parts, optimize=False)


def mitsuba_camera(camera: Camera, width: int, height: int) -> dict[str, Any]:
    """Return Mitsuba's description of the same pinhole camera, with a box filter of one pixel."""
    target = np.add(camera.position, camera.forward)
    return {
        "type": "perspective",
        "fov": float(np.degrees(camera.fov)),
        "fov_axis": "y",
        "near_clip": 1e-3,
        "to_world": mi.ScalarTransform4f().look_at(
            list(camera.position), target.tolist(), list(camera.up)
        ),
        "film": {
            "type": "hdrfilm", "width": width, "height": height, "rfilter": {"type": "box"},
            "pixel_format": "rgb", "component_format": "float32",
        },
        "sampler": {"type": "independent"},
    }  # fmt: skip


def _colour(shading: Any, m: int) -> dict[str, Any]:
    base = shading.base[m].astype(float)
    number = shading.base_texture[m]
    if number < 0:
        return {"type": "rgb", "value": base.tolist()}
    pack = shading.pack
    _, width, height = pack.level[number, 0]
    texel = decoded(level_rows(pack, number, 0), int(pack.wrap[number, STORAGE]))
    pixel = texel[:, :3].reshape(height, width, 3) * base
    wrap = {0: "repeat", 1: "mirror", 2: "clamp"}[int(pack.wrap[number, 0])]
    return {
        "type": "bitmap", "bitmap": mi.Bitmap(np.ascontiguousarray(pixel, np.float32)), "raw": True,
        "wrap_mode": wrap,
    }  # fmt: skip
