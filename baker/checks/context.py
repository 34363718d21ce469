"""Holds the data of a check: the scene with its defective triangles, and values that several rules use."""

from __future__ import annotations

from collections import Counter
from functools import cached_property
from itertools import product

import numpy as np
from numpy.typing import NDArray

from baker.channels.channel import Channel, chosen_channels
from baker.checks.bake_rates import Rates
from baker.checks.direct_light import Levels, estimate_levels
from baker.checks.emission import Emission, find_emission
from baker.checks.finding import Location
from baker.checks.mesh_facts import MeshFacts
from baker.checks.settings import DEFAULT_MIP
from baker.checks.sorted_points import SortedPoints
from baker.checks.uv_facts import UvFacts
from baker.checks.world_triangles import WorldTriangles
from baker.core.light_kind import check_light_kinds, light_positions
from baker.core.parallel import thread_count
from baker.core.scene import Mesh, Scene
from baker.core.settings import BakeSettings
from baker.core.source_mesh import SourceInstance, SourceMesh, SourcePrimitive, SourceScene
from baker.io.mesh.build import sound_meshes

# Largest number of points of each object in `CheckContext.test_points`.
_TEST_POINTS = 8


class CheckContext:
    """A scene, the settings of its bake, and values derived from both.

    Each derived value is computed on first use and then stored. Good triangles are those that a bake uses,
    see `MeshFacts`.

    Attributes
    ----------
    scene : Scene
        The scene, which `load_scene` read for a check (with `lenient=True`) or for a bake.
    source : SourceScene
        The meshes of the file. They include defective triangles if the scene was read for a check, and only
        good triangles if it was read for a bake.
    settings : BakeSettings
        Settings of the bake that the scene is checked for.
    mip : int
        Coarsest mip level at which charts must not bleed into each other; 0 is the page itself.
    meshes : tuple of MeshFacts
        One for each of `source.meshes`.
    rates : Rates or None
        Speed of an earlier bake, from which the rule `cost` estimates time.
    probe : bool
        Whether the rule `cost` measures the speed of rays if `rates` is None.

    Raises
    ------
    InputError
        If a light is of an unknown kind.
    """

    def __init__(
        self,
        scene: Scene,
        settings: BakeSettings,
        *,
        mip: int = DEFAULT_MIP,
        rates: Rates | None = None,
        probe: bool = False,
    ) -> None:
        check_light_kinds(scene)
        self.scene = scene
        self.settings = settings
        self.mip = mip
        self.rates = rates
        self.probe = probe
        self.source = scene.source_scene if scene.source_scene is not None else source_scene_of(scene)
        self._uv: dict[int, UvFacts] = {}
        sound = [True] * len(self.source.meshes)
        if scene.source_scene is not None:
            sound = sound_meshes([mesh.primitives for mesh in self.source.meshes])
        self.meshes = tuple(
            MeshFacts(mesh, scene.materials, sound=valid)
            for mesh, valid in zip(self.source.meshes, sound, strict=True)
        )

    @cached_property
    def first_instance(self) -> dict[int, SourceInstance]:
        """Return the first instance of each mesh, by mesh index."""
        return {mesh: instances[0] for mesh, instances in self.instances_of.items()}

    @cached_property
    def instances_of(self) -> dict[int, list[SourceInstance]]:
        """Return the instances of each mesh that has any, by mesh index."""
        found: dict[int, list[SourceInstance]] = {}
        for instance in self.source.instances:
            found.setdefault(instance.mesh, []).append(instance)
        return found

    @cached_property
    def node_named(self) -> dict[str, int]:
        """Return the node of each name that only one instance has, by name."""
        count = Counter(instance.name for instance in self.source.instances)
        return {i.name: i.node for i in self.source.instances if count[i.name] == 1}

    @cached_property
    def test_points(self) -> SortedPoints:
        """Return positions of lights and cameras (owner -1), and some vertices of objects (owner: the node).

        The vertices are corner 0 of at most `_TEST_POINTS` good triangles of each object. All positions are
        in metres, world space.
        """
        scene = self.scene
        seen = [*light_positions(scene), *(np.array(camera.position) for camera in scene.cameras)]
        position = [np.array(seen, np.float64).reshape(-1, 3)]
        owner = [np.full(len(seen), -1, np.int64)]
        for instance in self.source.instances:
            facts = self.meshes[instance.mesh]
            if not len(facts.good):
                continue
            step = max(1, len(facts.good) // _TEST_POINTS)
            matrix = instance.world_from_object
            points = facts.corner[::step, 0][:_TEST_POINTS] @ matrix[:3, :3].T + matrix[:3, 3]
            position.append(points)
            owner.append(np.full(len(points), instance.node, np.int64))
        return SortedPoints(np.concatenate(position), np.concatenate(owner))

    @cached_property
    def box(self) -> NDArray[np.float64]:
        """Return a box around all good triangles, (2, 3) float64, metres, world: lowest and highest corner.

        It contains the corners of the object-space bounding box of each mesh, transformed to world space. If
        instances are rotated, it can therefore be larger than the tightest box around the triangles. Without
        good triangles the corners are +inf and -inf.
        """
        low, high = np.full(3, np.inf), np.full(3, -np.inf)
        for instance in self.source.instances:
            facts = self.meshes[instance.mesh]
            if not len(facts.good):
                continue
            # Bound the transformed mesh by the transformed corners of its bounding box.
            own = facts.bounds
            box = np.array(list(product(*own.T)))
            world = box @ instance.world_from_object[:3, :3].T + instance.world_from_object[:3, 3]
            low, high = np.minimum(low, world.min(axis=0)), np.maximum(high, world.max(axis=0))
        return np.stack([low, high])

    @property
    def diagonal(self) -> float:
        """Return the length of the diagonal of `box`, metres; 0 without good triangles."""
        low, high = self.box
        return float(np.linalg.norm(high - low)) if np.isfinite(low).all() else 0.0

    @cached_property
    def world(self) -> WorldTriangles:
        """Return the good triangles of all instances in world space."""
        threads = thread_count(self.settings.threads)
        return WorldTriangles(
            self.source.instances, self.meshes, self.scene.materials, self.scene.origin, threads=threads
        )

    @cached_property
    def mesh_with(self) -> dict[int, int]:
        """Return, by material index, the first mesh that has good triangles of this material."""
        found: dict[int, int] = {}
        for m, facts in enumerate(self.meshes):
            for k in np.unique(facts.material[facts.good]).tolist():
                found.setdefault(k, m)
        return found

    @cached_property
    def used_materials(self) -> list[int]:
        """Return the indices of the materials that good triangles use, sorted."""
        return sorted(self.mesh_with)

    @cached_property
    def channels(self) -> tuple[Channel, ...]:
        """Return the channels to be baked."""
        return tuple(chosen_channels(self.settings.channels).values())

    @property
    def lit(self) -> bool:
        """Return whether the sky, or any light without area, emits light."""
        bright = [max(light.intensity) for light in self.scene.lights]
        return max([*bright, *self.settings.sky_radiance], default=0.0) > 0

    @property
    def bakes_light(self) -> bool:
        """Return whether a channel to be baked needs light."""
        return any(channel.needs_light for channel in self.channels)

    @property
    def bakes_ambient_occlusion(self) -> bool:
        """Return whether a channel to be baked needs ambient occlusion."""
        return any(channel.needs_ambient_occlusion for channel in self.channels)

    @cached_property
    def emission(self) -> Emission:
        """Return the world triangles that emit, with their radiance."""
        return find_emission(self.world)

    @property
    def emits(self) -> bool:
        """Return whether any good triangle emits.

        A triangle whose emissive texture is black everywhere on the triangle does not emit.
        """
        some = any(max(self.scene.materials[k].emission) > 0 for k in self.used_materials)
        return some and len(self.emission.triangle) > 0

    @cached_property
    def levels(self) -> Levels | None:
        """Return direct irradiance at sample points.

        None if the scene has no light or no surface, or if no channel to be baked needs light.
        """
        if not self.bakes_light or not (self.lit or self.emits) or not self.world.area.sum() > 0:
            return None
        return estimate_levels(self.scene, self.world, self.emission, self.settings)

    def uv(self, mesh: int) -> UvFacts:
        """Return the lightmap uv of the mesh with index `mesh`."""
        if mesh not in self._uv:
            self._uv[mesh] = UvFacts(self.meshes[mesh])
        return self._uv[mesh]

    def location(self, mesh: int) -> Location:
        """Return the location of a finding about a mesh: its first instance, or its name if it has none."""
        instance = self.first_instance.get(mesh)
        if instance is None:
            return Location(self.source.meshes[mesh].name)
        return Location(instance.name or self.source.meshes[mesh].name, instance.node)

    def to_world(self, mesh: int, point: NDArray[np.floating]) -> tuple[float, float, float]:
        """Transform a point (3,) from object space to world space, metres, by the mesh's first instance."""
        instance = self.first_instance.get(mesh)
        matrix = np.eye(4) if instance is None else instance.world_from_object
        x, y, z = (float(v) for v in matrix[:3, :3] @ np.asarray(point, np.float64) + matrix[:3, 3])
        return x, y, z


def source_scene_of(scene: Scene) -> SourceScene:
    """Return a source scene made of the meshes and instances of a scene read for a bake."""
    meshes = tuple(SourceMesh(mesh.name, _primitives(mesh)) for mesh in scene.meshes)
    stand = tuple(SourceInstance(i.node, i.name, i.mesh, i.world_from_object) for i in scene.instances)
    return SourceScene(meshes, stand)


def _primitives(mesh: Mesh) -> tuple[SourcePrimitive, ...]:
    # Vertices and triangles are sorted by primitive, so a slice selects those of one primitive.
    out = []
    for number in np.unique(mesh.primitive):
        rows = slice(*np.searchsorted(mesh.vertex_primitive, [number, number + 1]))
        faces = slice(*np.searchsorted(mesh.primitive, [number, number + 1]))
        out.append(
            SourcePrimitive(
                index=int(number),
                material=int(mesh.material[faces][0]),
                position=mesh.position[rows],
                triangle=mesh.triangle[faces].astype(np.int64) - rows.start,
                normal=mesh.normal[rows],
                texcoord={k: value[rows] for k, value in enumerate(mesh.texcoord) if value is not None},
                colour=None if mesh.colour is None else mesh.colour[rows],
            )
        )
    return tuple(out)
