"""Imports a baked scene into Unreal Engine (5.3 or newer): pages, meshes, and materials that show the pages.

Run it in the editor: Tools > Execute Python Script. Assets outside CONTENT are not changed.
"""

import json
import math
from pathlib import Path

import unreal

CONTENT = "/Game/Baker"
FOLDER = Path(__file__).parent

assets = unreal.AssetToolsHelpers.get_asset_tools()
editing = unreal.MaterialEditingLibrary


def import_file(path, destination):
    """Import one file and return the paths of the created assets."""
    task = unreal.AssetImportTask()
    task.filename, task.destination_path = str(path), destination
    task.automated, task.replace_existing, task.save = True, True, True
    assets.import_asset_tasks([task])
    return list(task.imported_object_paths)


def import_page(path):
    """Import a page as a linear HDR texture without mip levels, which would mix charts."""
    texture = unreal.load_asset(import_file(path, CONTENT + "/Pages")[0])
    texture.set_editor_property("srgb", False)
    texture.set_editor_property("compression_settings", unreal.TextureCompressionSettings.TC_HDR)
    texture.set_editor_property("mip_gen_settings", unreal.TextureMipGenSettings.TMGS_NO_MIPMAPS)
    texture.set_editor_property("address_x", unreal.TextureAddress.TA_CLAMP)
    texture.set_editor_property("address_y", unreal.TextureAddress.TA_CLAMP)
    unreal.EditorAssetLibrary.save_loaded_asset(texture)
    return texture


def make_function(page):
    """Create the material function MF_BakerLightmap, which maps base colour to base colour * E / pi."""
    function = assets.create_asset(
        "MF_BakerLightmap", CONTENT, unreal.MaterialFunction, unreal.MaterialFunctionFactoryNew()
    )

    def node(kind, x, y, **properties):
        expression = editing.create_material_expression_in_function(function, kind, x, y)
        for name, value in properties.items():
            expression.set_editor_property(name, value)
        return expression

    colour = node(unreal.MaterialExpressionFunctionInput, -600, -200, input_name="BaseColor")
    uv = node(unreal.MaterialExpressionTextureCoordinate, -1200, 0, coordinate_index=1)
    scale = node(
        unreal.MaterialExpressionVectorParameter,
        -1200,
        150,
        parameter_name="ScaleOffset",
        default_value=unreal.LinearColor(1.0, 1.0, 0.0, 0.0),
    )
    size = node(unreal.MaterialExpressionComponentMask, -1000, 150, r=True, g=True, b=False, a=False)
    # Compose the offset from the outputs B and A, because a vector parameter outputs alpha separately.
    start = node(unreal.MaterialExpressionAppendVector, -1000, 250)
    scaled = node(unreal.MaterialExpressionMultiply, -800, 0)
    placed = node(unreal.MaterialExpressionAdd, -700, 100)
    sample = node(
        unreal.MaterialExpressionTextureSampleParameter2D,
        -600,
        0,
        parameter_name="Page",
        texture=page,
        sampler_type=unreal.MaterialSamplerType.SAMPLERTYPE_LINEAR_COLOR,
    )
    exposure = node(
        unreal.MaterialExpressionScalarParameter, -600, 250, parameter_name="Exposure", default_value=1.0
    )
    over_pi = node(unreal.MaterialExpressionMultiply, -400, 200, const_b=1.0 / math.pi)
    lit = node(unreal.MaterialExpressionMultiply, -300, 0)
    shown = node(unreal.MaterialExpressionMultiply, -200, 0)
    result = node(unreal.MaterialExpressionFunctionOutput, 0, 0, output_name="Radiance")

    connect = editing.connect_material_expressions
    connect(scale, "", size, "")
    connect(scale, "B", start, "A")
    connect(scale, "A", start, "B")
    connect(uv, "", scaled, "A")
    connect(size, "", scaled, "B")
    connect(scaled, "", placed, "A")
    connect(start, "", placed, "B")
    connect(placed, "", sample, "UVs")
    connect(exposure, "", over_pi, "A")
    connect(sample, "RGB", lit, "A")
    connect(colour, "", lit, "B")
    connect(lit, "", shown, "A")
    connect(over_pi, "", shown, "B")
    connect(shown, "", result, "")
    editing.update_material_function(function)
    return function


def make_material(function):
    """Create the unlit material M_BakerLightmap, whose base colour is a texture times a factor."""
    material = assets.create_asset("M_BakerLightmap", CONTENT, unreal.Material, unreal.MaterialFactoryNew())
    material.set_editor_property("shading_model", unreal.MaterialShadingModel.MSM_UNLIT)
    call = editing.create_material_expression(
        material, unreal.MaterialExpressionMaterialFunctionCall, -300, 0
    )
    call.set_editor_property("material_function", function)
    factor = editing.create_material_expression(material, unreal.MaterialExpressionVectorParameter, -900, 100)
    factor.set_editor_property("parameter_name", "BaseColorFactor")
    factor.set_editor_property("default_value", unreal.LinearColor(1.0, 1.0, 1.0, 1.0))
    texture = editing.create_material_expression(
        material, unreal.MaterialExpressionTextureSampleParameter2D, -900, -200
    )
    texture.set_editor_property("parameter_name", "BaseColorTexture")
    texture.set_editor_property("texture", unreal.load_asset("/Engine/EngineResources/WhiteSquareTexture"))
    colour = editing.create_material_expression(material, unreal.MaterialExpressionMultiply, -600, 0)
    editing.connect_material_expressions(texture, "RGB", colour, "A")
    editing.connect_material_expressions(factor, "", colour, "B")
    editing.connect_material_expressions(colour, "", call, "BaseColor")
    editing.connect_material_property(call, "Radiance", unreal.MaterialProperty.MP_EMISSIVE_COLOR)
    editing.recompile_material(material)
    return material


def main():
    """Import pages and scene, and assign a material instance to each slot of each baked mesh."""
    bake = json.loads((FOLDER / "lightmap.json").read_text("utf-8"))
    pages = [import_page(FOLDER / page["file"]) for page in bake["pages"]]
    material = make_material(make_function(pages[0]))
    imported = import_file(FOLDER / bake["scene"], CONTENT + "/Scene")
    meshes = {path.rsplit(".", 1)[-1]: path for path in imported}
    for entry in bake["objects"]:
        mesh = unreal.load_asset(meshes[entry["name"]]) if entry["name"] in meshes else None
        if not isinstance(mesh, unreal.StaticMesh):
            unreal.log_warning("Baker: no static mesh is named " + entry["name"])
            continue
        mesh.set_editor_property("light_map_coordinate_index", 1)
        for slot, old in enumerate(mesh.get_editor_property("static_materials")):
            instance = assets.create_asset(
                "MI_{}_{}".format(entry["name"], slot),
                CONTENT + "/Materials",
                unreal.MaterialInstanceConstant,
                unreal.MaterialInstanceConstantFactoryNew(),
            )
            editing.set_material_instance_parent(instance, material)
            editing.set_material_instance_texture_parameter_value(instance, "Page", pages[entry["page"]])
            scale_offset = unreal.LinearColor(*entry["uv_scale"], *entry["uv_offset"])
            editing.set_material_instance_vector_parameter_value(instance, "ScaleOffset", scale_offset)
            copy_base_colour(old.material_interface, instance)
            mesh.set_material(slot, instance)
        unreal.EditorAssetLibrary.save_loaded_asset(mesh)


def copy_base_colour(old, instance):
    """Copy base colour texture and factor, if present, from the material that the glTF importer created."""
    if old is None:
        return
    for name in ("BaseColorTexture", "Base Color Texture"):
        texture = editing.get_material_instance_texture_parameter_value(old, name)
        if texture is not None:
            editing.set_material_instance_texture_parameter_value(instance, "BaseColorTexture", texture)
            break
    for name in ("BaseColorFactor", "Base Color Factor", "BaseColor"):
        factor = editing.get_material_instance_vector_parameter_value(old, name)
        if factor is not None and (factor.r, factor.g, factor.b) != (0.0, 0.0, 0.0):
            editing.set_material_instance_vector_parameter_value(instance, "BaseColorFactor", factor)
            break


main()
