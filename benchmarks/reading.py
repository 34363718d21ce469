"""Measures how fast scenes are read: MB of uncompressed data per second, and the peak of memory.

python benchmarks/reading.py                       # an uncompressed file and a Draco file of a large grid
python benchmarks/reading.py --gltfpack gltfpack   # also a meshopt file; the program of npm

Each file is read in a separate process, which prints its processor time and its peak memory.
"""

from __future__ import annotations

import argparse
import json
import resource
import struct
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from baker.io.load import load_scene


def grid(side: int) -> tuple[dict[str, np.ndarray], np.ndarray]:
    """Return the attributes and triangles of a wavy grid of side x side vertices, 32 bytes a vertex."""
    x, z = (a.reshape(-1) for a in np.meshgrid(*2 * [np.linspace(0, 100, side)], indexing="ij"))
    position = np.stack([x, np.sin(x) * np.cos(z), z], axis=1)
    normal = np.stack([-np.cos(x) * np.cos(z), np.ones(len(x)), np.sin(x) * np.sin(z)], axis=1)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    first = (np.arange(side - 1)[:, None] * side + np.arange(side - 1)).reshape(-1, 1)
    triangle = np.concatenate([first + np.array([0, 1, side]), first + np.array([1, side + 1, side])])
    uv = np.stack([x, z], axis=1) / 100
    attributes = {"POSITION": position, "NORMAL": normal, "TEXCOORD_0": uv}
    return {name: value.astype(np.float32) for name, value in attributes.items()}, triangle.astype(np.uint32)


def write_plain(path: Path, attributes: dict[str, np.ndarray], triangle: np.ndarray) -> None:
    """Write an uncompressed GLB."""
    document: dict[str, Any] = {"accessors": [], "bufferViews": [], "meshes": [], "nodes": [{"mesh": 0}]}
    parts, length, primitive = [], 0, {"attributes": {}}
    for name, value in (*attributes.items(), ("indices", triangle.reshape(-1, 1))):
        parts.append(value.tobytes())
        code = 5125 if name == "indices" else 5126
        kind = {1: "SCALAR", 2: "VEC2", 3: "VEC3"}[value.shape[1]]
        bounds = {"min": value.min(axis=0).tolist(), "max": value.max(axis=0).tolist()}
        document["accessors"].append(
            {"bufferView": len(parts) - 1, "componentType": code, "count": len(value), "type": kind, **bounds}
        )
        document["bufferViews"].append({"buffer": 0, "byteOffset": length, "byteLength": len(parts[-1])})
        length += len(parts[-1])
        holder = primitive if name == "indices" else primitive["attributes"]
        holder[name] = len(parts) - 1
    document |= {"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}]}
    document |= {"meshes": [{"primitives": [primitive]}], "buffers": [{"byteLength": length}]}
    write_glb(path, document, b"".join(parts))


def write_draco(path: Path, attributes: dict[str, np.ndarray], triangle: np.ndarray) -> None:
    """Write a GLB with one Draco primitive."""
    import DracoPy

    stream = DracoPy.encode(
        attributes["POSITION"].astype(np.float64),
        triangle,
        quantization_bits=14,
        normals=attributes["NORMAL"].astype(np.float64),
        tex_coord=attributes["TEXCOORD_0"].astype(np.float64),
        tex_coord_quantization_bits=12,
        normal_quantization_bits=10,
    )
    mesh = DracoPy.decode(stream)
    ids = {kind: a["unique_id"] for a in mesh.attributes for kind in [a["attribute_type"]]}
    names = {"POSITION": ids[0], "NORMAL": ids[1], "TEXCOORD_0": ids[3]}
    accessors = [
        {"componentType": 5126, "count": len(mesh.points), "type": f"VEC{attributes[name].shape[1]}"}
        for name in names
    ]
    accessors.append({"componentType": 5125, "count": mesh.faces.size, "type": "SCALAR"})
    primitive = {
        "attributes": {name: k for k, name in enumerate(names)},
        "indices": len(names),
        "extensions": {"KHR_draco_mesh_compression": {"bufferView": 0, "attributes": names}},
    }
    document = {
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [primitive]}], "accessors": accessors,
        "bufferViews": [{"buffer": 0, "byteLength": len(stream)}], "buffers": [{"byteLength": len(stream)}],
        "extensionsUsed": ["KHR_draco_mesh_compression"],
    }  # fmt: skip
    write_glb(path, document, stream)


def write_glb(path: Path, document: dict[str, Any], blob: bytes) -> None:
    """Write a GLB file."""
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    blob += b"\0" * (-len(blob) % 4)
    body = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(blob), b"BIN\0") + blob
    path.write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body)


def read(path: Path) -> None:
    """Read a file, and print processor seconds, seconds and peak memory above the start as JSON."""
    # Import everything first.
    load_scene(Path(__file__).parents[1] / "assets" / "cornell.glb")
    before, begin, used = peak(), time.monotonic(), time.process_time()
    scene = load_scene(path)
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    processor = time.process_time() - used + children.ru_utime + children.ru_stime
    seconds = time.monotonic() - begin
    result = {"processor": processor, "seconds": seconds, "memory": peak() - before}
    print(json.dumps({**result, "triangles": scene.n_triangles}))


def peak() -> float:
    """Return the peak memory of this process, MB; Linux only."""
    status = Path("/proc/self/status").read_text("ascii")
    return int(status.partition("VmHWM:")[2].split()[0]) / 1000


def main() -> None:
    """Write the files, read them, and print a table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--side", type=int, default=1400, help="vertices on a side of the grid")
    parser.add_argument("--gltfpack", help="command of gltfpack, for a meshopt file")
    parser.add_argument("--read", type=Path, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.read:
        read(given.read)
        return
    with tempfile.TemporaryDirectory() as folder:
        attributes, triangle = grid(given.side)
        size = (sum(value.nbytes for value in attributes.values()) + triangle.nbytes) / 1e6
        plain, draco, meshopt = (Path(folder) / f"{name}.glb" for name in ("plain", "draco", "meshopt"))
        write_plain(plain, attributes, triangle)
        write_draco(draco, attributes, triangle)
        if given.gltfpack:
            command = [*given.gltfpack.split(), "-i", str(plain), "-o", str(meshopt), "-cc", "-noq", "-kv"]
            subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        print("file      MB on disk   MB read   MB/s of processor time   MB/s   peak MB / MB read")
        for path in filter(Path.exists, (plain, draco, meshopt)):
            answer = subprocess.run(
                [sys.executable, __file__, "--read", str(path)], check=True, capture_output=True, text=True
            )
            found = json.loads(answer.stdout)
            processor, seconds = size / found["processor"], size / found["seconds"]
            sizes = f"{path.stem:8} {path.stat().st_size / 1e6:10.1f} {size:9.1f}"
            print(f"{sizes} {processor:26.0f} {seconds:6.0f} {found['memory'] / size:19.2f}")


if __name__ == "__main__":
    main()
