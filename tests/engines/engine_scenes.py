"""Bakes whose pixels in an engine are known: the probe (made-up light) and the room (constant light).

The probe is a square of 2 x 2 m in the xy plane, seen from +z. All corners have the same TEXCOORD_0, so an
engine that reads the wrong uv set draws a single colour. TEXCOORD_1 covers the whole page with v = 0 at the
top. The irradiance of the four quadrants is pi times 1 and 2 (top), and pi times 1/4 and 1/2 (bottom), from
left to right. Therefore albedo x E / pi is the albedo times 1, 2, 1/4, 1/2.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
from gltf_builder import GltfBuilder, write

import baker
from baker.channels.channel import make_lightmap
from baker.core.atlas import Atlas, InstanceLayout
from baker.core.lightmap import BakeResult
from baker.core.settings import make_settings
from baker.io.bake.write_bake import write_bake
from baker.io.load import load_scene

ALBEDO = (0.8, 0.5, 0.25)
QUADRANT = np.array([[1.0, 2.0], [0.25, 0.5]])
# (row, column) of the quadrants' centres, as shares of the picture's size from its top left corner.
MIDDLE = [(0.25, 0.25), (0.25, 0.75), (0.75, 0.25), (0.75, 0.75)]
# Name of two nodes; loaders change it because of the dot and the space.
NAME = "wall.north side"
SIZE = 64

# The room: its walls emit EMISSION cd/m2 and have albedo REFLECTED, so their radiance is EMISSION / (1 -
# REFLECTED) in every direction.
EMISSION, REFLECTED = 0.5, 0.5
ROOM_RADIANCE = EMISSION / (1.0 - REFLECTED)


def probe_page() -> np.ndarray:
    """Return the irradiance page of the probe, (SIZE, SIZE, 3) float32, lx."""
    page = np.kron(QUADRANT, np.ones((SIZE // 2, SIZE // 2))) * math.pi
    return np.repeat(page[:, :, None], 3, axis=2).astype(np.float32)


def srgb_page() -> np.ndarray:
    """Return the probe's page with the sRGB curve applied, for tests of wrong exports."""
    share = probe_page() / probe_page().max()
    curve = np.where(share > 0.0031308, 1.055 * share ** (1 / 2.4) - 0.055, 12.92 * share)
    return (curve * probe_page().max()).astype(np.float32)


def probe_expected(albedo: tuple[float, float, float] = ALBEDO) -> np.ndarray:
    """Return (4, 3) expected colours at the points `MIDDLE`."""
    return QUADRANT.ravel()[:, None] * np.array(albedo)


def probe_builder(alpha: str = "OPAQUE") -> GltfBuilder:
    """Return the probe's glTF: node 1 is the square, node 2 a distant square with the same name."""
    builder = GltfBuilder()
    position = np.float32([[-1, 1, 0], [1, 1, 0], [1, -1, 0], [-1, -1, 0]])
    whole = np.float32([[0, 0], [1, 0], [1, 1], [0, 1]])
    triangle = np.uint16([[0, 2, 1], [0, 3, 2]])
    material = {"pbrMetallicRoughness": {"baseColorFactor": [*ALBEDO, 1.0], "metallicFactor": 0.0}}
    mesh = builder.mesh(
        builder.primitive(
            position,
            triangle,
            NORMAL=np.float32([[0, 0, 1]] * 4),
            TEXCOORD_0=np.full((4, 2), 0.3, np.float32),
            TEXCOORD_1=whole,
            material=builder.add("materials", material),
        )
    )
    for accessor in builder.json["accessors"]:
        if accessor["type"] == "VEC3" and "min" not in accessor:
            accessor |= {"min": [-1, -1, 0], "max": [1, 1, 0]}
            break
    builder.node(name="empty")
    builder.node(name=NAME, mesh=mesh)
    builder.node(name=NAME, mesh=mesh, translation=[50.0, 0.0, 0.0])
    return builder


def write_probe(
    folder: Path,
    exports: str,
    *,
    page: np.ndarray | None = None,
    builder: GltfBuilder | None = None,
    **settings: Any,
) -> Path:
    """Write the probe as a bake with these exports and return the output folder.

    The distant square is on the second page, which is black. `builder` may have more nodes without meshes.
    """
    light = np.stack([probe_page() if page is None else page, np.zeros((SIZE, SIZE, 3), np.float32)])
    return write_made_up(folder, builder or probe_builder(), light, exports, **settings)


def write_made_up(
    folder: Path,
    builder: GltfBuilder,
    light: np.ndarray,
    exports: str,
    *,
    suggested_exposure: float | None = None,
    **settings: Any,
) -> Path:
    """Write a bake with this irradiance, a page for each object, and return the output folder."""
    folder.mkdir(parents=True, exist_ok=True)
    scene = load_scene(write(folder / "probe.glb", builder))
    count = len(scene.instances)
    layouts = tuple(whole_layout(scene, index, index) for index in range(count))
    result = BakeResult(
        scene=scene,
        atlas=Atlas(SIZE, count, layouts, count, 0),
        settings=make_settings({"resolution": SIZE, "export": exports, **settings}),
        lightmaps={
            "irradiance": make_lightmap("irradiance", light),
            "ao": make_lightmap("ao", np.full((count, SIZE, SIZE, 1), 0.5, np.float32)),
        },
        status=np.ones((count, SIZE, SIZE), np.uint8),
        texel_count=np.full(count, SIZE * SIZE),
        suggested_exposure=suggested_exposure,
    )
    write_bake(result, folder / "out")
    return folder / "out"


def whole_layout(scene: baker.Scene, index: int, page: int) -> InstanceLayout:
    """Return the layout of an instance whose TEXCOORD_1 is used as it is, on a page."""
    mesh = scene.meshes[scene.instances[index].mesh]
    uv, vertex = mesh.texcoord[1], np.arange(len(mesh.position), dtype=np.int32)
    assert uv is not None
    chart = np.full(len(mesh.triangle), index, np.int32)
    return InstanceLayout(index, page, vertex, uv, mesh.triangle, chart, True, SIZE / 2)


def room_builder() -> GltfBuilder:
    """Return a closed box of 2 x 2 x 2 m, fronts inwards, whose walls have one grey, emissive material."""
    builder = GltfBuilder()
    grey = builder.add(
        "materials",
        {
            "pbrMetallicRoughness": {"baseColorFactor": [REFLECTED] * 3 + [1.0], "metallicFactor": 0.0},
            "emissiveFactor": [EMISSION] * 3,
        },
    )
    square = np.float32([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    for axis in range(3):
        for side in (-1.0, 1.0):
            position = np.zeros((4, 3), np.float32)
            position[:, (axis + 1) % 3], position[:, (axis + 2) % 3] = square.T
            position[:, axis] = side
            triangle = np.uint16([[0, 1, 2], [0, 2, 3]])
            normal = np.zeros((4, 3), np.float32)
            normal[:, axis] = -side
            primitive = builder.primitive(
                position,
                triangle if side < 0 else triangle[:, ::-1].copy(),
                NORMAL=normal,
                TEXCOORD_0=np.zeros((4, 2), np.float32),
                material=grey,
            )
            accessor = builder.json["accessors"][primitive["attributes"]["POSITION"]]
            accessor |= {"min": position.min(axis=0).tolist(), "max": position.max(axis=0).tolist()}
            builder.node(name="wall", mesh=builder.mesh(primitive))
    return builder


def write_room(folder: Path, exports: str) -> Path:
    """Bake the room with these exports and return the output folder."""
    folder.mkdir(parents=True, exist_ok=True)
    scene = write(folder / "room.glb", room_builder())
    baker.bake(scene, out=folder / "out", resolution=64, samples=256, export=exports)
    return folder / "out"
