"""Makes a bake without tracing rays, in which every texel, pixel and click has a known value.

A camera at z = 5 looks at the plane z = 0; the picture is 4 m high there. On the left is a square with a base
colour texture, on page 0. On the right is a square without texture, on page 1 with transposed uv. In front of
the right square is a leaf whose left half is a hole.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from gltf_builder import QUAD, QUAD_NORMAL, QUAD_TRIANGLE, GltfBuilder, write

from baker.channels.channel import make_lightmap
from baker.core.atlas import Atlas, InstanceLayout
from baker.core.lightmap import BakeResult, Lightmap, TexelStatus
from baker.core.settings import make_settings
from baker.io.bake.write_bake import write_bake
from baker.io.load import load_scene
from baker.io.png import encode_png

SIZE = 32
# Base colour texture of the left square, sRGB bytes: upper left, upper right, lower left, lower right
# quadrant.
PAINT = np.array([[[230, 60, 60], [60, 200, 80]], [[70, 90, 220], [240, 240, 240]]], np.uint8)
FACTOR = (0.9, 0.8, 0.7, 1.0)
PLAIN = (0.5, 0.4, 0.3, 1.0)
# (x, y) of the lower left corner, side, z of the squares; metres.
PAINTED_AT, PLAIN_AT, LEAF_AT = (-2.1, -1.0, 2.0, 0.0), (0.1, -1.0, 2.0, 0.0), (0.8, -0.3, 0.6, 0.5)


def painted_uv(s, t):
    """Return the uv on page 0 of a point (s, t) of the left square; s to the right, t upwards, 0 to 1."""
    return 0.125 + 0.75 * s, 0.875 - 0.75 * t


def plain_uv(s, t):
    """Return the uv on page 1 of a point (s, t) of the right square."""
    return 0.0625 + 0.5 * t, 0.125 + 0.5 * s


def leaf_uv(s, t):
    """Return the uv on page 1 of a point (s, t) of the leaf."""
    return 0.75 + 0.125 * s, 0.875 - 0.125 * t


def make_bake(folder: Path, *, half: bool = True, name: str = "probe") -> Path:
    """Write the bake into `folder` and return the output folder."""
    folder.mkdir(parents=True, exist_ok=True)
    scene = load_scene(write(folder / f"{name}.glb", _document()))
    layouts = tuple(
        _layout(index, page, place)
        for index, (page, place) in enumerate(((0, painted_uv), (1, plain_uv), (1, leaf_uv)))
    )
    out = folder / "out"
    result = BakeResult(
        scene=scene,
        atlas=Atlas(SIZE, 2, layouts, 3, 2),
        settings=make_settings({"resolution": SIZE, "dtype": "half" if half else "float"}),
        lightmaps=_maps(half),
        status=_status(layouts),
        texel_count=np.array([576, 256, 16]),
        solve={"energy": {"emitted": 0.0, "absorbed": 0.0, "escaped": 0.0}},
    )
    write_bake(result, out)
    return out


def _document() -> GltfBuilder:
    b = GltfBuilder()
    paint = np.repeat(np.repeat(PAINT, 8, axis=0), 8, axis=1)
    leaf = np.full((8, 8, 4), 255, np.uint8)
    leaf[:, :4, 3] = 0
    materials = [
        {
            "name": "paint",
            "pbrMetallicRoughness": {
                "baseColorFactor": list(FACTOR),
                "baseColorTexture": {"index": b.image(encode_png(paint))},
            },
        },
        {
            "name": "plain",
            "pbrMetallicRoughness": {"baseColorFactor": list(PLAIN)},
            "emissiveFactor": [0, 0, 0.5],
        },
        {
            "name": "leaf",
            "alphaMode": "MASK",
            "doubleSided": True,
            "pbrMetallicRoughness": {"baseColorTexture": {"index": b.image(encode_png(leaf))}},
        },
    ]
    uv = np.float32([[0, 1], [1, 1], [1, 0], [0, 0]])  # the texture is upright
    for material, (x, y, side, z), name in zip(
        materials, (PAINTED_AT, PLAIN_AT, LEAF_AT), ("painted", "plain <b>&", "leaf"), strict=True
    ):
        position = QUAD * np.float32(side) + np.float32([x, y, z])
        number = b.add("materials", material)
        part = b.primitive(position, QUAD_TRIANGLE, NORMAL=QUAD_NORMAL, TEXCOORD_0=uv, material=number)
        b.node(mesh=b.mesh(part), name=name)
    lens = {"yfov": 2 * math.atan(0.4), "znear": 0.1}
    b.node(camera=b.add("cameras", {"type": "perspective", "perspective": lens}), translation=[0, 0, 5])
    return b


def _layout(index: int, page: int, place) -> InstanceLayout:
    uv = np.float32([place(*corner) for corner in ((0, 0), (1, 0), (1, 1), (0, 1))])
    corners = QUAD_TRIANGLE.astype(np.int32)
    return InstanceLayout(
        index, page, np.arange(4, dtype=np.int32), uv, corners, np.full(2, index, np.int32), False, 12.0
    )


def _maps(half: bool) -> dict[str, Lightmap]:
    page, row, column = np.meshgrid(np.arange(2), np.arange(SIZE), np.arange(SIZE), indexing="ij")
    # The light is linear in row and column, so that bilinear lookups between texels are also known.
    light = np.stack([10.03125 + row, 10.5 + column, 12 + 6 * page], axis=-1).astype(np.float32)
    if not half:
        light *= np.float32(1.1)  # values that half floats cannot represent
    occlusion = ((column + 0.5) / SIZE)[..., None].astype(np.float32)
    return {"irradiance": make_lightmap("irradiance", light), "ao": make_lightmap("ao", occlusion)}


def _status(layouts) -> np.ndarray:
    status = np.full((2, SIZE, SIZE), TexelStatus.EMPTY, np.uint8)
    for layout in layouts:
        low, high = (
            np.rint(edge * SIZE).astype(int) for edge in (layout.uv.min(axis=0), layout.uv.max(axis=0))
        )
        status[layout.page, low[1] - 1 : high[1] + 1, low[0] - 1 : high[0] + 1] = TexelStatus.DILATED
        status[layout.page, low[1] : high[1], low[0] : high[0]] = TexelStatus.COVERED
    status[0, 8:12, 8:12] = TexelStatus.INVALID
    status[0, 16:20, 16:20] = TexelStatus.UNCONVERGED
    return status
