"""Prepares a scene for path tracing: triangles, materials, lights and the Embree scene, without an atlas."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from types import TracebackType
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from baker.core.atlas import Atlas, InstanceLayout
from baker.core.geometry import Geometry, world_geometry
from baker.core.parallel import thread_count
from baker.core.scene import Scene
from baker.kernels.shading import Shading
from baker.pathtracer.light_table import LightTable, build_light_table
from baker.shading.materials import resolve_materials
from baker.shading.ray_tree import build_ray_tree
from baker.shading.scene_solids import hide_backs
from baker.trace.embree import RayScene
from baker.trace.packets import aligned_floats

# Columns of a triangle in `Surfaces.row`:
#
#     CORNER      positions of the three corners, metres (9)
#     SHADING     shading normals of the three corners (9)
#     FACE        unit face normal (3)
#     MATERIAL    row of `Surfaces.material`
#     TWO_SIDED   1 if two-sided, else 0
#     EMITTER     code of the triangle's emitters, see `FoundEmitters.code`
#     TEXTURED    1 if a texture or vertex colours change its base colour, metalness or roughness, else 0
#     EMISSION    radiance without texture, cd/m2 (3)
#     SHINES      0: it emits nothing; 1: it emits without a texture; 2: it emits with a texture
CORNER, SHADING, FACE, MATERIAL, TWO_SIDED, EMITTER, TEXTURED, EMISSION, SHINES = (
    0,
    9,
    18,
    21,
    22,
    23,
    24,
    25,
    28,
)
# Number of columns of `Surfaces.row`: 32 float32 fill two cache lines of 64 bytes.
ROW_LENGTH = 32
# Columns of a material in `Surfaces.material`: base colour (3), metallic, roughness, 1 if a texture scales
# metallic and roughness else 0. A row has MATERIAL_LENGTH numbers.
BASE_COLOUR, MATERIAL_METALLIC, MATERIAL_ROUGHNESS, MATERIAL_TEXTURED, MATERIAL_LENGTH = 0, 3, 4, 5, 8
# Quantile of the triangle sizes; `Surfaces.default_size` is twice the size at this quantile.
_SMALL = 0.1


class Surfaces(NamedTuple):
    """The T triangles and M materials of a scene, in the layout that kernels read at hits.

    Attributes
    ----------
    row : (T, 32) float32
        Triangles. Columns: `CORNER` to `SHINES` of this module.
    material : (M, 8) float32
        Materials. Columns: `BASE_COLOUR` to `MATERIAL_TEXTURED` of this module.
    min_offset_scale : float
        Metres. In `vertex.offset_origin`, the scale of the offset is the point's largest absolute coordinate,
        but at least this value.
    default_size : float
        Metres, triangle size assumed for a ray origin whose triangle is unknown.
    lambertian : int
        1 if all surfaces are Lambertian.
    painted : int
        1 if `TEXTURED` is 1 for any triangle.
    """

    row: NDArray[np.float32]
    material: NDArray[np.float32]
    min_offset_scale: float
    default_size: float
    lambertian: int
    painted: int


@dataclass(frozen=True)
class Reference:
    """A scene ready to be path-traced. Call `close` after use, or use it as a context manager.

    Attributes
    ----------
    geometry : Geometry
        World-space triangles. All positions in this class are relative to `geometry.origin`.
    shading : Shading
        Resolved materials and textures.
    surfaces : Surfaces
        The triangles and materials, in the layout that kernels read.
    lights : LightTable
        All lights that paths sample.
    rays : RayScene
        The Embree scene.
    occluders : RayScene
        The Embree scene of the objects that AO rays hit; usually the same object as `rays`.
    sphere : (4,) float64
        Centre and radius, metres, of a sphere that encloses all vertices.
    threads : int
        Number of threads of a pass.
    hit_kind : (T,) uint8
        What a hit on each triangle implies about the ray's origin, see `kernels.probe`. All 0 if built
        without `find_solids`.
    """

    geometry: Geometry
    shading: Shading
    surfaces: Surfaces
    lights: LightTable
    rays: RayScene
    occluders: RayScene
    sphere: NDArray[np.float64]
    threads: int
    hit_kind: NDArray[np.uint8]

    def __enter__(self) -> Reference:
        """Return this object."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Release the Embree scene."""
        self.close()

    def local(self, position: Sequence[float]) -> NDArray[np.float64]:
        """Return a world position (3,) relative to the geometry's origin."""
        return np.asarray(position, np.float64) - self.geometry.origin

    def close(self) -> None:
        """Release the Embree scene. No ray can be traced afterwards."""
        self.rays.close()
        self.occluders.close()


def build_reference(
    scene: Scene,
    *,
    sky: tuple[float, float, float] = (0.0, 0.0, 0.0),
    lambertian: bool = False,
    threads: int | None = None,
    find_solids: bool = False,
) -> Reference:
    """Prepare a scene for path tracing.

    Parameters
    ----------
    scene : Scene
        Instances, materials and lights.
    sky : (3,) tuple
        Radiance of the constant sky, cd/m2, linear Rec.709.
    lambertian : bool
        Whether all surfaces are treated as Lambertian with their base colour, as in bakes.
    threads : int, optional
        Number of threads; by default one per core.
    find_solids : bool
        Whether `Reference.hit_kind` is computed, which `pathtracer.inside_geometry` needs.

    Returns
    -------
    Reference
        The prepared scene; call its `close` after use.

    Raises
    ------
    InputError
        If the path tracer has no kernels for the kind of a light.
    ResourceError
        If Embree cannot be used or memory runs out.
    """
    count = thread_count(threads)
    geometry = world_geometry(scene, _no_atlas(scene))
    shading = resolve_materials(scene, geometry, reflections=not lambertian)
    steered = find_steered(scene, geometry)
    rays = build_ray_tree(geometry, shading, threads=count, unseen=steered.unseen)
    occluders = rays
    if (steered.unseen != steered.unseen_by_ao).any():
        occluders = build_ray_tree(geometry, shading, threads=count, unseen=steered.unseen_by_ao)
    lights = build_light_table(scene, geometry, shading, sky)
    surfaces = _surfaces(geometry, shading, lights, lambertian)
    if steered.black.any():
        surfaces = blacken(surfaces, steered.black)
    hit_kind = np.zeros(len(geometry.triangle), np.uint8)
    if find_solids:
        # Only `inside_geometry` reads `hit_kind`. Paths use `doubleSided` of the materials, which
        # `hide_backs` does not change.
        hit_kind = hide_backs(scene, geometry, shading)[1]
    sphere = _sphere(geometry)
    return Reference(geometry, shading, surfaces, lights, rays, occluders, sphere, count, hit_kind)


class Steered(NamedTuple):
    """What the settings of objects change for the path tracer.

    Attributes
    ----------
    unseen, unseen_by_ao : (I,) bool
        Instances that no ray hits, and instances that no AO ray hits.
    black : (T,) bool
        Triangles that reflect nothing.
    """

    unseen: NDArray[np.bool_]
    unseen_by_ao: NDArray[np.bool_]
    black: NDArray[np.bool_]


def find_steered(scene: Scene, geometry: Geometry) -> Steered:
    """Read the settings of objects, without the functions that a bake uses for that.

    Parameters
    ----------
    scene : Scene
        The scene, with the settings of its instances.
    geometry : Geometry
        The scene's triangles.

    Returns
    -------
    Steered
        The instances and triangles that are treated differently.
    """
    unseen, hidden_from_ao, dull = [], [], []
    for instance in scene.instances:
        own = instance.settings
        unseen.append(not own.cast)
        hidden_from_ao.append(not own.cast if own.visible_to_ao is None else not own.visible_to_ao)
        dull.append(not own.bounce)
    black = np.array(dull, bool)[geometry.instance]
    return Steered(np.array(unseen, bool), np.array(hidden_from_ao, bool), black)


def blacken(surfaces: Surfaces, black: NDArray[np.bool_]) -> Surfaces:
    """Return the surfaces with a black material on the triangles that `black` (T,) selects.

    Transmittance is computed from the materials of the scene, and does not change.
    """
    row, material = surfaces.row, np.zeros((1, MATERIAL_LENGTH), np.float32)
    # The specular reflection of a black metal is black.
    material[0, MATERIAL_METALLIC] = material[0, MATERIAL_ROUGHNESS] = 1.0
    row[black, MATERIAL] = len(surfaces.material)
    row[black, TEXTURED] = 0.0
    return surfaces._replace(material=np.concatenate([surfaces.material, material]))


def _no_atlas(scene: Scene) -> Atlas:
    """Return an atlas for a scene without lightmap: all uv are 0, and vertices are those of the meshes."""
    layouts = []
    for index, instance in enumerate(scene.instances):
        mesh = scene.meshes[instance.mesh]
        n = len(mesh.position)
        layouts.append(
            InstanceLayout(
                instance=index,
                page=0,
                vertex=np.arange(n, dtype=np.int32),
                uv=np.zeros((n, 2), np.float32),
                triangle=mesh.triangle,
                chart=np.zeros(len(mesh.triangle), np.int32),
                kept=False,
                texels_per_metre=0.0,
            )
        )
    return Atlas(1, 1, tuple(layouts), 0, 0)


def _sphere(geometry: Geometry) -> NDArray[np.float64]:
    if not len(geometry.position):
        return np.array([0.0, 0.0, 0.0, 1.0])
    low, high = geometry.position.min(axis=0).astype(float), geometry.position.max(axis=0).astype(float)
    # Use slightly more than half the diagonal, because light subpaths of parallel light start on discs of
    # this radius, which must not touch the scene.
    radius = max(0.501 * float(np.linalg.norm(high - low)), 1e-9)
    return np.array([*(0.5 * (low + high)), radius])


def _surfaces(geometry: Geometry, shading: Shading, lights: LightTable, lambertian: bool) -> Surfaces:
    n, material = len(geometry.triangle), geometry.material
    row = aligned_floats(n * ROW_LENGTH).reshape(n, ROW_LENGTH)
    row[:, CORNER : CORNER + 9] = geometry.position[geometry.triangle].reshape(n, 9)
    row[:, SHADING : SHADING + 9] = geometry.normal[geometry.triangle].reshape(n, 9)
    row[:, FACE : FACE + 3] = geometry.face_normal
    row[:, MATERIAL] = material
    row[:, TWO_SIDED] = geometry.double_sided
    row[:, EMITTER] = lights.code
    row[:, EMISSION : EMISSION + 3] = shading.emission[material]
    # Read emission from the materials, not from the light table. So rays that hit an emitter add its light
    # even if the light table lacks the emitter.
    emits = (shading.emission.max(axis=1, initial=0.0) > 0)[material] & (geometry.area > 0)
    row[:, SHINES] = np.where(emits, 1 + (shading.emission_texture >= 0)[material], 0)
    painted = shading.base_texture >= 0
    if not lambertian:
        painted = painted | (shading.reflection_texture >= 0)
    row[:, TEXTURED] = painted[material] | (len(shading.colour) > 1)
    material_row = np.zeros((len(shading.base), MATERIAL_LENGTH), np.float32)
    material_row[:, BASE_COLOUR : BASE_COLOUR + 3] = shading.base
    material_row[:, MATERIAL_METALLIC], material_row[:, MATERIAL_ROUGHNESS] = (
        shading.metallic,
        shading.roughness,
    )
    material_row[:, MATERIAL_TEXTURED] = shading.reflection_texture >= 0
    min_offset_scale, default_size = max(1e-3 * geometry.diagonal, 1e-12), _small_size(geometry)
    return Surfaces(
        row, material_row, min_offset_scale, default_size, int(lambertian), int(row[:, TEXTURED].any())
    )


def _small_size(geometry: Geometry) -> float:
    """Return `Surfaces.default_size`, metres: twice the `_SMALL` quantile of the triangles' sizes.

    The size of a triangle is the largest component of its two edges at corner 0. The quantile ignores large
    triangles, such as those of a sky dome.
    """
    if not len(geometry.triangle):
        return 1.0
    corner = geometry.position[geometry.triangle]
    size = np.abs(corner[:, 1:] - corner[:, :1]).max(axis=(1, 2))
    return max(2.0 * float(np.quantile(size, _SMALL)), 1e-12)
