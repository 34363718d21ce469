"""Defines the scene that is baked: immutable arrays in metres, +Y up, linear Rec.709.

Importers create the `Scene`. Meshes are in object space and shared by instances; `baker.core.geometry`
transforms them to world space.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from baker.core.object_settings import NEUTRAL, ObjectSettings
from baker.core.origin import scene_origin
from baker.core.printable import message_line
from baker.core.result import Result
from baker.core.source_mesh import SourceScene

# Smallest range of a light, metres. A smaller range is treated as this range, so that 1 / range^2 fits into
# float32.
_SHORTEST_RANGE = 1e-12


# Absolute value to which bakes clamp the uv of images, number of repeats of the image. Beyond it, the spacing
# of float32 numbers is at least 1/32 of the image. Importers warn of TEXCOORD sets with larger values.
LARGEST_UV = 2.0**18


@dataclass(frozen=True)
class Texture:
    """An image and the sampler with which a material reads it.

    Attributes
    ----------
    image : (H, W, 4) uint8 or float32
        RGBA. uint8: values of the image file, RGB sRGB-encoded, alpha linear. float32: linear. Row 0 is at
        v = 0.
    texcoord : int
        Number of the mesh's TEXCOORD set that the texture uses.
    transform : (2, 3) float64
        KHR_texture_transform: uv_image = transform @ (u, v, 1).
    wrap : (str, str)
        "repeat", "mirror" or "clamp" along u and along v.
    nearest : bool
        Whether magnification uses the nearest pixel instead of interpolation.
    """

    image: NDArray[Any]
    texcoord: int = 0
    transform: NDArray[np.float64] = field(default_factory=lambda: np.eye(2, 3))
    wrap: tuple[str, str] = ("repeat", "repeat")
    nearest: bool = False


@dataclass(frozen=True)
class Material:
    """Reflection, emission and opacity of a surface.

    Attributes
    ----------
    base_colour : (4,) tuple
        Linear Rec.709 RGB and alpha. They are multiplied by `base_colour_texture` and by the vertex colour.
    emission : (3,) tuple
        Radiance in cd/m2, linear Rec.709. It is multiplied by `emission_texture`.
    double_sided : bool
        Whether the surface reflects and emits on both sides. Otherwise its back is black.
    metallic_roughness_texture : Texture or None
        Linear: `roughness` is multiplied by green, `metallic` by blue. Bakes do not read it.
    alpha_mode : str
        "OPAQUE", "MASK" or "BLEND".
    reflectance : float or None
        For a pane (KHR_materials_transmission), the share of light of normal incidence that its smooth
        surface reflects, 0 to 1. The material is BLEND, and its alpha is the share that it does not transmit.
        None for other materials.
    reflects : bool
        Whether the surface reflects light. If False, its albedo is 0 in a bake; `base_colour` is only the
        colour in which it is displayed.
    original : int or None
        If the material is a copy with changes that the settings of an object require: the index of the
        material in the scene that it is a copy of. Such copies are not written to files.
    """

    name: str = ""
    base_colour: tuple[float, float, float, float] = (1.0, 1.0, 1.0, 1.0)
    base_colour_texture: Texture | None = None
    emission: tuple[float, float, float] = (0.0, 0.0, 0.0)
    emission_texture: Texture | None = None
    double_sided: bool = False
    alpha_mode: str = "OPAQUE"
    alpha_cutoff: float = 0.5
    metallic: float = 1.0
    roughness: float = 1.0
    metallic_roughness_texture: Texture | None = None
    reflectance: float | None = None
    reflects: bool = True
    original: int | None = None


@dataclass(frozen=True)
class Mesh:
    """The triangles of all primitives of a mesh, in object space, with V vertices and T triangles.

    Attributes
    ----------
    position : (V, 3) float32, metres, object space
    normal : (V, 3) float32, unit, object space; computed by the importer if the file has no normals
    triangle : (T, 3) int32, indices into the vertices, without the triangles that the importer left out
    material : (T,) int32, index into `Scene.materials`
    primitive : (T,) int32, index of each triangle's primitive in the source mesh
    vertex_primitive : (V,) int32, index of each vertex's primitive in the source mesh
    source_vertex : (V,) int32
        Row of each vertex in the accessors of its source primitive. If the importer computed flat normals,
        several vertices may have the same row.
    texcoord : tuple of (V, 2) float32 or None
        TEXCOORD sets by number, None for missing sets. Set 1 may be used as lightmap uv.
    colour : (V, 4) float32, linear Rec.709, or None
    """

    name: str
    position: NDArray[np.float32]
    normal: NDArray[np.float32]
    triangle: NDArray[np.int32]
    material: NDArray[np.int32]
    primitive: NDArray[np.int32]
    vertex_primitive: NDArray[np.int32]
    source_vertex: NDArray[np.int32]
    texcoord: tuple[NDArray[np.float32] | None, ...] = (None, None)
    colour: NDArray[np.float32] | None = None


@dataclass(frozen=True)
class Instance:
    """A mesh placed in the world.

    Attributes
    ----------
    node : int
        Index of the glTF node in `scene.glb`. For other formats, the writer creates this node.
    name : str
        Name of the node, or of the mesh if the node has no name.
    mesh : int
        Index into `Scene.meshes`.
    world_from_object : (4, 4) float64
    settings : ObjectSettings
        Settings of this object, such as whether it casts shadows.
    reasons : mapping of str to str
        Where each setting that was given comes from, by key.
    """

    node: int
    name: str
    mesh: int
    world_from_object: NDArray[np.float64]
    settings: ObjectSettings = NEUTRAL
    reasons: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class PunctualLight:
    """A light without area; its kind is described in `baker.core.light_kind` and `baker.lights.kinds`.

    Attributes
    ----------
    kind : str
        Name of a `LightKind`, such as "point", "spot" or "directional".
    intensity : (3,) tuple
        Colour times intensity, in the unit of the kind.
    position : (3,) tuple, metres, world
    direction : (3,) tuple, unit, world
        Direction in which light travels along the light's axis.
    inner_cone, outer_cone : float, radians
        Half of the opening angles of the inner and outer cone of a spot light.
    range : float, metres
        Distance from which on a light with a position gives no irradiance; inf for no limit.
    parameters : mapping
        Further parameters by name, for kinds of light that have other parameters.
    """

    kind: str
    name: str
    node: int
    intensity: tuple[float, float, float]
    position: tuple[float, float, float] = (0.0, 0.0, 0.0)
    direction: tuple[float, float, float] = (0.0, 0.0, -1.0)
    inner_cone: float = 0.0
    outer_cone: float = 0.7853981633974483
    range: float = math.inf
    parameters: Mapping[str, Any] = field(default_factory=dict)

    @property
    def inverse_range(self) -> float:
        """Return 1 / range^2, in 1 / m^2; 0 for an infinite range."""
        return float(1.0 / max(self.range, _SHORTEST_RANGE) ** 2)


@dataclass(frozen=True)
class Camera:
    """A pinhole camera.

    Attributes
    ----------
    position : (3,) tuple, metres, world
    right, up, forward : (3,) tuple, unit, world
    fov : float
        Vertical field of view, radians.
    """

    name: str
    node: int
    position: tuple[float, float, float]
    right: tuple[float, float, float]
    up: tuple[float, float, float]
    forward: tuple[float, float, float]
    fov: float


@dataclass(frozen=True)
class SceneWarning:
    """A problem that does not stop the work.

    Attributes
    ----------
    code : str
        Name of the kind of warning; it does not change between versions.
    message : str
        One sentence.
    object : str
        Name of the object concerned, empty for the whole scene.
    """

    code: str
    message: str
    object: str = ""

    def __post_init__(self) -> None:
        """Convert the message to one line with `message_line`."""
        object.__setattr__(self, "message", message_line(self.message))


@dataclass(frozen=True)
class SourceDocument:
    """The glTF document of a scene. The writer of `scene.glb` copies everything that a bake does not change.

    Attributes
    ----------
    json : dict
        The parsed document. Readers must not change it.
    buffers : tuple of bytes
        Content of each buffer, read from the BIN chunk, a file or a data URI.
    folder : Path or None
        Folder that relative image URIs refer to; None if there is no folder.
    allow_outside : bool
        Whether image URIs may refer to files outside that folder.
    missing, missing_images : frozenset of int
        Indices of buffers and images that cannot be read and that the bake does not need.
    chunks : tuple of (int, bytes)
        Type and content of all GLB chunks other than JSON and BIN.
    """

    json: dict[str, Any]
    buffers: tuple[bytes, ...]
    folder: Path | None
    allow_outside: bool = False
    missing: frozenset[int] = frozenset()
    missing_images: frozenset[int] = frozenset()
    chunks: tuple[tuple[int, bytes], ...] = ()


@dataclass(frozen=True, eq=False, repr=False)
class Scene(Result):
    """Meshes, materials and lights of a scene.

    Attributes
    ----------
    source : SourceDocument or None
        None for formats other than glTF, for which the writer creates a new document.
    sha256 : str
        SHA-256 of the scene file and of the files that it refers to, in hexadecimal digits.
    left_out : tuple of Instance
        Instances that are not baked. Their meshes are in `meshes` if the scene has no `source`.
    source_scene : SourceScene or None
        All triangles of the file, invalid ones included. None unless the scene was loaded with
        `lenient=True`.
    """

    name: str
    path: Path | None
    meshes: tuple[Mesh, ...]
    materials: tuple[Material, ...]
    instances: tuple[Instance, ...]
    lights: tuple[PunctualLight, ...] = ()
    warnings: tuple[SceneWarning, ...] = ()
    source: SourceDocument | None = None
    sha256: str = ""
    cameras: tuple[Camera, ...] = ()
    source_scene: SourceScene | None = None
    left_out: tuple[Instance, ...] = ()

    def summary(self) -> dict[str, Any]:
        """Return the names and values that `repr` and notebooks show."""
        return {
            "name": self.name,
            "objects": len(self.instances),
            "triangles": self.n_triangles,
            "materials": len(self.materials),
            "lights": len(self.lights),
            "cameras": len(self.cameras),
            "warnings": len(self.warnings),
        }

    def to_dict(self) -> dict[str, Any]:
        """Return names, counts and warnings as JSON-serialisable values."""
        return {
            "name": self.name,
            "path": None if self.path is None else str(self.path),
            "sha256": self.sha256,
            "objects": [
                {"node": i.node, "name": i.name, "triangles": len(self.meshes[i.mesh].triangle)}
                for i in self.instances
            ],
            "materials": [material.name for material in self.materials],
            "lights": [{"node": x.node, "name": x.name, "kind": x.kind} for x in self.lights],
            "cameras": [{"node": camera.node, "name": camera.name} for camera in self.cameras],
            "warnings": [{"code": w.code, "message": w.message, "object": w.object} for w in self.warnings],
        }

    @cached_property
    def origin(self) -> NDArray[np.float64]:
        """Return (3,) float64, metres, world: the point that float32 positions of a bake are relative to."""
        return scene_origin(
            [mesh.position for mesh in self.meshes],
            [len(mesh.triangle) for mesh in self.meshes],
            [(instance.mesh, instance.world_from_object) for instance in self.instances],
        )

    @cached_property
    def local_lights(self) -> tuple[PunctualLight, ...]:
        """Return `lights` with their positions relative to `origin`."""
        if not self.origin.any():
            return self.lights
        return tuple(replace(light, position=self.to_local(light.position)) for light in self.lights)

    def object_flags(self, key: str) -> NDArray[np.bool_]:
        """Return (I,) bool: the value of a field or property of `ObjectSettings` for each instance."""
        return np.array([getattr(instance.settings, key) for instance in self.instances], bool)

    def to_local(self, position: Sequence[float]) -> tuple[float, float, float]:
        """Return `position` (3,), metres, world, minus `origin`."""
        x, y, z = (float(v) for v in np.asarray(position, np.float64) - self.origin)
        return x, y, z

    @property
    def n_triangles(self) -> int:
        """Return the number of triangles of all instances."""
        return sum(len(self.meshes[i.mesh].triangle) for i in self.instances)
