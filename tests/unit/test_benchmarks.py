"""The benchmarks' blob room, the figures in their tables and the rates of a tiny bake are correct."""

import importlib.util
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from baker.io.load import load_scene

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "benchmarks"


def load(name):
    """Import a benchmark's file as a module whose name differs from those of test helpers."""
    spec = importlib.util.spec_from_file_location(f"benchmark_{name}", FOLDER / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def blobs(tmp_path_factory):
    path = tmp_path_factory.mktemp("blobs") / "blobs.glb"
    return path, load("scenes").write_blobs(4000, path)


def test_series_scene_has_the_triangles_asked_for_and_the_same_bytes_again(blobs, tmp_path):
    path, count = blobs
    assert count == pytest.approx(4000, rel=0.1)
    assert load("scenes").write_blobs(4000, tmp_path / "again.glb") == count
    assert (tmp_path / "again.glb").read_bytes() == path.read_bytes()


def test_series_scene_is_a_closed_room_whose_faces_and_normals_agree(blobs):
    scene = load_scene(blobs[0])
    assert not scene.warnings
    volume = {}
    for mesh in scene.meshes:
        corner = mesh.position[mesh.triangle].astype(np.float64)
        face = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
        shading = mesh.normal[mesh.triangle].astype(np.float64).mean(axis=1)
        size = np.linalg.norm(face, axis=1) * np.linalg.norm(shading, axis=1)
        cosine = (face * shading).sum(axis=1) / size
        assert cosine.min() > 0.8, mesh.name
        # The area vectors of a closed surface sum to 0. The sign of the volume gives the orientation.
        volume[mesh.name] = (np.cross(corner[:, 0], corner[:, 1]) * corner[:, 2]).sum() / 6
        if mesh.name != "lamp":
            np.testing.assert_allclose(face.sum(axis=0), 0, atol=1e-4)
    assert volume["blobs"] > 9 * 2.0
    assert volume["walls"] == pytest.approx(-10 * 5 * 10, rel=1e-5)


def test_tables_show_the_least_of_the_runs_and_the_share_of_the_bare_rate():
    timings = {"load": 0.1, "texels": 0.25, "final gather": 0.5, "finish": 1.0}
    run = {"seconds": 2.0, "cpu": 3.0, "peak": 100.0, "timings": timings, "rays": {"final gather": 4_000_000}}
    slow = {**run, "seconds": 4.0, "peak": 120.0}
    stage = {"seconds": 0.5, "median": 0.5, "rays": 4_000_000, "rate": 8.0, "beside": "closest hit"}
    result = {
        "machine": {"processor": "abacus"},
        "bakes": [{"scene": "box", "resolution": 64, "first": {"seconds": 20.0}, "runs": [slow, run]}],
        "rates": [
            {
                "scene": "box",
                "resolution": 64,
                "stages": {"final gather": stage},
                "bare": {"closest hit": {"made": 10.0, "ready": 16.0}},
            }
        ],
    }
    text = load("report").report(result, markdown=True)
    rows = [
        [cell.strip() for cell in line.strip("|").split("|")]
        for line in text.splitlines()
        if line.startswith("| box")
    ]
    whole, rays, rates = rows
    assert whole[:5] == ["box", "64", "20.0", "2.00", "3.00"]
    assert whole[-2:] == ["0.75", "120"]
    assert rays[2:] == ["4.00, 8.0"]
    assert rates[3:] == ["8.00", "closest hit", "10.0", "80 %", "16.0", "50 %"]
    assert "abacus" in load("report").report(result, markdown=False)


def test_rates_of_a_tiny_bake_stand_beside_bare_ones():
    code = (
        f"import sys, json; sys.path.insert(0, {str(FOLDER)!r}); import rates; from pathlib import Path; "
        f"print(json.dumps(rates.measure(Path({str(ROOT / 'assets' / 'cornell.glb')!r}), "
        "resolution=32, samples=4, repeat=1, sky=None)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert found["triangles"] == 32
    assert found["stages"]["final gather"]["rays"] == 4 * found["texels"]
    for kind, loops in found["bare"].items():
        assert set(loops) == ({"ready"} if kind == "towards emitters" else {"ready", "made"})
        assert min(loops.values()) > 0
    assert {stage["beside"] for stage in found["stages"].values()} <= set(found["bare"])
