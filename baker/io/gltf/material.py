"""Reads glTF materials: base colour, emission, metallic and roughness, sidedness, alpha, and textures.

The emitted radiance is `emissiveFactor x texture x emissiveStrength`, cd/m2. Unlit materials emit nothing.
They also reflect nothing, unless the setting `unlit` is "lit".

Based on: Khronos Group, glTF 2.0 Specification, section 3.9; KHR_materials_unlit.
"""

from __future__ import annotations

from functools import partial

from baker.core.errors import InputError
from baker.core.read_options import AS_IN_FILE, ReadOptions
from baker.core.scene import Material, SceneWarning
from baker.io.gltf.document import GltfDocument
from baker.io.gltf.json import JsonObject
from baker.io.gltf.surface import read_surface
from baker.io.gltf.texture import TextureReader
from baker.io.gltf.transmission import TRANSMISSION, as_pane, transmits
from baker.io.gltf.unread import unreadable_textures
from baker.io.gltf.variant import material_of, variant_number

DEFAULT_MATERIAL = Material(name="default")
_ALPHA = ("OPAQUE", "MASK", "BLEND")


class MaterialReader:
    """Reads the materials of a file, each at the first call of `need` for it.

    Parameters
    ----------
    document : GltfDocument
        The document.
    options : ReadOptions
        The variant, and the treatment of missing textures and of unlit materials.
    reflections : bool
        Also decode metallic-roughness textures.

    Attributes
    ----------
    materials : list of Material
        In the file's order. A material for which `need` was not called has default values. The default
        material is appended if it was needed.
    warnings : list of SceneWarning
        Warnings about the materials that were read.
    """

    def __init__(
        self, document: GltfDocument, options: ReadOptions = AS_IN_FILE, *, reflections: bool = False
    ) -> None:
        self._document = document
        self._options = options
        self._reflections = reflections
        self._textures = TextureReader(document, options.missing_textures)
        self._variant = variant_number(document, options.variant)
        self._unread = document.root.children("materials")
        self.materials = [Material(name=_name(m, i)) for i, m in enumerate(self._unread)]
        self._read: set[int] = set()
        self._unlit: list[str] = []
        self.warnings: list[SceneWarning] = []

    @property
    def reported(self) -> set[int]:
        """Return the indices of the images that the warnings name."""
        return self._textures.reported

    def index_of(self, primitive: JsonObject) -> int:
        """Return the index of the material of a primitive in the chosen variant, for `need`."""
        return material_of(primitive, self._variant, len(self._unread))

    def need(self, number: int) -> Material:
        """Return a material by its index; the index after the last one returns glTF's default material.

        Raises
        ------
        InputError
            If a value has a wrong type or is out of range. If a texture that a bake needs cannot be read, and
            `missing_textures` is "error".
        """
        if number == len(self._unread):
            if len(self.materials) == number:
                self.materials.append(DEFAULT_MATERIAL)
        elif number not in self._read:
            self._read.add(number)
            self.materials[number] = self._material(self._unread[number], number)
        return self.materials[number]

    def notes(self) -> list[SceneWarning]:
        """Return the warnings about all materials together: one if unlit materials reflect nothing."""
        if not self._unlit:
            return []
        more = f" and {len(self._unlit) - 1} more" if len(self._unlit) > 1 else ""
        message = (
            f"the material '{self._unlit[0]}'{more} is unlit (KHR_materials_unlit): it blocks light and "
            "reflects none; set `unlit` to lit to bake it like other materials"
        )
        return [SceneWarning("unlit", message, self._unlit[0])]

    def _material(self, material: JsonObject, number: int) -> Material:
        name = material.string("name", f"material_{number}")
        unlit = material.extension("KHR_materials_unlit") is not None
        surface = read_surface(material, name, self.warnings)
        emission = material.numbers("emissiveFactor", 3, (0.0, 0.0, 0.0))
        if min(surface.colour) < 0 or min(emission) < 0:
            material.fail("a colour factor is negative")
        factor = material.extension("KHR_materials_emissive_strength")
        strength = factor.number("emissiveStrength", 1.0, low=0.0) if factor is not None else 1.0
        # An unlit material emits nothing.
        strength = 0.0 if unlit else strength
        mode = material.string("alphaMode", "OPAQUE")
        if mode not in _ALPHA:
            material.fail(f"'{mode[:20]}' is none of {', '.join(_ALPHA)}", "alphaMode")
        black = unlit and self._options.unlit == "block"
        if black:
            self._unlit.append(name)
        # The colour of a black material is read for its alpha only.
        coloured = not black or mode != "OPAQUE"
        emits = strength > 0 and max(emission) > 0
        read = {(surface.holder.where, surface.texture)} if coloured else set()
        if emits:
            read.add((material.where, "emissiveTexture"))
        if not unlit and transmits(material):
            read.add((f"{material.where}.extensions.{TRANSMISSION}", "transmissionTexture"))
        texture = partial(self._textures.read, name=name, warnings=self.warnings)
        base_texture = texture(surface.holder, surface.texture, needed=coloured)
        emission_texture = None if unlit else texture(material, "emissiveTexture", needed=emits)
        self.warnings += unreadable_textures(self._document, material, name, read, self.reported)
        made = Material(
            name=name,
            base_colour=surface.colour,
            base_colour_texture=base_texture,
            emission=(emission[0] * strength, emission[1] * strength, emission[2] * strength),
            emission_texture=emission_texture,
            double_sided=material.boolean("doubleSided", False),
            alpha_mode=mode,
            alpha_cutoff=material.number("alphaCutoff", 0.5, low=0.0),
            metallic=surface.metallic,
            roughness=surface.roughness,
            metallic_roughness_texture=(
                texture(surface.holder, "metallicRoughnessTexture", needed=False)
                if self._reflections
                else None
            ),
            reflects=not black,
        )
        return made if unlit else as_pane(material, made, self._textures, self.warnings)


def _name(material: JsonObject, number: int) -> str:
    """Return the name of a material, or `material_<number>` if its name is malformed."""
    try:
        return material.string("name", f"material_{number}")
    except InputError:
        return f"material_{number}"
