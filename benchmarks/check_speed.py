"""Measures `baker check` on a mesh of a million triangles with lightmap uv, and on a hundred kit pieces.

Usage:

    python benchmarks/check_speed.py             both cases, each in one process, after an unmeasured run
    python benchmarks/check_speed.py --profile   time of each check on the million triangles
"""

from __future__ import annotations

import json
import struct
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

KIT = Path(__file__).parents[1] / "assets" / "third-party"
# Number of vertices along a side of the grid, which has 2 * 708^2 = 1 002 528 triangles.
SIDE = 709
# Number of charts along a side of the grid.
CHARTS = 12


def bumpy_sheet(side: int = SIDE) -> bytes:
    """Return a GLB file of one wavy sheet.

    Its uv consists of square charts with gaps of about ten texels on a page of 2048 x 2048 texels.
    """
    cells = side - 1
    per_chart = cells // CHARTS
    position, uv, triangle = [], [], []
    start = 0
    for a in range(CHARTS):
        for b in range(CHARTS):
            u, v = np.meshgrid(np.arange(per_chart + 1), np.arange(per_chart + 1), indexing="ij")
            x, z = (u + a * per_chart) / cells * 40.0, (v + b * per_chart) / cells * 40.0
            y = np.sin(x) * np.cos(1.3 * z)
            position.append(np.stack([x, y, z], axis=-1).reshape(-1, 3))
            cell = 1.0 / CHARTS
            inside = [(i + 0.03 + 0.94 * w / per_chart) * cell for i, w in ((a, u), (b, v))]
            uv.append(np.stack(inside, axis=-1).reshape(-1, 2))
            n = per_chart + 1
            corner = (np.arange(per_chart)[:, None] * n + np.arange(per_chart)).reshape(-1) + start
            one = np.stack([corner, corner + 1, corner + n], axis=1)
            two = np.stack([corner + 1, corner + n + 1, corner + n], axis=1)
            triangle += [one, two]
            start += n * n
    return pack(np.concatenate(position), np.concatenate(uv), np.concatenate(triangle))


def pack(position: np.ndarray, uv: np.ndarray, triangle: np.ndarray) -> bytes:
    """Return a GLB file of one mesh with all normals along +Y."""
    arrays = [
        (np.float32(position), "VEC3", 5126),
        (np.float32(np.tile([0.0, 1.0, 0.0], (len(position), 1))), "VEC3", 5126),
        (np.float32(uv), "VEC2", 5126),
        (np.uint32(triangle.reshape(-1)), "SCALAR", 5125),
    ]
    blob = b"".join(array.tobytes() for array, _, _ in arrays)
    views, accessors, offset = [], [], 0
    for k, (array, kind, code) in enumerate(arrays):
        views.append({"buffer": 0, "byteOffset": offset, "byteLength": array.nbytes})
        accessors.append({"bufferView": k, "componentType": code, "count": len(array), "type": kind})
        offset += array.nbytes
    attributes = {"POSITION": 0, "NORMAL": 1, "TEXCOORD_0": 2, "TEXCOORD_1": 2}
    document = {
        "asset": {"version": "2.0"}, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0, "name": "sheet"}],
        "meshes": [{"primitives": [{"attributes": attributes, "indices": 3}]}],
        "accessors": accessors, "bufferViews": views, "buffers": [{"byteLength": len(blob)}],
    }  # fmt: skip
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    body = struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(blob), 0x004E4942) + blob
    return struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body


def kit_pieces(count: int = 100) -> list[str]:
    """Return `count` paths of small kit pieces; if there are fewer pieces, paths are repeated."""
    pieces = sorted(p for p in KIT.rglob("*.glb") if p.parts[-2].startswith(("kaykit", "kenney")))
    return [str(pieces[k % len(pieces)]) for k in range(count)]


def timed(*arguments: str) -> float:
    """Run `baker check` once and return its duration in seconds."""
    start = time.perf_counter()
    subprocess.run(
        [sys.executable, "-m", "baker.cli", "check", *arguments, "-q"], check=False, stdout=subprocess.DEVNULL
    )
    return time.perf_counter() - start


def profile(path: Path) -> None:
    """Print the duration of the 20 slowest checks and of all checks together, slowest first."""
    from baker.checks.run import check_scene
    from baker.checks.settings import CheckSettings
    from baker.core.settings import BakeSettings

    report = check_scene(path, CheckSettings(), BakeSettings(resolution=2048))
    for name, seconds in sorted(report.timings.items(), key=lambda item: -item[1])[:20]:
        print(f"{name:24} {seconds:7.2f} s")
    print(f"{'all':24} {report.seconds:7.2f} s, {len(report.findings)} findings")


def main() -> None:
    """Measure both cases, or profile the first, and print the durations."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "million.glb"
        path.write_bytes(bumpy_sheet())
        if "--profile" in sys.argv[1:]:
            profile(path)
            return
        pieces = [Path(folder) / f"piece_{k}.glb" for k in range(100)]
        for piece, source in zip(pieces, kit_pieces(), strict=True):
            piece.write_bytes(Path(source).read_bytes())
            for texture in (Path(source).parent / "Textures").glob("*"):
                (Path(folder) / "Textures").mkdir(exist_ok=True)
                (Path(folder) / "Textures" / texture.name).write_bytes(texture.read_bytes())
        timed(str(pieces[0]), "--resolution", "256")
        print(f"1 M triangles at 2048: {timed(str(path), '--resolution', '2048'):.1f} s")
        print(f"100 kit pieces:        {timed(*map(str, pieces)):.1f} s")


if __name__ == "__main__":
    main()
