"""Computes the lightmap uv of all instances from packed pages."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from baker.core.atlas import InstanceLayout, SharedUv, page_uv
from baker.core.scene import Scene
from baker.uv.blocks import BlockLayout, Blocks, block_ratio, layout_uv
from baker.uv.charts import MeshCharts
from baker.uv.keep import kept_charts, lightmap_uv
from baker.uv.outlines import BlockInstance, CutInstance, Outlines, Placement, RigidInstance, place_uv
from baker.uv.page_packer import Page


@dataclass(frozen=True)
class PackedScene:
    """A scene of which N instances were packed.

    Attributes
    ----------
    scene : Scene
    instance : list of int
        Indices of the N instances.
    placements : list of Placement
        For each of the N instances.
    charts : list of MeshCharts
        Indexed by `charts` of placements.
    outlines : Outlines
        Of the N instances.
    pages : list of Page
        Indices of instances in a page count the N instances.
    repeated : set of int
        Meshes whose instances share TEXCOORD_1.
    resolution : int
        Page width, texels.
    """

    scene: Scene
    instance: list[int]
    placements: list[Placement]
    charts: list[MeshCharts]
    outlines: Outlines
    pages: list[Page]
    repeated: set[int]
    resolution: int

    @cached_property
    def blocks(self) -> list[tuple[BlockLayout, NDArray[np.float32]]]:
        """Return the charts and the TEXCOORD_1 of each layout of `outlines.shapes.blocks`."""
        blocks = self.outlines.shapes.blocks
        if not isinstance(blocks, Blocks):
            return []
        density = np.ones(len(self.outlines.shapes.extent))
        for page in self.pages:
            density[self.outlines.item_shape[self.outlines.first_item[page.instance]]] = page.density
        found = blocks.layouts(density[blocks.shape], (self.resolution, self.pages[0].packing.gap))
        charts = {p.block: self.charts[p.charts] for p in self.placements if isinstance(p, BlockInstance)}
        result = []
        for layout, outlines, own in zip(found, blocks.outlines, charts.values(), strict=True):
            assert layout is not None, "it has been packed"
            result.append((layout, layout_uv(outlines, own, layout)))
        return result

    @cached_property
    def block_number(self) -> dict[int, int]:
        """Return the index in `blocks` by `BlockInstance.block`."""
        own = dict.fromkeys(p.block for p in self.placements if isinstance(p, BlockInstance))
        return {block: k for k, block in enumerate(own)}


def place_instances(packed: PackedScene, shares: Sequence[float]) -> list[InstanceLayout]:
    """Return the layouts of the N packed instances, in order; charts are numbered from 0 in each layout.

    Parameters
    ----------
    packed : PackedScene
        The scene and its pages.
    shares : sequence of N float
        Factor on the density of each instance.
    """
    kept: dict[int, NDArray[np.int32]] = {}
    result: dict[int, InstanceLayout] = {}
    for number, page in enumerate(packed.pages):
        for slot, position, density in zip(page.instance.tolist(), page.position, page.density, strict=True):
            k, placement = packed.instance[slot], packed.placements[slot]
            mesh_number = packed.scene.instances[k].mesh
            mesh = packed.scene.meshes[mesh_number]
            scaled = float(density * shares[slot])
            shared = _shared_uv(packed, slot, page, position, float(density))
            if shared is None:
                uv = place_uv(
                    packed.outlines, slot, placement, packed.charts, page.packing, position, packed.resolution
                )
            else:
                uv = page_uv(shared.uv, shared.scale, shared.offset)
            if isinstance(placement, RigidInstance):
                if mesh_number not in kept:
                    kept[mesh_number] = kept_charts(mesh)
                vertex = np.arange(len(mesh.position), dtype=np.int32)
                triangle, chart = mesh.triangle, kept[mesh_number]
            else:
                own = packed.charts[placement.charts]
                vertex, triangle, chart = own.vertex, own.triangle, own.chart
            is_kept = shared is not None and isinstance(placement, RigidInstance)
            result[slot] = InstanceLayout(
                k, number, vertex, uv, triangle, chart, is_kept, scaled, shared=shared
            )
    return [result[slot] for slot in range(len(packed.instance))]


def _shared_uv(
    packed: PackedScene, slot: int, page: Page, position: NDArray[np.int32], density: float
) -> SharedUv | None:
    """Return the shared TEXCOORD_1 of an instance and its place in the page; None if it shares none."""
    placement = packed.placements[slot]
    mesh = packed.scene.instances[packed.instance[slot]].mesh
    corner = position[0] + 0.5
    if isinstance(placement, BlockInstance):
        number = packed.block_number[placement.block]
        layout, uv = packed.blocks[number]
        ratio = float(block_ratio(np.array([density * placement.factor]), np.array([layout.per_unit]))[0])
        scale = ratio * layout.side / packed.resolution
        offset = corner / packed.resolution
        return SharedUv(number, uv, (scale, scale), (float(offset[0]), float(offset[1])))
    if isinstance(placement, CutInstance) or mesh not in packed.repeated:
        return None
    kept = lightmap_uv(packed.scene.meshes[mesh])
    assert kept is not None
    per_unit = page.packing.scale[packed.outlines.item_shape[packed.outlines.first_item[slot]]]
    scales = per_unit * placement.factor / packed.resolution
    offset = corner / packed.resolution - placement.low * scales
    number = len(packed.blocks) + mesh
    return SharedUv(number, kept, (float(scales[0]), float(scales[1])), (float(offset[0]), float(offset[1])))
