"""Stands in for those parts of Unreal Engine's editor that the script of the export uses.

Functions and arguments follow the Python API reference (5.3 to 5.7). An unknown function or argument raises
an error. Axes, slots and defaults of imported glTF files are from the engine's sources (GLTFCore,
InterchangeGltfTranslator.cpp). Where the editor would open a dialog, a `DialogError` is raised.
"""

# ruff: noqa: RUF012

from __future__ import annotations

import itertools
import json
import struct
import sys
import types
from pathlib import Path

import numpy as np
from fake_unreal import (
    EXPRESSIONS,
    AssetImportTask,
    DialogError,
    InterchangeGenericAssetsPipeline,
    Material,
    MaterialFunction,
    MaterialInstanceConstant,
    MaterialInterface,
    Object,
    StaticMaterial,
    StaticMesh,
    Texture2D,
)


class Actor(Object):
    properties = {"tags": ()}


class StaticMeshComponent(Object):
    properties = {"static_mesh": None}
    # Materials by slot that replace those of the mesh.
    materials = {}

    def set_static_mesh(self, new_mesh):
        assert isinstance(new_mesh, StaticMesh)
        self.values["static_mesh"] = new_mesh
        return True

    def set_material(self, element_index, material):
        assert isinstance(material, MaterialInterface)
        self.materials = {**self.materials, element_index: material}


class StaticMeshActor(Actor):
    properties = {"tags": (), "static_mesh_component": None}
    label = folder = transform = None

    def __init__(self):
        super().__init__()
        self.values["static_mesh_component"] = StaticMeshComponent()

    def set_actor_label(self, new_actor_label, mark_dirty=True):
        self.label = new_actor_label

    def set_folder_path(self, new_folder_path):
        self.folder = new_folder_path

    def set_actor_transform(self, new_transform, sweep, teleport):
        self.transform = new_transform

    def world(self):
        """Return the vertices of the actor's mesh in the level: scaled, then turned, then moved."""
        location, turn, scale = self.transform
        position = self.values["static_mesh_component"].values["static_mesh"].position * scale
        x, y, z, w = turn
        axis = np.array([x, y, z])
        once = np.cross(axis, position) + w * position
        return position + 2.0 * np.cross(axis, once) + location


def _swapped(points):
    return points[..., [0, 2, 1]]


class Editor:
    """The state of an editor: assets by their path, the open level, its actors, and the log.

    Parameters
    ----------
    level : str
        Path of the open level.
    old : bool
        Whether the import options lack `add_pipeline`, as before 5.5.
    """

    def __init__(self, level="/Game/Maps/Castle", *, old=False):
        self.level, self.old = level, old
        self.assets, self.actors, self.lines = {}, {level: []}, []
        self.created, self.saved = [], set()

    def run(self, script):
        """Run a script of an export."""
        source = Path(script).read_text("utf-8")
        space = {"__file__": str(script), "__name__": "__main__"}
        sys.modules["unreal"] = self.module()
        try:
            exec(compile(source, str(script), "exec"), space)
        finally:
            del sys.modules["unreal"]

    def here(self):
        """Return the actors of the open level."""
        return self.actors.setdefault(self.level, [])

    def import_asset_tasks(self, tasks):
        for task in tasks:
            values = task.values
            if not values["automated"]:
                raise DialogError("import options")
            file, folder = Path(values["filename"]), values["destination_path"]
            if file.suffix == ".glb":
                self.import_scene(file, folder, values)
            else:
                self.add(folder + "/" + file.stem, Texture2D, values).file = file

    def add(self, path, kind, values):
        if path in self.assets:
            if not values["replace_existing"]:
                raise DialogError("replace " + path)
        else:
            self.assets[path] = kind()
        assert isinstance(self.assets[path], kind)
        return self.assets[path]

    def import_scene(self, file, folder, values):
        """Import a GLB as static meshes, as Interchange does."""
        data = file.read_bytes()
        (length,) = struct.unpack_from("<I", data, 12)
        document, binary = json.loads(data[20 : 20 + length]), data[28 + length :]
        pipeline = (
            values["options"].pipelines if values["options"] else [InterchangeGenericAssetsPipeline()]
        )[0]
        common = pipeline.values["common_meshes_properties"].values
        used = [node for node in document["nodes"] if "mesh" in node]
        for material in document.get("materials", []):
            self.add(f"{folder}/{material['name']}", Material, values)
        for node in used:
            mesh = document["meshes"][node["mesh"]]
            alone = len(used) == 1 and pipeline.values["use_source_name_for_asset"]
            made = self.add(f"{folder}/{file.stem if alone else mesh['name']}", StaticMesh, values)
            accessor = document["accessors"][mesh["primitives"][0]["attributes"]["POSITION"]]
            view = document["bufferViews"][accessor["bufferView"]]
            start = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
            points = np.frombuffer(binary, "<f4", 3 * accessor["count"], start).reshape(-1, 3)
            made.position = _swapped(points.astype(float)) * 100.0
            assert not common["bake_meshes"], "the place of objects would be applied twice"
            made.uv_1_of_file = not pipeline.values["mesh_pipeline"].values["generate_lightmap_u_vs"]
            made.precise = common["use_full_precision_u_vs"]
            slots = []
            for number in dict.fromkeys(p.get("material") for p in mesh["primitives"]):
                slot = StaticMaterial()
                name = "None" if number is None else document["materials"][number]["name"]
                # The importer makes plain materials, not instances.
                slot.values |= {"material_slot_name": name, "material_interface": Material()}
                slots.append(slot)
            made.values["static_materials"] = slots

    def create_asset(self, asset_name, package_path, asset_class, factory):
        path = f"{package_path}/{asset_name}"
        if path in self.assets:
            raise DialogError("overwrite " + path)
        assert type(factory).__name__ == asset_class.__name__ + "FactoryNew"
        self.assets[path] = asset_class()
        self.created.append(path)
        return self.assets[path]

    def module(self):
        """Return a module `unreal` that works on this editor."""
        made = types.ModuleType("unreal")
        classes = [
            AssetImportTask, InterchangeGenericAssetsPipeline, Texture2D, MaterialInterface, Material,
            MaterialInstanceConstant, MaterialFunction, StaticMesh, *EXPRESSIONS,
        ]  # fmt: skip
        for kind in classes:
            setattr(made, kind.__name__, kind)
        for kind in ("Material", "MaterialFunction", "MaterialInstanceConstant"):
            setattr(made, kind + "FactoryNew", type(kind + "FactoryNew", (), {}))
        for name, members in ENUMS.items():
            setattr(made, name, types.SimpleNamespace(**{member: member for member in members}))
        made.LinearColor = lambda r=0.0, g=0.0, b=0.0, a=0.0: np.array([r, g, b, a], float)
        made.Vector = lambda x=0.0, y=0.0, z=0.0: np.array([x, y, z], float)
        made.Quat = lambda x=0.0, y=0.0, z=0.0, w=0.0: types.SimpleNamespace(rotator=lambda: (x, y, z, w))
        made.Transform = lambda location, rotation, scale: (location, rotation, scale)
        made.SoftObjectPath = lambda path_string: path_string
        made.InterchangePipelineStackOverride = OldStack if self.old else Stack
        made.AssetToolsHelpers = types.SimpleNamespace(get_asset_tools=lambda: self)
        made.MaterialEditingLibrary = MaterialEditingLibrary
        made.EditorAssetLibrary = EditorAssetLibrary(self)
        made.UnrealEditorSubsystem, made.EditorActorSubsystem = World(self), EditorActorSubsystem(self)
        made.get_editor_subsystem = lambda subsystem: subsystem
        made.log = made.log_warning = self.lines.append
        return made


ENUMS = {
    "BlendMode": ("BLEND_OPAQUE", "BLEND_MASKED", "BLEND_TRANSLUCENT"),
    "TextureAddress": ("TA_WRAP", "TA_CLAMP", "TA_MIRROR"),
    "TextureCompressionSettings": ("TC_HDR",),
    "TextureMipGenSettings": ("TMGS_NO_MIPMAPS",),
    "MaterialSamplerType": ("SAMPLERTYPE_COLOR", "SAMPLERTYPE_LINEAR_COLOR"),
    "MaterialShadingModel": ("MSM_UNLIT",),
    "MaterialProperty": ("MP_EMISSIVE_COLOR", "MP_OPACITY", "MP_OPACITY_MASK"),
}


class OldStack(Object):
    properties = {"override_pipelines": ()}

    @property
    def pipelines(self):
        return list(self.values["override_pipelines"])


class Stack(OldStack):
    def add_pipeline(self, pipeline_base):
        self.values["override_pipelines"] = [*self.values["override_pipelines"], pipeline_base]


class EditorAssetLibrary:
    def __init__(self, editor):
        self.editor = editor

    def does_asset_exist(self, asset_path):
        return asset_path in self.editor.assets

    def load_asset(self, asset_path):
        return self.editor.assets[asset_path]

    def delete_asset(self, asset_path_to_delete):
        del self.editor.assets[asset_path_to_delete]
        return True

    def save_loaded_asset(self, asset_to_save, only_if_is_dirty=True):
        assert any(asset is asset_to_save for asset in self.editor.assets.values())
        self.editor.saved.add(id(asset_to_save))
        return True

    def list_assets(self, directory_path, recursive=True, include_folder=False):
        inside = [path for path in self.editor.assets if path.startswith(directory_path + "/")]
        return [f"{path}.{path.rsplit('/', 1)[-1]}" for path in inside]


class World:
    def __init__(self, editor):
        self.editor = editor

    def get_editor_world(self):
        path = f"{self.editor.level}.{self.editor.level.rsplit('/', 1)[-1]}"
        return types.SimpleNamespace(get_path_name=lambda: path)


class EditorActorSubsystem:
    def __init__(self, editor):
        self.editor = editor

    def get_all_level_actors(self):
        return list(self.editor.here())

    def spawn_actor_from_object(self, object_to_use, location, rotation=(0.0, 0.0, 0.0), transient=False):
        assert isinstance(object_to_use, StaticMesh)
        self.editor.here().append(StaticMeshActor())
        return self.editor.here()[-1]

    def destroy_actor(self, actor_to_destroy):
        self.editor.here().remove(actor_to_destroy)
        return True


class MaterialEditingLibrary:
    @staticmethod
    def create_material_expression(material, expression_class, node_pos_x=0, node_pos_y=0):
        assert isinstance(material, Material)
        material.nodes.append(expression_class(material))
        return material.nodes[-1]

    @staticmethod
    def create_material_expression_in_function(
        material_function, expression_class, node_pos_x=0, node_pos_y=0
    ):
        assert isinstance(material_function, MaterialFunction)
        material_function.nodes.append(expression_class(material_function))
        return material_function.nodes[-1]

    @staticmethod
    def connect_material_expressions(from_expression, from_output_name, to_expression, to_input_name):
        # An empty name stands for the first pin.
        pins, outputs = to_expression.pin_names(), from_expression.output_names()
        pin = to_input_name or next(iter(pins), None)
        if pin not in pins or (from_output_name or next(iter(outputs), None)) not in outputs:
            return False
        to_expression.sources[pin] = (from_expression, from_output_name or outputs[0])
        return True

    @staticmethod
    def connect_material_property(from_expression, from_output_name, property_):
        if (from_output_name or from_expression.output_names()[0]) not in from_expression.output_names():
            return False
        assert isinstance(from_expression.owner, Material)
        from_expression.owner.inputs[property_] = (from_expression, from_output_name)
        return True

    @staticmethod
    def layout_material_expressions(material):
        assert isinstance(material, Material)

    @staticmethod
    def layout_material_function_expressions(material_function):
        assert isinstance(material_function, MaterialFunction)

    @staticmethod
    def update_material_function(material_function):
        _check_samplers(material_function)
        material_function.compiled = True

    @staticmethod
    def recompile_material(material):
        _check_samplers(material)
        needed = {"BLEND_MASKED": ["MP_OPACITY_MASK"], "BLEND_TRANSLUCENT": ["MP_OPACITY"]}
        assert set(material.inputs) == {
            "MP_EMISSIVE_COLOR",
            *needed.get(material.values["blend_mode"], []),
        }
        material.compiled = True

    @staticmethod
    def set_material_instance_parent(instance, new_parent):
        assert isinstance(new_parent, MaterialInterface)
        instance.parent = new_parent

    @staticmethod
    def set_material_instance_vector_parameter_value(instance, parameter_name, value):
        return _set(instance, parameter_name, value, np.ndarray)

    @staticmethod
    def set_material_instance_scalar_parameter_value(instance, parameter_name, value):
        return _set(instance, parameter_name, value, float)

    @staticmethod
    def set_material_instance_texture_parameter_value(instance, parameter_name, value):
        return _set(instance, parameter_name, value, Texture2D)

    @staticmethod
    def update_material_instance(instance):
        assert isinstance(instance, MaterialInstanceConstant)


def _set(instance, name, value, kind):
    """Set a parameter that the parent material has. As in the engine, the return value is always False."""
    assert isinstance(instance, MaterialInstanceConstant), "parameters can be set in instances only"
    assert isinstance(value, kind)
    calls = [
        n.values["material_function"].nodes for n in instance.parent.nodes if "material_function" in n.values
    ]
    nodes = itertools.chain(instance.parent.nodes, *calls)
    assert name in {n.values.get("parameter_name") for n in nodes}, f"no parameter is named {name}"
    instance.parameters[name] = value
    return False


def _check_samplers(owner):
    for node in owner.nodes:
        if "sampler_type" in node.values:
            srgb = node.values["texture"].values["srgb"]
            assert node.values["sampler_type"] == (
                "SAMPLERTYPE_COLOR" if srgb else "SAMPLERTYPE_LINEAR_COLOR"
            )
