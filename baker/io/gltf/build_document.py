"""Builds a glTF document from a `Scene` alone, without a source document.

The nodes are the instances, sorted by `Instance.node`, followed by the lights. Each node is a root, so its
matrix is its world matrix. Colour factors are linear, and textures are embedded as PNG.

Based on: Khronos Group, glTF 2.0 specification; KHR_lights_punctual, KHR_materials_emissive_strength,
KHR_texture_transform.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from baker.core.atlas import Atlas, InstanceLayout
from baker.core.errors import InputError
from baker.core.light_kind import kind_of
from baker.core.scene import Instance, Material, Mesh, PunctualLight, Scene, Texture
from baker.io.gltf.ao_materials import BakedUse
from baker.io.gltf.packer import Json, Packer
from baker.io.png import encode_png, srgb_levels

_WRAP = {"repeat": 10497, "mirror": 33648, "clamp": 33071}
_NEAREST = 9728


def new_document(scene: Scene, atlas: Atlas) -> tuple[Packer, list[BakedUse], list[int]]:
    """Build a document with lightmap uv.

    Parameters
    ----------
    scene : Scene
        The baked scene.
    atlas : Atlas
        The lightmap uv of the scene, one layout for each instance.

    Returns
    -------
    packer : Packer
        The document with its data.
    uses : list of BakedUse
        The document's primitives, which all have lightmap uv. Instances that share TEXCOORD_1 have the same
        primitives.
    instance_mesh : list of int
        Index of each instance's mesh in the document.
    """
    document: Json = {"asset": {"version": "2.0", "generator": "baker"}}
    packer = Packer(document)
    extensions: set[str] = set()
    images: dict[int, int] = {}
    written = [m for m in scene.materials if m.original is None]
    if written:
        document["materials"] = [material_json(packer, m, images, extensions) for m in written]
    everything = [*scene.instances, *scene.left_out]
    order = sorted(range(len(everything)), key=lambda i: (everything[i].node, i))
    uses: list[BakedUse] = []
    instance_mesh = [0] * len(order)
    nodes, meshes = document.setdefault("nodes", []), document.setdefault("meshes", [])
    of_shared: dict[int, int] = {}
    for index in order:
        instance = everything[index]
        layout = atlas.layouts[index] if index < len(atlas.layouts) else None
        mesh = _with_original_materials(scene, scene.meshes[instance.mesh])
        node, shown = _node(instance, mesh)
        mirrored = shown is not mesh and _mirrors(instance)
        number = -1
        if layout is None or not layout.receives:
            primitives = _primitives(packer, shown, _plain_layout(shown), mirrored=mirrored)
            for primitive in primitives:
                unused = primitive["attributes"].pop("TEXCOORD_1")
                if primitive["attributes"]["TEXCOORD_0"] == unused:
                    del primitive["attributes"]["TEXCOORD_0"]
            meshes.append({"name": mesh.name, "primitives": primitives})
        else:
            if layout.shared is not None and shown is mesh:
                number = layout.shared.number
            if number not in of_shared:
                primitives = _primitives(packer, shown, layout, mirrored=mirrored)
                uses += [BakedUse(primitive, layout.page, shared=layout.shared) for primitive in primitives]
                meshes.append({"name": mesh.name, "primitives": primitives})
        instance_mesh[index] = of_shared.get(number, len(meshes) - 1)
        nodes.append({**node, "mesh": instance_mesh[index]})
        if number >= 0:
            of_shared[number] = instance_mesh[index]
    if scene.lights:
        extensions.add("KHR_lights_punctual")
        document["extensions"] = {
            "KHR_lights_punctual": {"lights": [_light(light) for light in scene.lights]}
        }
        for number, light in enumerate(scene.lights):
            nodes.append(
                {
                    "name": light.name,
                    "translation": list(light.position),
                    "rotation": _turn_from_minus_z(light.direction),
                    "extensions": {"KHR_lights_punctual": {"light": number}},
                }
            )
    document["scenes"] = [{**scene_name(scene), "nodes": list(range(len(nodes)))}]
    document["scene"] = 0
    if extensions:
        document["extensionsUsed"] = sorted(extensions)
    return packer, uses, instance_mesh[: len(scene.instances)]


def _with_original_materials(scene: Scene, mesh: Mesh) -> Mesh:
    """Return the mesh with the materials of the file in place of copies that settings of objects change."""
    number = [k if m.original is None else m.original for k, m in enumerate(scene.materials)]
    if number == list(range(len(number))):
        return mesh
    return replace(mesh, material=np.array(number, np.int32)[mesh.material])


def _plain_layout(mesh: Mesh) -> InstanceLayout:
    """Return the layout of a mesh without lightmap uv."""
    n, n_triangles = len(mesh.position), len(mesh.triangle)
    vertex, chart = np.arange(n, dtype=np.int32), np.zeros(n_triangles, np.int32)
    uv = np.zeros((n, 2), np.float32)
    return InstanceLayout(0, 0, vertex, uv, mesh.triangle, chart, False, 0.0, receives=False)


def scene_name(scene: Scene) -> Json:
    """Return the name of a scene as glTF JSON, or {} if the scene was read from a file.

    The name of a scene that was read is the name of its file. It is left out, so that the same scene under
    another file name gives the same bytes.

    Parameters
    ----------
    scene : Scene
        The scene.

    Returns
    -------
    dict
        `{"name": ...}` or {}.
    """
    return {"name": scene.name} if scene.path is None else {}


def _mirrors(instance: Instance) -> bool:
    return bool(np.linalg.det(instance.world_from_object[:3, :3]) < 0)


def _node(instance: Instance, mesh: Mesh) -> tuple[Json, Mesh]:
    """Return an instance's node and mesh; if the matrix has shear, the mesh is moved to world space."""
    matrix = np.asarray(instance.world_from_object, np.float64)
    if np.array_equal(matrix, np.eye(4)):
        return {"name": instance.name}, mesh
    linear = matrix[:3, :3]
    product = linear.T @ linear
    if np.abs(product - np.diag(np.diag(product))).max() <= 1e-6 * np.abs(product).max():
        return {"name": instance.name, "matrix": matrix.T.ravel().tolist()}, mesh
    # T R S cannot represent shear, so transform the mesh to world space.
    position = mesh.position.astype(np.float64) @ linear.T + matrix[:3, 3]
    normal = mesh.normal.astype(np.float64) @ np.linalg.inv(linear)
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-30)
    moved = replace(mesh, position=position.astype(np.float32), normal=normal.astype(np.float32))
    return {"name": instance.name}, moved


def _primitives(packer: Packer, mesh: Mesh, layout: InstanceLayout, *, mirrored: bool) -> list[Json]:
    """Return one primitive for each material of an instance; `mirrored` reverses the winding."""
    primitives = []
    for material in np.unique(mesh.material).tolist():
        used, corner = np.unique(layout.triangle[mesh.material == material], return_inverse=True)
        vertex = layout.vertex[used]
        attributes = {
            "POSITION": packer.add_floats(mesh.position[vertex], bounds=True),
            "NORMAL": packer.add_floats(mesh.normal[vertex]),
            "TEXCOORD_1": packer.add_floats(layout.texcoord_1[used]),
        }
        first = mesh.texcoord[0] if mesh.texcoord else None
        attributes["TEXCOORD_0"] = (
            attributes["TEXCOORD_1"] if first is None else packer.add_floats(first[vertex])
        )
        if mesh.colour is not None:
            attributes["COLOR_0"] = packer.add_floats(mesh.colour[vertex])
        triangle = corner.reshape(-1, 3)
        indices = packer.add_indices(triangle[:, ::-1] if mirrored else triangle)
        primitives.append({"attributes": attributes, "indices": indices, "material": material})
    return primitives


def material_json(packer: Packer, material: Material, images: dict[int, int], extensions: set[str]) -> Json:
    """Return a material as glTF JSON.

    Parameters
    ----------
    packer : Packer
        The material's images are added to it.
    material : Material
        The material.
    images : dict of int to int
        `id` of the pixel array to index of the embedded image; new images are added.
    extensions : set of str
        Names of the extensions in use; the extensions of this material are added.

    Returns
    -------
    dict
        glTF JSON.
    """
    surface: Json = {
        "baseColorFactor": [min(max(float(v), 0.0), 1.0) for v in material.base_colour],
        "metallicFactor": min(max(float(material.metallic), 0.0), 1.0),
        "roughnessFactor": min(max(float(material.roughness), 0.0), 1.0),
    }
    result: Json = {"name": material.name, "pbrMetallicRoughness": surface}
    if material.base_colour_texture is not None:
        surface["baseColorTexture"] = _texture(packer, material.base_colour_texture, images, extensions)
    if any(material.emission):
        # The components of `emissiveFactor` are at most 1. Divide by the largest one if it is above 1.
        strength = max(1.0, *map(float, material.emission))
        result["emissiveFactor"] = [max(float(v), 0.0) / strength for v in material.emission]
        if strength > 1.0:
            extensions.add("KHR_materials_emissive_strength")
            result["extensions"] = {"KHR_materials_emissive_strength": {"emissiveStrength": strength}}
        if material.emission_texture is not None:
            result["emissiveTexture"] = _texture(packer, material.emission_texture, images, extensions)
    if material.double_sided:
        result["doubleSided"] = True
    if material.alpha_mode != "OPAQUE":
        result["alphaMode"] = material.alpha_mode
    if material.alpha_mode == "MASK":
        result["alphaCutoff"] = float(material.alpha_cutoff)
    return result


def _texture(packer: Packer, texture: Texture, images: dict[int, int], extensions: set[str]) -> Json:
    """Embed a texture, and return the texture info that refers to it."""
    document = packer.document
    if id(texture.image) not in images:
        pixels = texture.image
        if pixels.dtype != np.uint8:
            alpha = np.rint(np.clip(pixels[..., 3:], 0, 1) * 255).astype(np.uint8)
            pixels = np.concatenate([srgb_levels(pixels[..., :3]), alpha], axis=-1)
        view = packer.add_bytes(encode_png(pixels))
        document.setdefault("images", []).append({"bufferView": view, "mimeType": "image/png"})
        images[id(texture.image)] = len(document["images"]) - 1
    sampler = {"wrapS": _WRAP[texture.wrap[0]], "wrapT": _WRAP[texture.wrap[1]]}
    if texture.nearest:
        sampler["magFilter"] = _NEAREST
    samplers = document.setdefault("samplers", [])
    if sampler not in samplers:
        samplers.append(sampler)
    document.setdefault("textures", []).append(
        {"sampler": samplers.index(sampler), "source": images[id(texture.image)]}
    )
    info: Json = {"index": len(document["textures"]) - 1}
    if texture.texcoord:
        info["texCoord"] = texture.texcoord
    if not np.array_equal(texture.transform, np.eye(2, 3)):
        extensions.add("KHR_texture_transform")
        info["extensions"] = {"KHR_texture_transform": _texture_transform(texture.transform)}
    return info


def _texture_transform(matrix: NDArray[np.float64]) -> Json:
    """Decompose a (2, 3) matrix T R S, with R = [[c, s], [-s, c]], into offset, rotation and scale."""
    (a, b, x), (c, d, y) = matrix.tolist()
    angle = math.atan2(-c, a)
    scale = [math.hypot(a, c), d * math.cos(angle) + b * math.sin(angle)]
    return {"offset": [x, y], "rotation": angle, "scale": scale}


def _light(light: PunctualLight) -> Json:
    kind = kind_of(light)
    if kind.gltf_type is None:
        message = f"KHR_lights_punctual has no {kind.name} lights, so a glTF file cannot hold it"
        raise InputError(message, object=f"light '{light.name}'")
    strength = max(*light.intensity, 1e-30)
    result: Json = {
        "type": kind.gltf_type,
        "name": light.name,
        "color": [float(v) / strength for v in light.intensity],
        "intensity": float(strength),
    }
    return result | kind.write(light)


def _turn_from_minus_z(direction: tuple[float, float, float]) -> list[float]:
    """Return the quaternion x, y, z, w that rotates -Z, the axis of glTF lights, to `direction`."""
    x, y, z = (float(v) for v in np.asarray(direction) / np.linalg.norm(direction))
    if z > 1.0 - 1e-12:
        return [0.0, 1.0, 0.0, 0.0]
    # Half-way quaternion (u x v, 1 + u.v), normalised, with u = (0, 0, -1) and v = `direction`.
    quaternion = np.array([y, -x, 0.0, 1.0 - z])
    return [float(v) for v in quaternion / np.linalg.norm(quaternion)]
