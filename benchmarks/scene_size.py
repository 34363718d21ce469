"""Prints how the time of load, check, unwrap and bake grows with the number of objects, by kind of scene.

    python benchmarks/scene_size.py [KIND...] [--counts 500,2000,8000]

Each step of each scene runs in a separate process, which reports its processor time. Every object is a
rectangle, or a cube in the kind `inside_out`. The last column is the exponent k of time ~ count^k between the
two largest scenes: 1 is linear, 2 is quadratic.
"""

from __future__ import annotations

import argparse
import json
import math
import struct
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

KINDS = ("objects", "groups", "materials", "nodes", "meshes", "inside_out")
STEPS = {
    "load": "baker.load(path)",
    "check": "baker.check(path)",
    "unwrap": "baker.unwrap(baker.load(path), resolution=512)",
    "bake": "baker.bake(path, out=path + '-out', resolution=512, samples=1, ao_samples=1)",
}
RUN = """
import sys, time
import baker

path, begin = sys.argv[1], time.process_time()
{step}
print(time.process_time() - begin)
"""
SIDE = 0.8
CUBE = (0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)


def squares(n: int) -> Iterator[tuple[int, int]]:
    """Yield n cells of a square grid."""
    columns = math.ceil(math.sqrt(n))
    return ((k % columns, k // columns) for k in range(n))


def write_obj(folder: Path, kind: str, n: int) -> Path:
    """Write an OBJ file of n rectangles, or of n cubes that are inside out, and return its path."""
    library = [f"newmtl m{k}\nKd 0.5 0.5 0.5" for k in range(n if kind == "materials" else 0)]
    (folder / "scene.mtl").write_text("\n".join(library), "utf-8")
    lines = ["mtllib scene.mtl"] if library else []
    for k, (x, z) in enumerate(squares(n)):
        lines.append(f"g group{k}" if kind == "groups" else f"o object{k}")
        if library:
            lines.append(f"usemtl m{k}")
        if kind == "inside_out":
            lines += [f"v {x + SIDE * (c & 1)} {SIDE * (c >> 1 & 1)} {z + SIDE * (c >> 2)}" for c in range(8)]
            lines += ["f " + " ".join(str(8 * k + c + 1) for c in face) for face in CUBE]
            continue
        corners = ((0, 0), (SIDE, 0), (SIDE, SIDE), (0, SIDE))
        lines += [f"v {x + dx} 0 {z + dz}" for dx, dz in corners]
        lines.append(f"f {4 * k + 1} {4 * k + 4} {4 * k + 3} {4 * k + 2}")
    path = folder / "scene.obj"
    path.write_text("\n".join(lines) + "\n", "utf-8")
    return path


def write_glb(folder: Path, kind: str, n: int) -> Path:
    """Write a GLB file of n nodes, which share one mesh or have n meshes, and return its path."""
    position = np.array([[0, 0, 0], [SIDE, 0, 0], [SIDE, 0, SIDE], [0, 0, SIDE]], "<f4")
    blob = position.tobytes() + np.array([0, 3, 2, 0, 2, 1], "<u2").tobytes()
    n_meshes = n if kind == "meshes" else 1
    primitive = {"attributes": {"POSITION": 0}, "indices": 1}
    high = position.max(axis=0).tolist()
    document: dict[str, Any] = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": list(range(n))}],
        "nodes": [
            {"name": f"node{k}", "translation": [x, 0, z], "mesh": k % n_meshes}
            for k, (x, z) in enumerate(squares(n))
        ],
        "meshes": [{"name": f"mesh{k}", "primitives": [primitive]} for k in range(n_meshes)],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3", "min": [0] * 3, "max": high},
            {"bufferView": 1, "componentType": 5123, "count": 6, "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": 48},
            {"buffer": 0, "byteOffset": 48, "byteLength": 12},
        ],
        "buffers": [{"byteLength": len(blob)}],
    }
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    data = struct.pack("<III", 0x46546C67, 2, 28 + len(text) + len(blob))
    data += struct.pack("<II", len(text), 0x4E4F534A) + text
    data += struct.pack("<II", len(blob), 0x004E4942) + blob
    path = folder / "scene.glb"
    path.write_bytes(data)
    return path


def seconds(path: Path, step: str) -> float:
    """Return the processor time of a step in a new process, seconds."""
    command = [sys.executable, "-c", RUN.format(step=STEPS[step]), str(path)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return float(done.stdout.split()[-1])


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("kinds", nargs="*", help=", ".join(KINDS))
    parser.add_argument("--counts", default="500,2000,8000")
    parser.add_argument("--steps", default=",".join(STEPS))
    given = parser.parse_args()
    counts = [int(count) for count in given.counts.split(",")]
    print("| scene | step |" + "".join(f" {count} |" for count in counts) + " exponent |")
    print("|---|---|" + "---|" * (len(counts) + 1))
    for kind in given.kinds or KINDS:
        rows: dict[str, list[float]] = {step: [] for step in given.steps.split(",")}
        for count in counts:
            with tempfile.TemporaryDirectory() as folder:
                write = write_glb if kind in ("nodes", "meshes") else write_obj
                path = write(Path(folder), kind, count)
                for step, row in rows.items():
                    row.append(seconds(path, step))
        for step, row in rows.items():
            exponent = math.log(row[-1] / row[-2]) / math.log(counts[-1] / counts[-2])
            print(
                f"| {kind} | {step} |" + "".join(f" {t:.2f} |" for t in row) + f" {exponent:.2f} |",
                flush=True,
            )


if __name__ == "__main__":
    main()
