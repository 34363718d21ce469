"""Path-traces the irradiance of single texels with Mitsuba 3, as the truth for `against_cycles.py`.

    python path_truth.py JOB.json

JOB.json: {"surface": FILE.npz from cycles_bake, "texels": FILE.npz, "resolution", "spp", "out": FILE.npz}.
`texels` contains `row` and `column` (n,). `irradiance` (n, 3), `standard_error` (n, 3) and `seconds` are
written to `out`. The irradiance is

    E = integral of L cos = E_direct + pi x mean of L_indirect over cosine-weighted rays

where E_direct is estimated by sampling emitters, and L_indirect excludes emission at the first hit. Rays
start at points distributed over the part of the surface inside the texel's square.
"""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

# Number of points in each texel.
PLACES = 64
# Largest number of paths that are traced at once.
AT_ONCE = 1 << 21
# Distance by which points are moved along their normals, metres.
OFFSET = 1e-5
# Number of independent batches, from which the standard error is computed.
BATCHES = 16


def main() -> None:
    """Path-trace the texels of the job and write the result."""
    job = json.loads(Path(sys.argv[1]).read_text(encoding="utf-8"))
    mi.set_variant("llvm_ad_rgb")
    surface = np.load(job["surface"])
    chosen = np.load(job["texels"])
    scene = _scene(surface)
    position, normal = _places(surface, chosen["row"], chosen["column"], job["resolution"])
    start = time.perf_counter()
    mean, error = _irradiance(scene, position, normal, job["spp"])
    np.savez(job["out"], irradiance=mean, standard_error=error, seconds=time.perf_counter() - start)
    print(json.dumps({"mitsuba": mi.__version__}))


def _scene(surface: Any) -> Any:
    """Return the Mitsuba scene, with one one-sided mesh for each pair of albedo and emission."""
    key = np.concatenate([surface["albedo"], surface["emission"]], axis=1)
    kinds, of = np.unique(key, axis=0, return_inverse=True)
    parts: dict[str, Any] = {"type": "scene"}
    for number, kind in enumerate(kinds):
        corner = surface["position"][of.reshape(-1) == number].reshape(-1, 3)
        properties = mi.Properties()
        properties["bsdf"] = mi.load_dict(
            {"type": "diffuse", "reflectance": {"type": "rgb", "value": kind[:3].tolist()}}
        )
        if kind[3:].any():
            properties["emitter"] = mi.load_dict(
                {"type": "area", "radiance": {"type": "rgb", "value": kind[3:].tolist()}}
            )
        mesh = mi.Mesh(f"part{number}", len(corner), len(corner) // 3, props=properties)
        values = mi.traverse(mesh)
        values["vertex_positions"] = corner.astype(np.float32).ravel()
        values["faces"] = np.arange(len(corner), dtype=np.uint32)
        values.update()
        parts[f"part{number}"] = mesh
    return mi.load_dict(parts)


def _places(
    surface: Any, row: NDArray[np.int64], column: NDArray[np.int64], size: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the points (n, PLACES, 3) and their normals (n, PLACES, 3).

    The points are distributed uniformly over the part of each texel that is covered by surface.
    """
    generator = np.random.default_rng(1)
    a, b, c = (surface["uv"][:, k] * size for k in range(3))
    det = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (c[:, 0] - a[:, 0]) * (b[:, 1] - a[:, 1])
    face = np.cross(
        surface["position"][:, 1] - surface["position"][:, 0],
        surface["position"][:, 2] - surface["position"][:, 0],
    )
    face /= np.linalg.norm(face, axis=1, keepdims=True)
    position, normal = np.zeros((2, len(row), PLACES, 3))
    for i in range(len(row)):
        found = 0
        while found < PLACES:
            x = column[i] + generator.random(4 * PLACES)
            y = row[i] + generator.random(4 * PLACES)
            px, py = x[:, None] - a[:, 0], y[:, None] - a[:, 1]
            b1 = (px * (c[:, 1] - a[:, 1]) - py * (c[:, 0] - a[:, 0])) / det
            b2 = (py * (b[:, 0] - a[:, 0]) - px * (b[:, 1] - a[:, 1])) / det
            sample, triangle = np.nonzero((b1 >= 0) & (b2 >= 0) & (b1 + b2 <= 1))
            take = min(PLACES - found, len(sample))
            sample, triangle = sample[:take], triangle[:take]
            w1, w2 = b1[sample, triangle][:, None], b2[sample, triangle][:, None]
            p = surface["position"][triangle]
            n = face[triangle]
            position[i, found : found + take] = (
                p[:, 0] * (1 - w1 - w2) + p[:, 1] * w1 + p[:, 2] * w2 + OFFSET * n
            )
            normal[i, found : found + take] = n
            found += take
    return position, normal


def _irradiance(
    scene: Any, position: NDArray[np.float64], normal: NDArray[np.float64], spp: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the irradiance (n, 3) of the texels and its standard error (n, 3), from `BATCHES` batches."""
    integrator = mi.load_dict({"type": "path", "max_depth": 1000, "rr_depth": 8})
    n = len(position)
    rounds = max(1, spp // (PLACES * BATCHES))
    span = max(1, AT_ONCE // (PLACES * rounds))
    batch = np.zeros((BATCHES, n, 3))
    for number in range(BATCHES):
        for begin in range(0, n, span):
            # Trace `rounds` paths from each point in a batch.
            p = np.repeat(position[begin : begin + span].reshape(-1, 3), rounds, axis=0).astype(np.float32)
            m = np.repeat(normal[begin : begin + span].reshape(-1, 3), rounds, axis=0).astype(np.float32)
            total = np.array(_sample(scene, integrator, p, m, number * 1_000_003 + begin))
            shape = (-1, PLACES * rounds, 3)
            batch[number, begin : begin + span] = total.astype(np.float64).T.reshape(shape).mean(axis=1)
    return batch.mean(axis=0), batch.std(axis=0, ddof=1) / np.sqrt(BATCHES)


def _sample(
    scene: Any, integrator: Any, position: NDArray[np.float32], normal: NDArray[np.float32], seed: int
) -> Any:
    """Return (3, m): one estimate of the irradiance at each of m points, from one path."""
    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(seed, len(position))
    p, n = mi.Point3f(position.T), mi.Normal3f(normal.T)
    here = dr.zeros(mi.SurfaceInteraction3f, len(position))
    here.p, here.n, here.t = p, n, 0.0
    here.sh_frame = mi.Frame3f(n)
    toward, weight = scene.sample_emitter_direction(here, sampler.next_2d(), True)
    direct = weight * dr.maximum(dr.dot(toward.d, n), 0.0)
    direction = mi.Frame3f(n).to_world(mi.warp.square_to_cosine_hemisphere(sampler.next_2d()))
    ray = mi.RayDifferential3f(p, direction)
    seen = integrator.sample(scene, sampler, ray)[0]
    # Subtract the emission at the first hit, which `direct` contains.
    hit = scene.ray_intersect(ray)
    return direct + dr.pi * (seen - hit.emitter(scene).eval(hit))


if __name__ == "__main__":
    main()
