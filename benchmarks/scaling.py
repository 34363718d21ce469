"""Measures one bake on 0, 1 and 2 single-thread cluster workers, and a batch with 1 and 2 jobs at a time.

Usage:

    python benchmarks/scaling.py bake [SCENE]
    python benchmarks/scaling.py batch FOLDER_OF_SCENES
"""

from __future__ import annotations

import pickle
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

from baker.core.stage import Stage

ROOT = Path(__file__).parents[1]
STAGES = (Stage.DIRECT_LIGHT, Stage.FORM_FACTORS, Stage.FINAL_GATHER, Stage.AMBIENT_OCCLUSION)
SETTINGS: dict[str, Any] = {
    "resolution": 512,
    "samples": 256,
    "light_samples": 64,
    "ao_samples": 64,
    "threads": 1,
}
# Number of jobs of the batch. The jobs repeat up to ten scenes, each time with another seed.
WANTED = 20


def bake_once(scene: Path, workers: int) -> dict[str, float]:
    """Bake a scene on `workers` cluster workers; return the duration of each stage, seconds.

    With 0 workers, the bake runs in this process with one thread.
    """
    from baker.core.settings import make_settings
    from baker.distributed.connection import Cluster
    from baker.distributed.tile_executor import DistributedTileExecutor
    from baker.pipeline.bake import bake

    settings = make_settings(SETTINGS)
    if not workers:
        return bake(scene, settings=settings).timings
    cluster = Cluster(f"local:{workers}", threads=workers)
    try:
        # Bake a small scene first, so that the workers have loaded libraries and kernels.
        bake(ROOT / "assets" / "cornell.glb", settings=make_settings({**SETTINGS, "resolution": 64}),
             executor=DistributedTileExecutor(cluster))  # fmt: skip
        return bake(scene, settings=settings, executor=DistributedTileExecutor(cluster)).timings
    finally:
        cluster.close()


def sizes(scene: Path) -> tuple[int, int]:
    """Return the number of bytes sent to each worker at the start, and the number of texels of all pages."""
    from baker.core.settings import make_settings
    from baker.io.load import load_scene
    from baker.uv.unwrap import unwrap_scene

    settings = make_settings(SETTINGS)
    loaded = load_scene(scene)
    atlas = unwrap_scene(loaded, settings)
    parts = (replace(loaded, source=None, path=None), atlas, settings)
    return len(pickle.dumps(parts, 5)), atlas.resolution**2 * atlas.n_pages


def measure_bake(scene: Path) -> None:
    """Print the sizes and durations that docs/SCALING.md lists."""
    payload, pixels = sizes(scene)
    print(f"{scene.name}: {payload / 1e6:.2f} MB to each worker, {pixels} pixels")
    for workers in (0, 1, 2):
        timings = bake_once(scene, workers)
        spread = sum(timings.get(stage, 0.0) for stage in STAGES)
        rest = sum(timings.values()) - spread
        words = ", ".join(f"{stage} {timings.get(stage, 0.0):.2f}" for stage in STAGES)
        print(f"{workers} workers: ray stages {spread:.2f} s ({words}), the rest {rest:.2f} s", flush=True)


def measure_batch(folder: Path) -> None:
    """Print the duration of a batch of small scenes.

    The whole batch is measured with `--jobs` 1 and with `--jobs` 2. Then the batch runs twice more: once
    without changes, and once after a map of one bake was deleted.
    """
    scenes = sorted(path for path in folder.rglob("*") if path.suffix in (".glb", ".obj"))
    # Choose kit pieces by file size, which excludes whole levels and meshes of two triangles.
    small = [path for path in scenes if 4_000 < path.stat().st_size < 300_000][:10]
    with tempfile.TemporaryDirectory() as name:
        jobs = [
            f'[[job]]\nscene = "{small[k % len(small)]}"\nout = "out/{k}"\nseed = {k}\n'
            for k in range(WANTED)
        ]
        text = '[defaults]\nresolution = 256\nsamples = 64\nsky = "1,1,1"\n'
        (Path(name) / "JOBS.toml").write_text(text + "".join(jobs))

        def run(*flags: str) -> float:
            start = time.perf_counter()
            command = [sys.executable, "-m", "baker.cli", "batch", "JOBS.toml", "-q", *flags]
            done = subprocess.run(command, cwd=name, check=False)
            assert done.returncode == 0
            return time.perf_counter() - start

        for n in (1, 2):
            print(f"{WANTED} scenes, --jobs {n}: {run('--jobs', str(n), '--force'):.1f} s", flush=True)
        print(f"all unchanged: {run():.2f} s")
        (Path(name) / "out" / "3" / "ao_0.exr").unlink()
        print(f"one of {WANTED} to bake: {run():.2f} s")


if __name__ == "__main__":
    if sys.argv[1] == "bake":
        measure_bake(Path(sys.argv[2]) if len(sys.argv) > 2 else ROOT / "assets" / "hall.glb")
    else:
        measure_batch(Path(sys.argv[2]))
