"""Compares the speed of the reference path tracer and Mitsuba 3: path segments and occlusion rays per second.

    pip install -e '.[mitsuba]'        llvm_ad_rgb needs LLVM 17 or newer, Debian: libllvm19
    python benchmarks/against_mitsuba.py --into docs/PERFORMANCE.md

The reference path tracer and Mitsuba run alternately. They trace the same flat Lambertian triangles from the
same camera, with MIS and one shadow ray at every vertex. Paths end after `SEGMENTS` closest-hit rays, without
Russian roulette, so both cast the same number of rays. The rays of the reference path tracer are counted;
Mitsuba does not count rays, so the same number per path is assumed. Occlusion rays start at the first hits of
camera rays. They are cosine-weighted and end after a tenth of the scene's diagonal. Compilation is not timed.
"""

from __future__ import annotations

import argparse
import json
import statistics
from pathlib import Path
from time import perf_counter
from typing import Any

import drjit as dr
import machine
import mitsuba as mi
import numpy as np
from report import put_into, table

from baker.core.parallel import thread_count
from baker.io.load import load_scene
from baker.pathtracer.camera import camera_rays
from baker.pathtracer.estimators import PassOptions
from baker.pathtracer.first_hit import first_hits
from baker.pathtracer.irradiance import ambient_occlusion_pass
from baker.pathtracer.point_estimate import new_estimate
from baker.pathtracer.radiance import radiance_pass
from baker.pathtracer.scene import build_reference

ROOT = Path(__file__).resolve().parent.parent
# Size of the picture, pixels.
WIDTH, HEIGHT = 512, 384
# Number of closest-hit rays of a path.
SEGMENTS = 4
# Number of occlusion rays at each point.
OPEN_SAMPLES = 64


def main(argv: list[str] | None = None) -> int:
    """Measure both programs alternately and print a table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--scene", type=Path, default=ROOT / "assets" / "hall.glb")
    parser.add_argument("--spp", type=int, default=16)
    parser.add_argument("--repeat", type=int, default=3)
    parser.add_argument("--json", type=Path, help="write all numbers to this file")
    parser.add_argument(
        "--into", type=Path, help="insert the tables between the marker lines of this document"
    )
    options = parser.parse_args(argv)
    mi.set_variant("llvm_ad_rgb")
    found = measure(options.scene, options.spp, options.repeat)
    found["machine"] = {**machine.describe(), "mitsuba": mi.__version__, "load after": machine.load()}
    if options.json:
        options.json.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
    shown = tables(found, markdown=options.into is not None)
    if options.into:
        put_into(options.into, "against_mitsuba.py", shown)
    else:
        print(shown)
    return 0


def measure(path: Path, spp: int, repeat: int) -> dict[str, Any]:
    """Return the Mrays/s of each repetition, and the mean radiance and AO, of both programs."""
    from mitsuba_scene import flat, mitsuba_camera, mitsuba_scene

    threads = thread_count(None)
    dr.set_thread_count(threads)
    scene = load_scene(path)
    camera = scene.cameras[0]
    rates: dict[str, list[float]] = {name: [] for name in ("segments", "with shadow rays", "occlusion")}
    theirs: dict[str, list[float]] = {name: [] for name in rates}
    with flat(build_reference(scene, lambertian=True, threads=threads)) as reference:
        other = mitsuba_scene(scene, reference, sensor=mitsuba_camera(camera, WIDTH, HEIGHT))
        path_type = mi.load_dict({"type": "path", "max_depth": SEGMENTS, "rr_depth": 1000})
        n = WIDTH * HEIGHT
        way = camera_rays(camera, WIDTH, HEIGHT, np.arange(n), 1, 0, 0).reshape(-1, 3)
        hits = first_hits(reference, np.array(camera.position), way)
        met = np.flatnonzero(hits.lit)
        where = [a[met][:, None] for a in (hits.position, hits.normal, hits.face_normal)]
        reach = 0.1 * reference.geometry.diagonal
        for turn in range(repeat + 1):
            options = PassOptions("mis", max_bounces=SEGMENTS - 2, seed=turn)
            estimate = new_estimate(n, 3, spp)
            start = perf_counter()
            radiance_pass(reference, estimate, camera, WIDTH, HEIGHT, options=options)
            own = perf_counter() - start
            start = perf_counter()
            picture = mi.render(other, integrator=path_type, spp=spp, seed=turn)
            dr.eval(picture)
            dr.sync_thread()
            theirs_took = perf_counter() - start
            one = new_estimate(len(met), 1, OPEN_SAMPLES)
            start = perf_counter()
            ambient_occlusion_pass(reference, one, *where, distance=reach, seed=turn)
            own_open = perf_counter() - start
            start = perf_counter()
            share = _mitsuba_ao(other, where[0][:, 0], where[2][:, 0], reach, turn)
            theirs_open = perf_counter() - start
            if turn == 0:
                # Discard the first repetition, because it includes compilation.
                continue
            segments = estimate.segments / 1e6
            rates["segments"].append(segments / own)
            theirs["segments"].append(segments / theirs_took)
            rates["with shadow rays"].append(estimate.rays / 1e6 / own)
            theirs["with shadow rays"].append(estimate.rays / 1e6 / theirs_took)
            rates["occlusion"].append(one.rays / 1e6 / own_open)
            theirs["occlusion"].append(one.rays / 1e6 / theirs_open)
        mean = float(estimate.mean.mean()), float(np.array(picture).mean())
        opened = float(one.mean.mean()), float(share)
    return {
        "scene": path.name, "triangles": scene.n_triangles, "threads": threads, "ours": rates,
        "mitsuba": theirs, "mean": mean, "open": opened,
    }  # fmt: skip


def _mitsuba_ao(scene: Any, position: Any, normal: Any, reach: float, seed: int) -> float:
    """Return the unoccluded share of cosine-weighted rays, `OPEN_SAMPLES` at each point.

    position, normal : (n, 3), world; reach : float, length of the rays, metres
    """
    n = len(position)
    point, up = mi.Point3f(position.T.astype(np.float32)), mi.Normal3f(normal.T.astype(np.float32))
    index = dr.arange(mi.UInt32, n * OPEN_SAMPLES) % n
    point, up = dr.gather(mi.Point3f, point, index), dr.gather(mi.Normal3f, up, index)
    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(seed, n * OPEN_SAMPLES)
    way = mi.Frame3f(up).to_world(mi.warp.square_to_cosine_hemisphere(sampler.next_2d()))
    ray = mi.Ray3f(point + 1e-4 * up, way)
    ray.maxt = reach
    free = dr.select(scene.ray_test(ray), 0.0, 1.0)
    return float(dr.mean(free).numpy().item())


def tables(found: dict[str, Any], *, markdown: bool) -> str:
    """Return the tables of rates and of the machine as text."""
    head = ("what", "ours", "median", "Mitsuba llvm_ad_rgb", "median ", "times")
    rows = []
    for name, own in found["ours"].items():
        other = found["mitsuba"][name]
        rows.append(
            (
                name, max(own), float(statistics.median(own)), max(other), float(statistics.median(other)),
                f"{max(own) / max(other):.2f}",
            )
        )  # fmt: skip
    words = (
        f"{found['scene']}, {found['triangles']} triangles, {found['threads']} threads, million rays"
        f" a second; mean of the picture {found['mean'][0]:.4g} (ours), {found['mean'][1]:.4g} (Mitsuba),"
        f" ambient occlusion {found['open'][0]:.4f} and {found['open'][1]:.4f}"
    )
    facts = table(("what", "which"), [(k, str(v)) for k, v in found["machine"].items()], markdown=markdown)
    return f"{words}\n\n{table(head, rows, markdown=markdown)}\n\n{facts}\n"


if __name__ == "__main__":
    raise SystemExit(main())
