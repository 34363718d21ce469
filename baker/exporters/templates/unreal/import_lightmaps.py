"""Imports a baked scene into the open level of Unreal Engine (5.3 or newer), with materials that show pages.

Run it in the editor: Tools > Execute Python Script. The assets of a level are in /Game/Baker/<path of level>,
and the materials that all levels share in /Game/Baker. Run it again after every bake: assets and actors that
it made are updated without questions. It changes and removes only these.
"""

import json
import math
from pathlib import Path

import unreal

ROOT = "/Game/Baker"
FOLDER = Path(__file__).parent
# First tag of the actors that this script has made; the second tag is the name of the object.
TAG = "BakerLightmap"
# Part of the names of shared assets. It changes with the graphs of the materials.
VERSION = "2"
# White textures for parameters without a texture: the first for pages, the second for colours.
DEFAULT_PAGE, WHITE = "T_BakerPage", "T_BakerWhite"

TOOLS = unreal.AssetToolsHelpers.get_asset_tools()
EDIT = unreal.MaterialEditingLibrary
ASSETS = unreal.EditorAssetLibrary

BLEND = {
    "opaque": unreal.BlendMode.BLEND_OPAQUE,
    "masked": unreal.BlendMode.BLEND_MASKED,
    "translucent": unreal.BlendMode.BLEND_TRANSLUCENT,
}
ADDRESS = {
    "repeat": unreal.TextureAddress.TA_WRAP,
    "clamp": unreal.TextureAddress.TA_CLAMP,
    "mirror": unreal.TextureAddress.TA_MIRROR,
}
# glTF's default material, for slots without a material.
NO_TEXTURE = {"file": None, "uv_set": 0, "scale_offset": [1.0, 1.0, 0.0, 0.0], "turned": False}
DEFAULT = {
    "name": "default",
    "blend": "opaque",
    "two_sided": False,
    "alpha_cutoff": 0.5,
    "base_color": [1.0, 1.0, 1.0, 1.0],
    "base_color_texture": NO_TEXTURE,
    "emission": [0.0, 0.0, 0.0],
    "emission_texture": NO_TEXTURE,
}


def level_folder():
    """Return the folder of the open level's assets, which no other level has."""
    world = unreal.get_editor_subsystem(unreal.UnrealEditorSubsystem).get_editor_world()
    path = world.get_path_name().split(".")[0]
    if path.startswith("/Temp/"):
        raise RuntimeError("Baker: save the level first. Its name becomes the folder of the assets.")
    return ROOT + (path[len("/Game") :] if path.startswith("/Game/") else path)


def set_properties(target, **properties):
    """Set editor properties of an object."""
    for name, value in properties.items():
        target.set_editor_property(name, value)


def load(path, kind):
    """Return the asset at a path."""
    asset = ASSETS.load_asset(path) if ASSETS.does_asset_exist(path) else None
    if not isinstance(asset, kind):
        raise RuntimeError(f"Baker: {path} is not an asset of the class {kind.__name__}.")
    return asset


def make(name, folder, kind, factory, fill=None):
    """Return an asset. If it does not exist, create it and call `fill`, which adds its content."""
    path = folder + "/" + name
    if ASSETS.does_asset_exist(path):
        return load(path, kind)
    asset = TOOLS.create_asset(name, folder, kind, factory)
    if fill is not None:
        try:
            fill(asset)
        except Exception:
            # The next run must not use an asset without its content.
            ASSETS.delete_asset(path)
            raise
        ASSETS.save_loaded_asset(asset)
    return asset


def import_file(name, destination, options=None):
    """Import a file of the bake. Existing assets are replaced without a question."""
    task = unreal.AssetImportTask()
    set_properties(
        task,
        filename=str(FOLDER / name),
        destination_path=destination,
        automated=True,
        replace_existing=True,
        save=True,
    )
    if options is not None:
        task.set_editor_property("options", options)
    TOOLS.import_asset_tasks([task])


def import_texture(name, destination, **properties):
    """Import an image and set the texture's properties."""
    import_file(name, destination)
    texture = load(destination + "/" + Path(name).stem, unreal.Texture2D)
    set_properties(texture, **properties)
    ASSETS.save_loaded_asset(texture)
    return texture


# Pages are linear HDR textures without mip levels, which would mix charts.
PAGE = {
    "srgb": False,
    "compression_settings": unreal.TextureCompressionSettings.TC_HDR,
    "mip_gen_settings": unreal.TextureMipGenSettings.TMGS_NO_MIPMAPS,
    "address_x": unreal.TextureAddress.TA_CLAMP,
    "address_y": unreal.TextureAddress.TA_CLAMP,
}


def import_textures(bake, folder):
    """Import all images. Return textures by the number of a page or the name of a file, and white by None."""
    textures = {}
    for number, page in enumerate(bake["pages"]):
        textures[number] = import_texture(page["file"], folder + "/Pages", **PAGE)
    for texture in bake["textures"]:
        u, v = (ADDRESS[mode] for mode in texture["wrap"])
        textures[texture["file"]] = import_texture(
            texture["file"], folder + "/Textures", srgb=True, address_x=u, address_y=v
        )
    if not ASSETS.does_asset_exist(ROOT + "/" + WHITE):
        import_texture(WHITE + ".png", ROOT, srgb=True)
        import_texture(DEFAULT_PAGE + ".png", ROOT, **PAGE)
    textures[None] = load(ROOT + "/" + WHITE, unreal.Texture2D)
    return textures


def import_meshes(name, folder):
    """Import the scene and return the paths of its meshes by their names.

    By default the importer would replace UV channel 1, store UVs with 16 bits, and apply the transforms of
    objects to their vertices.
    """
    pipeline = unreal.InterchangeGenericAssetsPipeline()
    set_properties(pipeline, use_source_name_for_asset=False)
    set_properties(pipeline.get_editor_property("mesh_pipeline"), generate_lightmap_u_vs=False)
    set_properties(
        pipeline.get_editor_property("common_meshes_properties"),
        bake_meshes=False,
        use_full_precision_u_vs=True,
    )
    stack = unreal.InterchangePipelineStackOverride()
    if hasattr(stack, "add_pipeline"):
        stack.add_pipeline(pipeline)
    else:
        # Engines before 5.5 have the list only.
        stack.set_editor_property("override_pipelines", [unreal.SoftObjectPath(pipeline.get_path_name())])
    import_file(name, folder + "/Meshes", stack)
    paths = ASSETS.list_assets(folder + "/Meshes", recursive=True)
    return {path.rsplit(".", 1)[-1]: path.rsplit(".", 1)[0] for path in paths}


class Graph:
    """Adds nodes to a material or a material function, and connects them."""

    def __init__(self, owner):
        self.owner = owner
        if isinstance(owner, unreal.Material):
            self.create = EDIT.create_material_expression
        else:
            self.create = EDIT.create_material_expression_in_function

    def node(self, kind, inputs=None, **properties):
        """Add a node. `inputs` maps its pins to nodes, or to pairs of a node and the name of its output."""
        node = self.create(self.owner, getattr(unreal, "MaterialExpression" + kind))
        set_properties(node, **properties)
        for pin, source in (inputs or {}).items():
            source, output = source if isinstance(source, tuple) else (source, "")
            if not EDIT.connect_material_expressions(source, output, node, pin):
                raise RuntimeError(f"Baker: cannot connect '{output}' to '{pin}' of {kind}.")
        return node

    def show(self, source, output, target):
        """Connect the output of a node to an input of the material."""
        if not EDIT.connect_material_property(source, output, target):
            raise RuntimeError(f"Baker: cannot connect '{output}' to {target}.")

    def vector(self, name, *value):
        """Add a vector parameter."""
        return self.node("VectorParameter", parameter_name=name, default_value=unreal.LinearColor(*value))

    def scalar(self, name, value):
        """Add a scalar parameter."""
        return self.node("ScalarParameter", parameter_name=name, default_value=value)

    def sample(self, name, texture, channel):
        """Add a texture parameter, sampled at a UV channel * scale + offset."""
        uv = self.node("TextureCoordinate", coordinate_index=channel)
        rectangle = self.vector(name + "ScaleOffset", 1.0, 1.0, 0.0, 0.0)
        scale = self.node("ComponentMask", {"": rectangle}, r=True, g=True, b=False, a=False)
        offset = self.node("AppendVector", {"A": (rectangle, "B"), "B": (rectangle, "A")})
        scaled = self.node("Multiply", {"A": uv, "B": scale})
        placed = self.node("Add", {"A": scaled, "B": offset})
        types = unreal.MaterialSamplerType
        srgb = texture.get_editor_property("srgb")
        return self.node(
            "TextureSampleParameter2D",
            {"UVs": placed},
            parameter_name=name,
            texture=texture,
            sampler_type=types.SAMPLERTYPE_COLOR if srgb else types.SAMPLERTYPE_LINEAR_COLOR,
        )


def fill_function(function):
    """Add the content of the material function: (BaseColor * E / pi + Emission) * Exposure."""
    graph = Graph(function)
    page = load(ROOT + "/" + DEFAULT_PAGE, unreal.Texture2D)
    colour = graph.node("FunctionInput", input_name="BaseColor", sort_priority=0)
    emission = graph.node("FunctionInput", input_name="Emission", sort_priority=1)
    light = graph.node("Multiply", {"A": (graph.sample("Page", page, 1), "RGB")}, const_b=1.0 / math.pi)
    reflected = graph.node("Multiply", {"A": light, "B": colour})
    both = graph.node("Add", {"A": reflected, "B": emission})
    shown = graph.node("Multiply", {"A": both, "B": graph.scalar("Exposure", 1.0)})
    graph.node("FunctionOutput", {"": shown}, output_name="Radiance")
    EDIT.layout_material_function_expressions(function)
    EDIT.update_material_function(function)


def fill_material(material, function, blend, two_sided):
    """Add the content of an unlit material that shows the radiance."""
    set_properties(
        material,
        shading_model=unreal.MaterialShadingModel.MSM_UNLIT,
        blend_mode=BLEND[blend],
        two_sided=two_sided,
        opacity_mask_clip_value=0.5,
    )
    graph = Graph(material)
    white = load(ROOT + "/" + WHITE, unreal.Texture2D)
    base = graph.sample("BaseColorTexture", white, 0)
    factor = graph.vector("BaseColorFactor", 1.0, 1.0, 1.0, 1.0)
    colour = graph.node("Multiply", {"A": (base, "RGB"), "B": factor})
    emissive = graph.sample("EmissionTexture", white, 0)
    emission = graph.node(
        "Multiply", {"A": (emissive, "RGB"), "B": graph.vector("EmissionFactor", 0.0, 0.0, 0.0, 1.0)}
    )
    call = graph.node(
        "MaterialFunctionCall", {"BaseColor": colour, "Emission": emission}, material_function=function
    )
    graph.show(call, "Radiance", unreal.MaterialProperty.MP_EMISSIVE_COLOR)
    if blend != "opaque":
        alpha = graph.node("Multiply", {"A": (base, "A"), "B": (factor, "A")})
    if blend == "translucent":
        graph.show(alpha, "", unreal.MaterialProperty.MP_OPACITY)
    if blend == "masked":
        # A point is visible where alpha - AlphaCutoff + 0.5 is at least the clip value, 0.5.
        above = graph.node("Subtract", {"A": alpha, "B": graph.scalar("AlphaCutoff", 0.5)})
        graph.show(graph.node("Add", {"A": above}, const_b=0.5), "", unreal.MaterialProperty.MP_OPACITY_MASK)
    EDIT.layout_material_expressions(material)
    EDIT.recompile_material(material)


def make_parent(function, blend, two_sided):
    """Return the material that objects with this blend mode share."""
    name = "M_Baker{}_{}{}".format(VERSION, blend.capitalize(), "_TwoSided" if two_sided else "")
    return make(
        name,
        ROOT,
        unreal.Material,
        unreal.MaterialFactoryNew(),
        lambda material: fill_material(material, function, blend, two_sided),
    )


def fill_instance(instance, parent, entry, material, textures):
    """Set parent and parameters of an instance; other parameters, such as Exposure, stay."""
    EDIT.set_material_instance_parent(instance, parent)
    vectors = {
        "PageScaleOffset": entry["uv_scale"] + entry["uv_offset"],
        "BaseColorFactor": material["base_color"],
        "EmissionFactor": material["emission"] + [1.0],
    }
    files = {"Page": entry["page"]}
    for name, key in (("BaseColorTexture", "base_color_texture"), ("EmissionTexture", "emission_texture")):
        lookup = material[key]
        files[name] = lookup["file"]
        vectors[name + "ScaleOffset"] = lookup["scale_offset"]
        if lookup["uv_set"] != 0 or lookup["turned"]:
            unreal.log_warning(
                "Baker: the texture {} of {} is drawn with UV channel 0 and without rotation; the file has "
                "another channel or a rotation.".format(lookup["file"], material["name"])
            )
    # These functions return False even if they succeed.
    for name, value in vectors.items():
        EDIT.set_material_instance_vector_parameter_value(instance, name, unreal.LinearColor(*value))
    for name, file in files.items():
        EDIT.set_material_instance_texture_parameter_value(instance, name, textures[file])
    if material["blend"] == "masked":
        EDIT.set_material_instance_scalar_parameter_value(instance, "AlphaCutoff", material["alpha_cutoff"])
    EDIT.update_material_instance(instance)
    ASSETS.save_loaded_asset(instance)


def assign_materials(mesh, component, entry, folder, materials, textures, function):
    """Give each slot of an actor's component its instance. Slots have the names of the materials in the file.

    Objects with the same mesh have different places in the pages, so the mesh itself keeps its materials.
    """
    for number, slot in enumerate(mesh.get_editor_property("static_materials")):
        name = str(slot.get_editor_property("material_slot_name"))
        if name not in entry["materials"] and number < len(entry["materials"]):
            name = entry["materials"][number]
        material = materials.get(name, DEFAULT)
        instance = make(
            "MI_{}_{}".format(entry["name"], number),
            folder + "/Materials",
            unreal.MaterialInstanceConstant,
            unreal.MaterialInstanceConstantFactoryNew(),
        )
        parent = make_parent(function, material["blend"], material["two_sided"])
        fill_instance(instance, parent, entry, material, textures)
        component.set_material(number, instance)


def placed_actors():
    """Return the actors of the level that this script has made, by the names of their objects."""
    found = {}
    for actor in unreal.get_editor_subsystem(unreal.EditorActorSubsystem).get_all_level_actors():
        tags = [str(tag) for tag in actor.get_editor_property("tags")]
        if len(tags) == 2 and tags[0] == TAG:
            found[tags[1]] = actor
    return found


def put_actor(mesh, entry, actor):
    """Move the actor of an object to its place; create it if it is None; return its component."""
    location = unreal.Vector(*entry["location"])
    if actor is None:
        actors = unreal.get_editor_subsystem(unreal.EditorActorSubsystem)
        actor = actors.spawn_actor_from_object(mesh, location)
        actor.set_editor_property("tags", [TAG, entry["name"]])
        actor.set_actor_label(entry["name"])
        actor.set_folder_path("Baker")
    component = actor.get_editor_property("static_mesh_component")
    component.set_static_mesh(mesh)
    rotation = unreal.Quat(*entry["rotation"]).rotator()
    scale = unreal.Vector(*entry["scale"])
    actor.set_actor_transform(unreal.Transform(location, rotation, scale), False, True)
    if entry["sheared"]:
        unreal.log_warning("Baker: {} is sheared, which actors cannot be.".format(entry["name"]))
    return component


def main():
    """Import pages, textures and meshes, make the materials, and place the objects in the open level."""
    bake = json.loads((FOLDER / "lightmap.json").read_text("utf-8"))
    folder = level_folder()
    textures = import_textures(bake, folder)
    function = make(
        "MF_BakerLightmap" + VERSION,
        ROOT,
        unreal.MaterialFunction,
        unreal.MaterialFunctionFactoryNew(),
        fill_function,
    )
    materials = {material["name"]: material for material in bake["materials"]}
    meshes = import_meshes(bake["scene"], folder)
    actors = placed_actors()
    done = 0
    for entry in bake["objects"]:
        path = meshes.get(entry["mesh"])
        mesh = ASSETS.load_asset(path) if path else None
        if not isinstance(mesh, unreal.StaticMesh):
            unreal.log_warning("Baker: no static mesh is named {}.".format(entry["mesh"]))
            continue
        component = put_actor(mesh, entry, actors.pop(entry["name"], None))
        assign_materials(mesh, component, entry, folder, materials, textures, function)
        done += 1
    for actor in actors.values():
        unreal.get_editor_subsystem(unreal.EditorActorSubsystem).destroy_actor(actor)
    unreal.log(
        "Baker: {} of {} objects are in the level; {} old objects were removed. The assets are in {}.".format(
            done, len(bake["objects"]), len(actors), folder
        )
    )


main()
