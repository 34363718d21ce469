"""Stands in for assets and materials of Unreal Engine's Python module `unreal`, see `fake_unreal_editor`.

Classes and editor properties follow the Python API reference (5.3 to 5.7). An unknown class or property
raises an error. The pins of nodes are from the engine's sources (MaterialEditingLibrary.cpp,
MaterialGraphNode.cpp). `shown` evaluates a material.
"""

# Mutable class attributes are allowed here, because each object copies `properties`.
# ruff: noqa: RUF012

from __future__ import annotations

import numpy as np
from PIL import Image

from baker.encodings.exr import decode_exr


class DialogError(Exception):
    """The editor would ask the user."""


class Object:
    """An object with editor properties. A property that `properties` does not list raises an error."""

    properties: dict = {}

    def __init__(self):
        self.values = dict(self.properties)

    def set_editor_property(self, name, value):
        assert name in self.values, f"{type(self).__name__} has no property {name}"
        self.values[name] = value

    def get_editor_property(self, name):
        return self.values[name]


class AssetImportTask(Object):
    properties = dict.fromkeys(
        ("filename", "destination_path", "destination_name", "options", "factory"), None
    ) | dict.fromkeys(("automated", "replace_existing", "replace_existing_settings", "save", "async_"), False)


class InterchangeGenericMeshPipeline(Object):
    properties = {"generate_lightmap_u_vs": True, "combine_static_meshes": False, "build_nanite": False}


class InterchangeGenericCommonMeshesProperties(Object):
    properties = {"bake_meshes": True, "use_full_precision_u_vs": False, "recompute_normals": False}


class InterchangeGenericAssetsPipeline(Object):
    properties = {"use_source_name_for_asset": True, "mesh_pipeline": None, "common_meshes_properties": None}

    def __init__(self):
        super().__init__()
        self.values["mesh_pipeline"] = InterchangeGenericMeshPipeline()
        self.values["common_meshes_properties"] = InterchangeGenericCommonMeshesProperties()

    def get_path_name(self):
        return self


class Texture2D(Object):
    properties = {
        "srgb": True,
        "compression_settings": "TC_DEFAULT",
        "mip_gen_settings": "TMGS_FROM_TEXTURE_GROUP",
        "address_x": "TA_WRAP",
        "address_y": "TA_WRAP",
    }
    file = None

    def at(self, u, v):
        """Return the nearest texel, RGBA, decoded as the properties say. Row 0 is v = 0."""
        if self.file.suffix == ".exr":
            image = decode_exr(self.file).pixels.astype(float)
            image = np.concatenate([image, np.ones((*image.shape[:2], 1))], axis=2)
        else:
            image = np.asarray(Image.open(self.file).convert("RGBA")) / 255.0
        height, width = image.shape[:2]
        u, v = self._inside(u, "address_x"), self._inside(v, "address_y")
        texel = image[min(int(v * height), height - 1), min(int(u * width), width - 1)].copy()
        if self.values["srgb"]:
            texel[:3] = np.where(texel[:3] > 0.04045, ((texel[:3] + 0.055) / 1.055) ** 2.4, texel[:3] / 12.92)
        return texel

    def _inside(self, position, key):
        if self.values[key] == "TA_CLAMP":
            return min(max(position, 0.0), 1.0)
        if self.values[key] == "TA_MIRROR":
            return 1.0 - abs(1.0 - position % 2.0)
        return position % 1.0


class MaterialInterface(Object):
    pass


class Material(MaterialInterface):
    properties = {
        "shading_model": "MSM_DEFAULT_LIT",
        "blend_mode": "BLEND_OPAQUE",
        "two_sided": False,
        "opacity_mask_clip_value": 0.3333,
    }

    def __init__(self):
        super().__init__()
        self.nodes, self.inputs, self.compiled = [], {}, False


class MaterialInstanceConstant(MaterialInterface):
    def __init__(self):
        super().__init__()
        self.parent, self.parameters = None, {}


class MaterialFunction(Object):
    def __init__(self):
        super().__init__()
        self.nodes, self.compiled = [], False


class StaticMaterial(Object):
    properties = {"material_interface": None, "material_slot_name": None}


class StaticMesh(Object):
    properties = {"static_materials": ()}
    # Vertices in the mesh's space, cm; whether UV channel 1 is that of the file and UVs have full precision.
    position, uv_1_of_file, precise = None, True, False

    def set_material(self, material_index, new_material):
        assert isinstance(new_material, MaterialInterface)
        self.values["static_materials"][material_index].values["material_interface"] = new_material


class MaterialExpression(Object):
    pins: tuple = ()
    outputs: tuple = ("",)

    def __init__(self, owner):
        super().__init__()
        self.owner, self.sources = owner, {}

    def pin_names(self):
        return self.pins

    def output_names(self):
        return self.outputs


def _expression(name, pins=(), outputs=("",), **properties):
    members = {"pins": pins, "outputs": outputs, "properties": properties}
    return type("MaterialExpression" + name, (MaterialExpression,), members)


_COLOURS = ("R", "G", "B", "A")
_BINARY = {"pins": ("A", "B"), "const_a": 0.0, "const_b": 1.0}


class MaterialExpressionMaterialFunctionCall(MaterialExpression):
    properties = {"material_function": None}

    def of_function(self, kind, key):
        nodes = self.values["material_function"].nodes
        return tuple(node.values[key] for node in nodes if type(node).__name__ == "MaterialExpression" + kind)

    def pin_names(self):
        return self.of_function("FunctionInput", "input_name")

    def output_names(self):
        return self.of_function("FunctionOutput", "output_name")


EXPRESSIONS = [
    _expression("TextureCoordinate", coordinate_index=0, u_tiling=1.0, v_tiling=1.0),
    _expression("VectorParameter", outputs=("", *_COLOURS), parameter_name="", default_value=None),
    _expression("ScalarParameter", parameter_name="", default_value=0.0),
    _expression("ComponentMask", pins=("",), r=True, g=True, b=False, a=False),
    _expression("AppendVector", pins=("A", "B")),
    *(_expression(name, **_BINARY) for name in ("Multiply", "Add", "Subtract")),
    _expression(
        "TextureSampleParameter2D",
        pins=("UVs", "Tex"),
        outputs=("RGB", *_COLOURS, "RGBA"),
        parameter_name="",
        texture=None,
        sampler_type="SAMPLERTYPE_COLOR",
    ),
    _expression("FunctionInput", pins=("Preview",), input_name="", sort_priority=0),
    _expression("FunctionOutput", pins=("",), outputs=(), output_name="", sort_priority=0),
    MaterialExpressionMaterialFunctionCall,
]


def _value(node, output, scene):
    """Return the value of a node's output, an array; `scene` has `uv` and `parameters` (and `call`)."""
    kind, values = type(node).__name__.removeprefix("MaterialExpression"), node.values

    def of(pin, default=None):
        if pin not in node.sources:
            assert default is not None, f"nothing is connected to '{pin}' of {kind}"
            return np.atleast_1d(default)
        return _value(*node.sources[pin], scene)

    if kind == "TextureCoordinate":
        return np.array(scene["uv"][values["coordinate_index"]])
    if kind in ("VectorParameter", "ScalarParameter"):
        found = np.atleast_1d(scene["parameters"].get(values["parameter_name"], values["default_value"]))
        return found if kind[0] == "S" else _channel(found, output or "RGB")
    if kind == "ComponentMask":
        return of("")[[values[name] for name in "rgba"][: len(of(""))]]
    if kind == "AppendVector":
        return np.concatenate([of("A"), of("B")])
    if kind == "TextureSampleParameter2D":
        texture = scene["parameters"].get(values["parameter_name"], values["texture"])
        return _channel(texture.at(*of("UVs")), output or "RGB")
    if kind == "MaterialFunctionCall":
        (end,) = (n for n in values["material_function"].nodes if n.output_names() == ())
        return _value(*end.sources[""], {**scene, "call": (node, scene)})
    if kind == "FunctionInput":
        call, outside = scene["call"]
        return _value(*call.sources[values["input_name"]], outside)
    a, b = of("A", values["const_a"]), of("B", values["const_b"])
    return {"Multiply": np.multiply, "Add": np.add, "Subtract": np.subtract}[kind](a, b)


def _channel(colour, name):
    return colour[:3] if name == "RGB" else colour[["RGBA".index(c) for c in name]]


def shown(instance, uv):
    """Return emissive colour and {other input: value} of a material instance, for the UVs of its channels."""
    parent = instance.parent
    assert parent.compiled
    scene = {"uv": uv, "parameters": instance.parameters}
    found = {key: _value(*source, scene) for key, source in parent.inputs.items()}
    return found.pop("MP_EMISSIVE_COLOR"), found
