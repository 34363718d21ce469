"""Imports a baked scene into Blender (4.2 or newer) and replaces its lights by the irradiance pages.

    blender --python import_lightmaps.py

For each page that the objects of a material use, the material is copied. The copy emits the radiance of the
surface: base colour x irradiance / pi, plus the emission of the material.
"""

import json
import math
from pathlib import Path

import bpy


def load(folder, exposure=1.0):
    """Import the bake in `folder`; multiply all light by `exposure`; return the objects with lightmaps."""
    folder = Path(folder)
    bake = json.loads((folder / "lightmap.json").read_text("utf-8"))
    before = set(bpy.data.objects)
    bpy.ops.import_scene.gltf(filepath=str(folder / bake["scene"]))
    images = [page_image(folder / page["file"]) for page in bake["pages"]]
    by_node = {entry["node"]: entry for entry in bake["objects"]}
    by_name = {entry["name"]: entry for entry in bake["objects"]}
    copies, lit = {}, []
    for item in sorted(set(bpy.data.objects) - before, key=lambda item: item.name):
        if item.type == "LIGHT":
            # The pages contain the contribution of this light.
            item.hide_render = item.hide_viewport = True
        entry = by_node.get(item.get("baker_node")) or by_name.get(item.name)
        if item.type != "MESH" or entry is None:
            continue
        uv = item.data.uv_layers[1].name
        if not item.data.materials:
            item.data.materials.append(bpy.data.materials.new("default"))
        for slot in item.material_slots:
            material = slot.material or bpy.data.materials.new("default")
            key = (material.name, entry["page"], *entry["uv_scale"], *entry["uv_offset"], uv)
            if key not in copies:
                copies[key] = lit_material(material, images[entry["page"]], uv, entry, exposure)
            if item.data.users > 1:
                # The objects of a mesh have different places in the pages, so the object has the material.
                slot.link = "OBJECT"
            slot.material = copies[key]
        lit.append(item)
    return lit


def page_image(path):
    """Load a page without conversion of its colours."""
    image = bpy.data.images.load(str(path))
    image.colorspace_settings.name = "Non-Color"
    return image


def lit_material(material, image, uv, entry, exposure):
    """Return a copy of a material that shows base colour x irradiance / pi."""
    copy = material.copy()
    copy.use_nodes = True
    nodes, links = copy.node_tree.nodes, copy.node_tree.links
    output = next(node for node in nodes if node.type == "OUTPUT_MATERIAL" and node.is_active_output)
    surface = next((node for node in nodes if node.type == "BSDF_PRINCIPLED"), None)

    mapping = nodes.new("ShaderNodeMapping")
    scale, offset = entry["uv_scale"], entry["uv_offset"]
    mapping.inputs["Scale"].default_value = (scale[0], scale[1], 1.0)
    # v = 0 is the bottom in Blender: 1 - ((1 - v) * scale + offset) = v * scale + (1 - scale - offset).
    mapping.inputs["Location"].default_value = (offset[0], 1.0 - scale[1] - offset[1], 0.0)
    source = nodes.new("ShaderNodeUVMap")
    source.uv_map = uv
    links.new(source.outputs["UV"], mapping.inputs["Vector"])
    page = nodes.new("ShaderNodeTexImage")
    page.image, page.interpolation, page.extension = image, "Linear", "EXTEND"
    links.new(mapping.outputs["Vector"], page.inputs["Vector"])

    product = nodes.new("ShaderNodeVectorMath")
    product.operation = "MULTIPLY"
    links.new(page.outputs["Color"], product.inputs[0])
    feed(links, surface, "Base Color", product.inputs[1], (0.8, 0.8, 0.8))
    light = nodes.new("ShaderNodeEmission")
    light.inputs["Strength"].default_value = exposure / math.pi
    links.new(product.outputs["Vector"], light.inputs["Color"])
    shown = light.outputs["Emission"]
    if surface is not None:
        emission, strength = nodes.new("ShaderNodeEmission"), nodes.new("ShaderNodeMath")
        strength.operation = "MULTIPLY"
        strength.inputs[1].default_value = exposure
        feed(links, surface, "Emission Color", emission.inputs["Color"], (0.0, 0.0, 0.0))
        feed(links, surface, "Emission Strength", strength.inputs[0], 0.0)
        links.new(strength.outputs["Value"], emission.inputs["Strength"])
        both = nodes.new("ShaderNodeAddShader")
        links.new(shown, both.inputs[0])
        links.new(emission.outputs["Emission"], both.inputs[1])
        shown = both.outputs["Shader"]
        if surface.inputs["Alpha"].is_linked or surface.inputs["Alpha"].default_value < 1.0:
            clear, mix = nodes.new("ShaderNodeBsdfTransparent"), nodes.new("ShaderNodeMixShader")
            feed(links, surface, "Alpha", mix.inputs["Fac"], 1.0)
            links.new(clear.outputs["BSDF"], mix.inputs[1])
            links.new(shown, mix.inputs[2])
            shown = mix.outputs["Shader"]
    links.new(shown, output.inputs["Surface"])
    return copy


def feed(links, node, name, target, fallback):
    """Connect `target` to the source of the input `name` of `node`, or copy the input's value."""
    socket = None if node is None else node.inputs.get(name)
    if socket is not None and socket.is_linked:
        links.new(socket.links[0].from_socket, target)
        return
    value = fallback if socket is None else socket.default_value
    size = len(target.default_value) if hasattr(target.default_value, "__len__") else 0
    if not size:
        target.default_value = value
        return
    value = [*value, 1.0, 1.0, 1.0, 1.0][:size] if len(value) < size else list(value)[:size]
    target.default_value = value


if __name__ == "__main__":
    load(Path(__file__).parent if "__file__" in globals() else Path(bpy.data.filepath).parent)
