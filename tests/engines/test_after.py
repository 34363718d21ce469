"""Tools that change a GLB after a bake keep the lightmap uv with the flags of docs/AFTER.md only.

The test runs by hand because the tools are large:

    npm install --prefix tests/engines/after
    pytest -m engines_by_hand tests/engines/test_after.py
"""

from __future__ import annotations

import json
import subprocess
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from browser import need_program
from engine_scenes import whole_layout
from gltf_builder import GltfBuilder, write

from baker.channels.channel import make_lightmap
from baker.core.atlas import Atlas
from baker.core.lightmap import BakeResult
from baker.core.settings import make_settings
from baker.io.bake.write_bake import write_bake
from baker.io.load import load_scene

pytestmark = pytest.mark.engines_by_hand
HERE = Path(__file__).parent / "after"
BLENDER = Path(__file__).parent / "blender-env" / "bin" / "python"
# Side of the page in which errors are measured, texels.
PAGE = 1024
SIZE = 64
GRID = 12


class Found(NamedTuple):
    """What a tool kept: the largest uv error in texels, and whether node indices and extras are unchanged."""

    texels: float
    nodes: bool
    extras: bool


def bump(height):
    """Return positions, triangles and uv of a grid of 1 x 1 m that bulges by `height`."""
    u, v = np.meshgrid(np.linspace(0, 1, GRID + 1), np.linspace(0, 1, GRID + 1))
    z = height * np.sin(np.pi * u) * np.sin(np.pi * v)
    corner = (np.arange(GRID)[:, None] * (GRID + 1) + np.arange(GRID)).ravel()
    quad = corner[:, None] + [0, GRID + 1, GRID + 2, 1]
    triangle = np.concatenate([quad[:, [0, 1, 2]], quad[:, [0, 2, 3]]])
    # The lightmap uv is no linear function of the position, as in a real unwrap.
    uv = np.stack([0.05 + 0.9 * u**1.5, 0.05 + 0.9 * v], axis=-1)
    position = np.stack([u, 1 - v, z], axis=-1)
    return np.float32(position).reshape(-1, 3), np.uint16(triangle), np.float32(uv).reshape(-1, 2)


def after_scene():
    """Return three bumps of one material: a node with a child, a child, and a node with the same name."""
    builder = GltfBuilder()
    grey = builder.add("materials", {"name": "grey", "pbrMetallicRoughness": {"metallicFactor": 0.0}})
    for number, name in enumerate(["wall", "post", "wall"]):
        position, triangle, uv = bump(0.1 * number + 0.1)
        # No texture reads set 0.
        uvs = {"TEXCOORD_0": uv[:, ::-1].copy(), "TEXCOORD_1": uv}
        mesh = builder.mesh(builder.primitive(position, triangle, material=grey, **uvs))
        builder.node(name=name, mesh=mesh, extras={"room": number + 1}, translation=[1.5 * number, 0.0, 0.0])
    builder.json["nodes"][0]["children"] = [1]
    builder.json["scenes"] = [{"nodes": [0, 2]}]
    return builder


def write_after(folder, channels=("irradiance", "ao")):
    scene = load_scene(write(folder / "after.glb", after_scene()))
    rng = np.random.default_rng(1)
    maps = {
        "irradiance": make_lightmap("irradiance", rng.random((1, SIZE, SIZE, 3), np.float32)),
        "ao": make_lightmap("ao", rng.random((1, SIZE, SIZE, 1), np.float32)),
    }
    result = BakeResult(
        scene=scene,
        atlas=Atlas(SIZE, 1, tuple(whole_layout(scene, index, 0) for index in range(3)), 3, 0),
        settings=make_settings({"resolution": SIZE, "export": "gltf"}),
        lightmaps={name: maps[name] for name in channels},
        status=np.ones((1, SIZE, SIZE), np.uint8),
        texel_count=np.full(3, SIZE * SIZE),
    )
    write_bake(result, folder / "out")
    return folder / "out" / "scene.glb"


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    return write_after(tmp_path_factory.mktemp("after"))


@pytest.fixture(scope="module")
def without_ao(tmp_path_factory):
    return write_after(tmp_path_factory.mktemp("without_ao"), ("irradiance",))


def run(*command):
    program = HERE / "node_modules" / ".bin" / command[0]
    if not program.exists():
        pytest.fail("the tools are not installed: npm install --prefix tests/engines/after")
    done = subprocess.run([program, *command[1:]], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr


def nodes_of(path):
    need_program("node", "nodejs")
    script = HERE / "read_glb.mjs"
    done = subprocess.run(["node", script, path], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def surface(nodes):
    """Return the world-space triangles (T, 3, 3) and their lightmap uv (T, 3, 2)."""
    corner, uv = [np.zeros((0, 3, 3))], [np.zeros((0, 3, 2))]
    for node in nodes:
        matrix = np.array(node["matrix"]).reshape(4, 4).T
        for primitive in node["primitives"]:
            if primitive.get("uv") is None:
                continue
            triangle = np.array(primitive["triangle"]).reshape(-1, 3)
            world = np.array(primitive["position"]) @ matrix[:3, :3].T + matrix[:3, 3]
            corner.append(world[triangle])
            uv.append(np.array(primitive["uv"])[triangle])
    return np.concatenate(corner), np.concatenate(uv)


def uv_error(before, after):
    """Return the largest error of the lightmap uv at the vertices of `before`, texels of a page of PAGE."""
    import trimesh

    corner, uv = surface(before)
    point, first = np.unique(corner.reshape(-1, 3).round(6), axis=0, return_index=True)
    wanted = uv.reshape(-1, 2)[first]
    triangle, found = surface(after)
    worst = 0.0
    for p, u in zip(point, wanted, strict=True):
        if not len(triangle):
            return float("inf")
        many = np.broadcast_to(p, (len(triangle), 3))
        nearest = trimesh.triangles.closest_point(triangle, many)
        close = np.linalg.norm(nearest - p, axis=1) < 0.002
        weight = trimesh.triangles.points_to_barycentric(triangle[close], nearest[close])
        here = np.einsum("tc,tck->tk", weight, found[close])
        worst = max(worst, np.abs(here - u).max(axis=1).min(initial=np.inf) * PAGE)
    return worst


def compare(before, after):
    """Return what is left in the file `after`: error of the uv, objects at their node indices, extras."""
    old, new = nodes_of(before), nodes_of(after)
    same = len(new) >= len(old) and all(
        n["name"] == o["name"] and bool(n["primitives"]) == bool(o["primitives"])
        for o, n in zip(old, new, strict=False)
    )
    extras = [node["extras"].get("room") for node in new]
    return Found(uv_error(old, new), same, all(node["extras"]["room"] in extras for node in old))


FLAGS = "--prune false --join false --simplify false --palette false"
OPTIMIZE = f"gltf-transform optimize IN OUT {FLAGS} --texture-compress false"
PACK = "gltfpack -i IN -o OUT -kn -km -ke"


def after(tmp_path, scene, command):
    """Run a command with IN and OUT replaced by file paths, and return what the tool kept."""
    out = tmp_path / "changed.glb"
    run(*(str({"IN": scene, "OUT": out}.get(word, word)) for word in command.split()))
    return compare(scene, out)


@pytest.mark.parametrize(
    ("command", "texels"),
    [
        (f"{OPTIMIZE} --compress false", 1e-4),
        (f"{OPTIMIZE} --compress draco", 0.14),
        (f"{OPTIMIZE} --compress meshopt", 0.14),
        ("gltf-transform draco IN OUT --quantize-texcoord 16", 0.01),
        ("gltf-transform prune IN OUT --keep-attributes true --keep-leaves true", 1e-4),
        ("gltf-transform webp IN OUT", 1e-4),
        (f"{PACK} -kv -c -noq", 1e-4),
        (f"{PACK} -kv -c -vtf -vpf", 0.14),
    ],
)
@pytest.mark.parametrize("ao", [True, False], ids=["ao", "no ao"])
def test_the_flags_of_the_page_keep_all(tmp_path, scene, without_ao, command, texels, ao):
    found = after(tmp_path, scene if ao else without_ao, command)
    assert found.texels <= texels
    assert found.nodes
    assert found.extras


@pytest.mark.parametrize(
    ("command", "lost"),
    [
        ("gltf-transform optimize IN OUT", "uv nodes extras"),
        (OPTIMIZE.replace("--prune false", "") + " --compress false", "uv"),
        (OPTIMIZE.replace("--join false", "") + " --compress false", "nodes extras"),
        (OPTIMIZE.replace("--simplify false", "") + " --compress false", "uv"),
        # The mesh of a node with children moves to a new node.
        (f"{OPTIMIZE} --flatten false --compress meshopt", "nodes"),
        ("gltf-transform meshopt IN OUT", "nodes"),
        ("gltf-transform draco IN OUT --quantize-texcoord 8", "uv"),
        ("gltf-transform prune IN OUT", "uv"),
        ("gltfpack -i IN -o OUT", "uv nodes extras"),
        (f"{PACK} -kv -c -vpf", "uv"),
        # Meshes move to new nodes.
        (f"{PACK} -kv -c -vtf", "nodes"),
        (f"{PACK} -kv -c -vtf -vpf".replace("-ke", ""), "extras"),
        (f"{PACK} -kv -c -vtf -vpf".replace("-kn", ""), "nodes extras"),
        (f"{PACK} -kv -c -vtf -vpf -si 0.5", "uv"),
    ],
)
def test_other_flags_lose_data(tmp_path, scene, command, lost):
    found = after(tmp_path, scene, command)
    kept = {"uv": found.texels < 0.5, "nodes": found.nodes, "extras": found.extras}
    assert " ".join(name for name, good in kept.items() if not good) == lost


def test_gltfpack_drops_the_uv_of_a_bake_without_ao_unless_told(tmp_path, without_ao):
    """Without AO, no texture reads the lightmap uv, so gltfpack drops the uv."""
    assert after(tmp_path, without_ao, f"{PACK} -c -noq").texels > 0.5


def test_gltf_transform_removes_moz_lightmap(tmp_path, scene):
    source, out = scene.parent / "gltf" / "lightmaps.glb", tmp_path / "changed.glb"
    run("gltf-transform", "copy", source, out)
    assert b"MOZ_lightmap" in source.read_bytes()
    assert b"MOZ_lightmap" not in out.read_bytes()


def test_gltfjsx_names_each_node_and_changes_the_file_only_with_transform(tmp_path, scene):
    copy = tmp_path / "scene.glb"
    copy.write_bytes(scene.read_bytes())
    run("gltfjsx", copy, "--keepnames", "-o", tmp_path / "Scene.jsx")
    text = (tmp_path / "Scene.jsx").read_text("utf-8")
    assert text.count("geometry={nodes.") == 3
    assert copy.read_bytes() == scene.read_bytes()
    run("gltfjsx", copy, "--transform", "-o", tmp_path / "Scene.jsx")
    found = compare(scene, tmp_path / "scene-transformed.glb")
    assert found.texels > 0.5
    assert not found.nodes


@pytest.mark.parametrize(
    ("keywords", "texels", "extras"),
    [
        ({"export_extras": True}, 1e-3, True),
        ({}, 1e-3, False),
        ({"export_extras": True, "export_texcoords": False}, np.inf, True),
        (
            {
                "export_extras": True,
                "export_draco_mesh_compression_enable": True,
                "export_draco_texcoord_quantization": 16,
            },
            0.01,
            True,
        ),
    ],
    ids=["kept", "no extras", "no uv", "draco"],
)
def test_through_blender(tmp_path, scene, keywords, texels, extras):
    """Blender keeps the uv, but sorts nodes by name and renames the second of two equal names."""
    out = tmp_path / "blender.glb"
    through_blender(scene, out, keywords)
    found = compare(scene, out)
    assert found.texels <= texels
    assert (found.texels < 0.5) == (texels < 0.5)
    assert found.extras == extras
    assert [node["name"] for node in nodes_of(out)] == ["post", "wall", "wall.001"]


def test_through_an_fbx_file_of_blender(tmp_path, scene):
    out = tmp_path / "blender.glb"
    through_blender(scene, out, {"export_extras": True}, tmp_path / "scene.fbx")
    found = compare(scene, out)
    assert found.texels <= 1e-3
    assert found.extras


def through_blender(*arguments):
    """Run `blender_round_trip.py`; its arguments are described there, the third is a dict."""
    if not BLENDER.exists():
        pytest.fail(f"Blender is not installed in {BLENDER.parents[1].name}; test_blender.py says how")
    words = [json.dumps(word) if isinstance(word, dict) else word for word in arguments]
    command = [BLENDER, HERE / "blender_round_trip.py", *words]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-2000:]
