"""The scenes of the guard's runs: files of `assets/`, and small scenes built without code of `baker`."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
for _folder in ("assets", "tests", "tests/unit/checks"):
    if str(ROOT / _folder) not in sys.path:
        sys.path.append(str(ROOT / _folder))

import flawed_scenes  # noqa: E402
import gltf_builder as gltf  # noqa: E402
from glb import GlbBuilder  # noqa: E402
from shapes import ball, box, box_faces, quads  # noqa: E402

ASSETS = (
    "cornell.glb",
    "interior.glb",
    "hall.glb",
    "levels/street.glb",
    "levels/warehouse.glb",
    "third-party/cornell-original/CornellBox-Original.obj",
    "third-party/cornell-original/CornellBox-Original.mtl",
    "third-party/kenney-city-building-a/building-small-a.glb",
    "third-party/kenney-city-building-a/Textures/colormap.png",
    "third-party/kaykit-dungeon-torch/torch_mounted.gltf.glb",
    "third-party/nasty/duplicate_edge.obj",
    "third-party/nasty/zero_area_face.obj",
)

JOBS = """
[defaults]
out = "baked/{stem}"
resolution = 32
samples = 4
sky = [1, 1, 1]

[[job]]
glob = "scenes/parts/*.glb"

[[job]]
scene = "scenes/cornell.glb"
seed = 3
"""

CONFIG = """
resolution = 32
samples = 4
channels = ["ao", "irradiance"]
sky = "2,3,4"
sky-strength = 0.5
ao-distance = 0.3
seed = 7
"""


def write_scenes(folder: Path) -> None:
    """Write all scenes into a folder; files of `assets/` are copied together with their textures."""
    folder.mkdir(parents=True)
    for name in ASSETS:
        source, inside = ROOT / "assets" / name, Path(name).parts
        target = folder / (Path(*inside[2:]) if inside[0] == "third-party" else inside[-1])
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(source, target)
    for name, glass in (("glass.glb", True), ("holes.glb", False)):
        _window(glass=glass).write(folder / name)
    _crates().write(folder / "crates.glb")
    _text_meshes(folder)
    gltf.write(folder / "square.gltf", gltf.quad_builder(name="white", doubleSided=True))
    (folder / "parts").mkdir()
    for name in ("a", "b"):
        part = gltf.quad_builder()
        part.json["extras"] = {"name": name}
        gltf.write(folder / "parts" / f"{name}.glb", part)
    (folder / "faults").mkdir()
    for name, case in flawed_scenes.CASES.items():
        (folder / "faults" / f"{name}.glb").write_bytes(case.bad)
    (folder / "broken.glb").write_bytes((folder / "cornell.glb").read_bytes()[:3000])
    (folder / "JOBS.toml").write_text(JOBS)
    (folder / "bake.toml").write_text(CONFIG)
    (folder / "unknown.toml").write_text("resolutoin = 32\n")


def _window(*, glass: bool) -> GlbBuilder:
    """Return a room whose window is coloured glass (`glass`) or a grating with a `MASK` texture."""
    builder = GlbBuilder()
    wall = builder.material("wall", (0.7, 0.6, 0.5))
    if glass:
        pane = builder.material("pane", (0.9, 0.4, 0.2), alpha=0.3, mode="BLEND", double_sided=True)
    else:
        picture = np.full((16, 16, 4), 200, np.uint8)
        picture[..., 3] = np.where(np.indices((16, 16)).sum(axis=0) // 4 % 2, 255, 0)
        pane = builder.material("grating", (0.8, 0.8, 0.8), texture=picture, mode="MASK", double_sided=True)
    room = box_faces((-1.0, 0.0, -1.0), (1.0, 2.0, 1.0))
    inner = quads([corners[::-1] for side, corners in room.items() if side != "+z"])
    builder.place("room", builder.mesh("room", [(inner, wall)]))
    sheet = quads([[(-1.0, 0.0, 1.0), (1.0, 0.0, 1.0), (1.0, 2.0, 1.0), (-1.0, 2.0, 1.0)]], uv_scale=1.0)
    builder.place("pane", builder.mesh("pane", [(sheet, pane)]))
    builder.light("sun", "directional", 1000.0, towards=(0.2, -0.4, -1.0))
    builder.light("bulb", "point", 20.0, at=(0.1, 1.4, 2.0))
    builder.camera((0.0, 1.0, 0.9), (0.0, 0.8, -1.0), 70.0)
    return builder


def _crates() -> GlbBuilder:
    """Return instances of a crate and a ball on a floor, lit by a spot light, an emitter and a sun."""
    builder = GlbBuilder()
    wood = builder.material("wood", (0.5, 0.3, 0.2))
    grey = builder.material("grey", (0.5, 0.5, 0.5), roughness=0.4)
    emissive = builder.material("glow", (0.0, 0.0, 0.0), emission=(90.0, 60.0, 30.0))
    floor = quads([[(-2.0, 0.0, 2.0), (2.0, 0.0, 2.0), (2.0, 0.0, -2.0), (-2.0, 0.0, -2.0)]])
    builder.place("floor", builder.mesh("floor", [(floor, grey)]))
    crate, marble = (
        builder.mesh("crate", [(box((0.6, 0.6, 0.6)), wood)]),
        builder.mesh("marble", [(ball(0.3, 1), grey)]),
    )
    for k in range(3):
        builder.place(f"crate {k}", crate, (1.2 * k - 1.2, 0.0, -0.5), turn=25.0 * k, scale=1.0 + 0.2 * k)
    builder.place("marble 0", marble, (-0.6, 0.3, 0.8))
    builder.place("marble 1", marble, (0.7, 0.6, 0.7), scale=2.0)
    builder.place("lamp", builder.mesh("lamp", [(box((0.3, 0.1, 0.3)), emissive)]), (0.0, 1.6, 0.0))
    builder.light("spot", "spot", 200.0, at=(1.5, 2.0, 1.5), towards=(-1.0, -1.2, -1.0))
    builder.light("sun", "directional", 300.0, colour=(1.0, 0.9, 0.7), towards=(0.3, -1.0, -0.2))
    builder.camera((0.0, 1.5, 3.5), (0.0, 0.4, 0.0), 50.0)
    return builder


def _text_meshes(folder: Path) -> None:
    """Write two rectangles that form an L as text files in PLY, OFF and STL."""
    point = [(0, 0, 0), (1, 0, 0), (1, 0, 1), (0, 0, 1), (1, 1, 0), (0, 1, 0)]
    face = [(0, 3, 2), (0, 2, 1), (0, 1, 4), (0, 4, 5)]
    rows = "".join(f"{x} {y} {z}\n" for x, y, z in point)
    faces = "".join(f"3 {a} {b} {c}\n" for a, b, c in face)
    properties = "".join(f"property float {axis}\n" for axis in "xyz")
    head = f"ply\nformat ascii 1.0\nelement vertex {len(point)}\n{properties}"
    head += f"element face {len(face)}\nproperty list uchar int vertex_indices\nend_header\n"
    (folder / "corner.ply").write_text(head + rows + faces)
    (folder / "corner.off").write_text(f"OFF\n{len(point)} {len(face)} 0\n{rows}{faces}")
    facets = ""
    for corners in face:
        inner = "".join("vertex {} {} {}\n".format(*point[k]) for k in corners)
        facets += f"facet normal 0 0 0\nouter loop\n{inner}endloop\nendfacet\n"
    (folder / "corner.stl").write_text(f"solid corner\n{facets}endsolid corner\n")
