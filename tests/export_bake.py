"""A bake of six squares on two pages, from which the tests of exports make their folders."""

from __future__ import annotations

import json
import struct

import numpy as np
from gltf_builder import QUAD, QUAD_NORMAL, QUAD_TRIANGLE, GltfBuilder, write

from baker.channels.channel import make_lightmap
from baker.core.atlas import Atlas, InstanceLayout
from baker.core.export import EXPORTS
from baker.core.lightmap import BakeResult
from baker.core.settings import make_settings
from baker.io.load import load_scene

NAMES = EXPORTS.names()
# Node names that some engine changes or interprets as an import hint; the first name occurs twice.
NODES = ["a.b c", "a.b c", "wall-col", "Ünï/cødé: %@", "x" * 80, ""]
SIZE = 16


def strip(number):
    return np.float32((QUAD[:, :2] + [number // 2, 0.0]) * [0.25, 1.0])


def result(folder, **settings):
    """Return a bake of six squares on two pages. Its light is made up."""
    folder.mkdir(exist_ok=True)
    builder = GltfBuilder()
    for number, name in enumerate(NODES):
        material = {"pbrMetallicRoughness": {"baseColorFactor": [0.8, 0.5, 0.25, 1.0]}}
        uv = np.float32(QUAD[:, :2])
        primitive = builder.primitive(
            QUAD,
            QUAD_TRIANGLE,
            NORMAL=QUAD_NORMAL,
            TEXCOORD_0=uv,
            material=builder.add("materials", material),
        )
        mesh = builder.mesh(primitive, name=name)
        named = {"name": name} if name else {}
        builder.node(mesh=mesh, translation=[2.0 * number, 0.0, 0.0], **named)
    scene = load_scene(write(folder / "level.glb", builder))
    row = np.arange(4, dtype=np.int32)
    # Each page has four strips of four columns. Three strips contain a square each, and the last is empty.
    layouts = tuple(
        InstanceLayout(i, i % 2, row, strip(i), np.int32(QUAD_TRIANGLE), np.full(2, i, np.int32), False, 16.0)
        for i in range(len(NODES))
    )
    rng = np.random.default_rng(1)
    maps = {
        "irradiance": make_lightmap("irradiance", rng.random((2, SIZE, SIZE, 3), np.float32) * 40),
        "ao": make_lightmap("ao", rng.random((2, SIZE, SIZE, 1), np.float32)),
    }
    return BakeResult(
        scene=scene,
        atlas=Atlas(SIZE, 2, layouts, len(NODES), 0),
        settings=make_settings({"resolution": SIZE, **settings}),
        lightmaps=maps,
        status=np.ones((2, SIZE, SIZE), np.uint8),
        texel_count=np.full(len(NODES), SIZE * SIZE),
        suggested_exposure=0.0625,
    )


def document(path):
    data = path.read_bytes()
    (length,) = struct.unpack_from("<I", data, 12)
    assert struct.unpack_from("<I", data, 8) == (len(data),)
    return json.loads(data[20 : 20 + length])
