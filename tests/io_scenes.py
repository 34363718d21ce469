"""Makes scenes for tests of writers: a glTF with many features, and atlases and bakes made without rays."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
from gltf_builder import QUAD, QUAD_NORMAL, QUAD_TRIANGLE, GltfBuilder, quad_builder, write

from baker.channels.channel import make_lightmap
from baker.core.atlas import Atlas, InstanceLayout
from baker.core.lightmap import BakeResult
from baker.core.scene import Scene
from baker.core.settings import make_settings
from baker.io.bake.write_bake import write_bake
from baker.io.load import load_scene
from baker.io.png import encode_png

PICTURE = encode_png(np.full((2, 2, 3), 77, np.uint8))
IDENTITY = np.eye(4, dtype=np.float32).reshape(1, 16)


def rich_builder() -> GltfBuilder:
    """Return a document with many features that a bake must preserve.

    The nodes are

    - 0: a skinned mesh with morph targets: a square of triangles, a square as a strip, and lines;
    - 1: the mesh of node 0;
    - 2: a joint;
    - 3: a camera;
    - 4: the mesh of node 0, only in the second scene;
    - 5: a square without skin and morph targets.
    """
    b = GltfBuilder()
    grey = b.add("materials", {"name": "grey", "extras": {"shop": "no. 7"}})
    image = b.image(PICTURE, sampler=b.add("samplers", {"wrapS": 33071}))
    painted = {"name": "painted", "emissiveTexture": {"index": image}, "emissiveFactor": [0, 0, 0]}
    red = b.add("materials", painted)
    first = b.primitive(
        QUAD,
        QUAD_TRIANGLE,
        NORMAL=QUAD_NORMAL,
        TEXCOORD_0=QUAD[:, :2].copy(),
        COLOR_0=np.arange(12, dtype=np.uint8).reshape(4, 3),
        JOINTS_0=np.array([[0, 0, 0, 0]] * 4, np.uint8),
        WEIGHTS_0=np.array([[255, 0, 0, 0]] * 4, np.uint8),
        _HEAT=np.array([10, 20, 30, 40], np.uint16),
        material=grey,
        extras={"part": "front"},
    )
    accessors = b.json["accessors"]
    for name in ("WEIGHTS_0", "COLOR_0"):
        accessors[first["attributes"][name]]["normalized"] = True
    accessors[first["attributes"]["POSITION"]] |= {"min": [0, 0, 0], "max": [1, 1, 0], "name": "points"}
    # In glTF, each element of a vertex attribute starts at a multiple of four bytes.
    heat, colour = np.array([10, 20, 30, 40], "<u2").view(np.uint8), np.arange(12, dtype=np.uint8)
    for name, data in (("COLOR_0", colour), ("_HEAT", heat)):
        rows = data.reshape(4, -1)
        padded = np.pad(rows, ((0, 0), (0, 4 - rows.shape[1])))
        accessors[first["attributes"][name]]["bufferView"] = b.view(padded.tobytes(), byteStride=4)
    sparse = {
        "count": 1,
        "indices": {"bufferView": b.view(np.array([2], np.uint16).tobytes()), "componentType": 5123},
        "values": {"bufferView": b.view(np.array([[0, 0, 5]], np.float32).tobytes())},
    }
    morph = b.add(
        "accessors",
        {
            "componentType": 5126,
            "count": 4,
            "type": "VEC3",
            "sparse": sparse,
            "min": [0, 0, 0],
            "max": [0, 0, 5],
        },
    )
    first["targets"] = [{"POSITION": morph}]
    strip = b.primitive(
        QUAD[[0, 1, 3, 2]] + np.float32([0, 0, 1]), TEXCOORD_0=QUAD[:, :2].copy(), material=red, mode=5
    )
    strip["targets"] = [{"POSITION": b.accessor(np.zeros((4, 3), np.float32), min=[0, 0, 0], max=[0, 0, 0])}]
    lines = b.primitive(QUAD, material=grey, mode=1)
    lines["targets"] = [{"POSITION": b.accessor(np.zeros((4, 3), np.float32), min=[0, 0, 0], max=[0, 0, 0])}]
    mesh = b.mesh(first, strip, lines, name="body", weights=[0.0], extras={"targetNames": ["up"]})
    b.node(mesh=mesh, skin=0, name="first", extensions={"ACME_tag": {"id": 3}})
    b.node(mesh=mesh, name="second", translation=[3, 0, 0])
    b.node(name="joint")
    b.add("cameras", {"type": "perspective", "perspective": {"yfov": 0.7, "znear": 0.1}})
    b.node(name="eye", camera=0, translation=[0, 0, 5])
    b.node(mesh=mesh, name="elsewhere")
    b.node(mesh=b.mesh(b.primitive(QUAD, QUAD_TRIANGLE, material=grey), name="plain"), translation=[0, 3, 0])
    bind = {"type": "MAT4", "componentType": 5126, "bufferView": b.view(IDENTITY.tobytes()), "count": 1}
    b.add("skins", {"joints": [2], "inverseBindMatrices": b.add("accessors", bind)})
    times = b.accessor(np.array([0, 1], np.float32), min=[0], max=[1])
    moves = b.accessor(np.array([[0, 0, 0], [0, 1, 0]], np.float32))
    channel = {"sampler": 0, "target": {"node": 0, "path": "translation"}}
    b.add(
        "animations", {"channels": [channel], "samplers": [{"input": times, "output": moves}], "name": "hop"}
    )
    b.json["scenes"] = [{"nodes": [0, 1, 2, 3, 5], "name": "main"}, {"nodes": [4]}]
    b.json["scene"] = 0
    b.json["extensionsUsed"] = ["ACME_tag"]
    b.json["extensions"] = {"ACME_tag": {"table": [{"any": "thing"}]}}
    b.json["asset"] |= {"copyright": "someone", "extras": {"level": 3}}
    for primitive, depth in ((strip, 1), (lines, 0), (b.json["meshes"][1]["primitives"][0], 0)):
        accessors[primitive["attributes"]["POSITION"]] |= {"min": [0, 0, depth], "max": [1, 1, depth]}
    return b


def split_layout(scene: Scene, index: int, page: int = 0) -> InstanceLayout:
    """Return a layout with a separate vertex for each corner, triangles in reverse order, and random uv."""
    mesh = scene.meshes[scene.instances[index].mesh]
    corner = mesh.triangle[::-1].ravel().astype(np.int32)
    number = np.arange(len(corner), dtype=np.int32).reshape(-1, 3)[::-1]
    uv = np.random.default_rng(index).random((len(corner), 2)).astype(np.float32)
    return InstanceLayout(index, page, corner, uv, number, np.zeros(len(number), np.int32), False, 10.0)


def kept_layout(scene: Scene, index: int, page: int = 0) -> InstanceLayout:
    """Return a layout with the TEXCOORD_1 of the mesh."""
    mesh = scene.meshes[scene.instances[index].mesh]
    uv = mesh.texcoord[1]
    assert uv is not None
    vertex = np.arange(len(mesh.position), dtype=np.int32)
    return InstanceLayout(
        index, page, vertex, uv, mesh.triangle, np.zeros(len(mesh.triangle), np.int32), True, 10.0
    )


def make_atlas(*layouts: InstanceLayout, resolution: int = 16) -> Atlas:
    """Return an atlas with these layouts."""
    pages = 1 + max(layout.page for layout in layouts)
    return Atlas(resolution, pages, layouts, len(layouts), 2)


def quad_result(folder: Path, **settings: object) -> BakeResult:
    """Return a bake of the unit square with random values on one page of irradiance and one of AO."""
    folder.mkdir(parents=True, exist_ok=True)
    scene = load_scene(write(folder / "level.glb", quad_builder(name="wall")))
    rng = np.random.default_rng(4)
    maps = {
        "irradiance": make_lightmap("irradiance", rng.random((1, 16, 16, 3), np.float32) * 50),
        "ao": make_lightmap("ao", rng.random((1, 16, 16, 1), np.float32)),
    }
    status = rng.integers(0, 5, (1, 16, 16)).astype(np.uint8)
    return BakeResult(
        scene=scene,
        atlas=make_atlas(split_layout(scene, 0)),
        settings=make_settings({"resolution": 16, **settings}),
        lightmaps=maps,
        status=status,
        texel_count=np.array([123]),
        timings={"trace": 0.5, "write": 0.1},
        rays={"gather": 1000},
        suggested_exposure=0.0625,
        solve={
            "patches": 4, "nonzeros": 9, "iterations": 3, "residual": 1e-7,
            "energy": {"emitted": np.ones(3), "absorbed": np.full(3, 0.75), "escaped": np.full(3, 0.25)},
        },
    )  # fmt: skip


def write_timed_bake(out: Path, n_texels: int, **members: object) -> None:
    """Write a bake of the unit square into `out`. Its manifest gets `n_texels` and the given members."""
    write_bake(quad_result(out.parent / f"source of {out.name}"), out)
    manifest = json.loads((out / "bake.json").read_text("utf-8"))
    manifest["instances"][0]["texels"] = n_texels
    (out / "bake.json").write_text(json.dumps(manifest | members), "utf-8")
