"""A bake of four squares with one mesh and different places in the page, and the pixels of engines.

The squares are 1 x 1 m and tile the probe's square of 2 x 2 m. One is mirrored, one is turned. The page has
4 x 4 fields of different irradiance; each square shows four of them.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from engine_scenes import ALBEDO, SIZE
from gltf_builder import GltfBuilder, write

from baker.channels.channel import make_lightmap
from baker.core.atlas import Atlas, InstanceLayout, SharedUv, page_uv
from baker.core.lightmap import BakeResult
from baker.core.settings import make_settings
from baker.io.bake.write_bake import write_bake
from baker.io.load import load_scene

# Radiance of a white surface for each field of the page, cd/m2, row 0 on top.
FIELD = 2.0 ** (np.arange(16).reshape(4, 4) / 5.0 - 2.0)
# Centre of each square, the factors of its x and y, and the offset of its place in the page.
SQUARES = [
    ((-0.5, 0.5), (1, 1), (0.5, 0.5)),
    ((0.5, 0.5), (-1, 1), (0.0, 0.5)),
    ((-0.5, -0.5), (-1, -1), (0.0, 0.0)),
    ((0.5, -0.5), (1, 1), (0.5, 0.0)),
]
# (row, column) of the fields' centres in the picture, as shares of its size from the top left corner.
CENTRES = [((r + 0.5) / 4, (c + 0.5) / 4) for r in range(4) for c in range(4)]


def write_shared_probe(folder: Path, exports: str, *, ao: bool = False) -> Path:
    """Write the bake with these exports and return the output folder."""
    folder.mkdir(parents=True, exist_ok=True)
    scene = load_scene(write(folder / "squares.glb", _builder()))
    uv = scene.meshes[0].texcoord[1]
    assert uv is not None
    vertex, chart = np.arange(4, dtype=np.int32), np.zeros(2, np.int32)
    layouts = []
    for number, (_, _, offset) in enumerate(SQUARES):
        shared = SharedUv(0, uv, (0.5, 0.5), offset)
        placed = page_uv(uv, shared.scale, offset)
        triangle = scene.meshes[0].triangle
        layouts.append(
            InstanceLayout(number, 0, vertex, placed, triangle, chart + number, True, SIZE / 2, shared=shared)
        )
    light = np.kron(FIELD, np.ones((SIZE // 4, SIZE // 4)))[None, :, :, None] * math.pi
    maps = {"irradiance": make_lightmap("irradiance", np.repeat(light, 3, axis=3).astype(np.float32))}
    if ao:
        maps["ao"] = make_lightmap("ao", np.full((1, SIZE, SIZE, 1), 0.5, np.float32))
    result = BakeResult(
        scene=scene,
        atlas=Atlas(SIZE, 1, tuple(layouts), 4, 0),
        settings=make_settings({"resolution": SIZE, "export": exports}),
        lightmaps=maps,
        status=np.ones((1, SIZE, SIZE), np.uint8),
        texel_count=np.full(4, SIZE * SIZE // 4),
    )
    write_bake(result, folder / "out")
    return folder / "out"


def shows_the_squares(picture: np.ndarray, rel: float = 1e-3) -> bool:
    """Return whether the fields have the right colours, with a relative error of at most `rel`."""
    shown = np.array([picture[int(y * 64), int(x * 64)] for y, x in CENTRES])
    wanted = np.array([_field(2 * x - 1, 1 - 2 * y) for y, x in CENTRES])
    return np.allclose(shown, wanted[:, None] * np.array(ALBEDO), rtol=rel, atol=0)


def _field(x: float, y: float) -> float:
    """Return the radiance of a white surface at a point (x, y) of the squares, cd/m2."""
    number = next(k for k, (c, _, _) in enumerate(SQUARES) if abs(x - c[0]) < 0.5 and abs(y - c[1]) < 0.5)
    centre, axes, offset = SQUARES[number]
    u, v = (x - centre[0]) * axes[0] + 0.5, 0.5 - (y - centre[1]) * axes[1]
    return float(FIELD[int(4 * (0.5 * v + offset[1])), int(4 * (0.5 * u + offset[0]))])


def _builder() -> GltfBuilder:
    builder = GltfBuilder()
    position = np.float32([[-0.5, 0.5, 0], [0.5, 0.5, 0], [0.5, -0.5, 0], [-0.5, -0.5, 0]])
    material = {"pbrMetallicRoughness": {"baseColorFactor": [*ALBEDO, 1.0], "metallicFactor": 0.0}}
    primitive = builder.primitive(
        position,
        np.uint16([[0, 2, 1], [0, 3, 2]]),
        NORMAL=np.float32([[0, 0, 1]] * 4),
        TEXCOORD_0=np.full((4, 2), 0.3, np.float32),
        TEXCOORD_1=np.float32([[0, 0], [1, 0], [1, 1], [0, 1]]),
        material=builder.add("materials", material),
    )
    accessor = builder.json["accessors"][primitive["attributes"]["POSITION"]]
    accessor |= {"min": [-0.5, -0.5, 0], "max": [0.5, 0.5, 0]}
    mesh = builder.mesh(primitive)
    for (x, y), (sx, sy), _ in SQUARES:
        turn = {"rotation": [0, 0, 1, 0]} if sx == sy == -1 else {"scale": [sx, sy, 1]}
        builder.node(name="square", mesh=mesh, translation=[x, y, 0.0], **turn)
    return builder
