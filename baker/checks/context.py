"""The context of a check: a scene as its file has it, with values that several rules use."""

from __future__ import annotations

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
from baker.checks.uv_facts import UvFacts
from baker.checks.world_triangles import WorldTriangles
from baker.core.light_kind import check_light_kinds
from baker.core.parallel import thread_count
from baker.core.scene import Mesh, Scene
from baker.core.settings import BakeSettings
from baker.core.source_mesh import SourceInstance, SourceMesh, SourcePrimitive, SourceScene


class CheckContext:
    """A scene, the settings of its bake, and values derived from both, each computed once on first use.

    Attributes
    ----------
    scene : Scene
        Read leniently, or for a bake.
    source : SourceScene
        The meshes of the file, defective triangles included; of a scene read for a bake, its good triangles.
    settings : BakeSettings
    mip : int
        Mip level of the lightmap down to which charts must not bleed into each other.
    meshes : tuple of MeshFacts, one for each of `source.meshes`
    rates : Rates or None
        Speed of an earlier bake.
    probe : bool
        Measure the speed of rays if there are no rates.

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
        trusted = scene.source_scene is None
        self.meshes = tuple(MeshFacts(mesh, scene.materials, trusted=trusted) for mesh in self.source.meshes)

    @cached_property
    def first_instance(self) -> dict[int, SourceInstance]:
        """Return the first instance of each mesh."""
        found: dict[int, SourceInstance] = {}
        for instance in self.source.instances:
            found.setdefault(instance.mesh, instance)
        return found

    @cached_property
    def box(self) -> NDArray[np.float64]:
        """Return the lowest and highest corner (2, 3) of all good triangles, metres, world; inf if none."""
        low, high = np.full(3, np.inf), np.full(3, -np.inf)
        for instance in self.source.instances:
            facts = self.meshes[instance.mesh]
            if not len(facts.good):
                continue
            # Transform the corners of the mesh's bounding box; their box bounds the transformed mesh.
            own = facts.bounds
            box = np.array(list(product(*own.T)))
            world = box @ instance.world_from_object[:3, :3].T + instance.world_from_object[:3, 3]
            low, high = np.minimum(low, world.min(axis=0)), np.maximum(high, world.max(axis=0))
        return np.stack([low, high])

    @property
    def diagonal(self) -> float:
        """Return the diagonal of that box, metres."""
        low, high = self.box
        return float(np.linalg.norm(high - low)) if np.isfinite(low).all() else 0.0

    @cached_property
    def world(self) -> WorldTriangles:
        """Return the good triangles of all instances."""
        threads = thread_count(self.settings.threads)
        return WorldTriangles(
            self.source.instances, self.meshes, self.scene.materials, self.scene.origin, threads=threads
        )

    @cached_property
    def used_materials(self) -> list[int]:
        """Return the indices of materials that good triangles have, sorted."""
        used = [np.unique(facts.material[facts.good]) for facts in self.meshes]
        return [int(k) for k in np.unique(np.concatenate(used))] if used else []

    @cached_property
    def channels(self) -> tuple[Channel, ...]:
        """Return the channels to be baked."""
        return tuple(chosen_channels(self.settings.channels).values())

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
        """Return the triangles that emit."""
        return find_emission(self.world)

    @property
    def emits(self) -> bool:
        """Return whether any triangle emits. One whose part of the emissive texture is black does not."""
        some = any(max(self.scene.materials[k].emission) > 0 for k in self.used_materials)
        return some and len(self.emission.triangle) > 0

    @cached_property
    def levels(self) -> Levels | None:
        """Return direct light at sample points; None without light or surface, or for a bake of AO alone."""
        bright = [max(light.intensity) for light in self.scene.lights]
        lit = max([*bright, *self.settings.sky_radiance], default=0.0) > 0
        if not self.bakes_light or not (lit or self.emits) or not self.world.area.sum() > 0:
            return None
        return estimate_levels(self.scene, self.world, self.emission, self.settings)

    def uv(self, mesh: int) -> UvFacts:
        """Return the lightmap uv of a mesh."""
        if mesh not in self._uv:
            self._uv[mesh] = UvFacts(self.meshes[mesh])
        return self._uv[mesh]

    def location(self, mesh: int) -> Location:
        """Return the first instance of a mesh as the location of a finding."""
        instance = self.first_instance.get(mesh)
        if instance is None:
            return Location(self.source.meshes[mesh].name)
        return Location(instance.name or self.source.meshes[mesh].name, instance.node)

    def to_world(self, mesh: int, point: NDArray[np.floating]) -> tuple[float, float, float]:
        """Return the world position, metres, of a (3,) object-space point in the first instance of a mesh."""
        instance = self.first_instance.get(mesh)
        matrix = np.eye(4) if instance is None else instance.world_from_object
        x, y, z = (float(v) for v in matrix[:3, :3] @ np.asarray(point, np.float64) + matrix[:3, 3])
        return x, y, z


def source_scene_of(scene: Scene) -> SourceScene:
    """Return the good triangles of a scene as a source scene, without copies."""
    meshes = tuple(SourceMesh(mesh.name, _primitives(mesh)) for mesh in scene.meshes)
    stand = tuple(SourceInstance(i.node, i.name, i.mesh, i.world_from_object) for i in scene.instances)
    return SourceScene(meshes, stand)


def _primitives(mesh: Mesh) -> tuple[SourcePrimitive, ...]:
    # Vertices and triangles are sorted by primitive.
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
