"""Rates of the bake's ray stages beside those of the loops of `bare`, measured in turn in one process."""

from __future__ import annotations

import json
import statistics
import subprocess
import sys
from pathlib import Path
from time import perf_counter
from typing import Any

from bare import BareRays

from baker.channels.channel import CHANNELS
from baker.core.parallel import thread_count
from baker.core.progress import silent
from baker.core.settings import BakeSettings, make_settings
from baker.io.load import load_scene
from baker.pipeline.record import Record
from baker.pipeline.transport import trace_transport
from baker.pipeline.world import World, prepare
from baker.radiosity.inside_geometry import STAGE as INSIDE_GEOMETRY
from baker.uv.unwrap import unwrap_scene

# Stage of the bake -> kind of bare rays that it is compared with.
BESIDE = {
    "final gather": "closest hit",
    "form factors": "closest hit",
    INSIDE_GEOMETRY: "closest hit",
    "direct light": "towards emitters",
    "ambient occlusion": "occlusion within the AO distance",
}


def measure_apart(**what: Any) -> dict[str, Any]:
    """Call `measure` in a separate process, so that its memory does not affect other measurements."""
    words = json.dumps(what, default=str)
    done = subprocess.run([sys.executable, __file__, words], stdout=subprocess.PIPE, text=True, check=True)
    found: dict[str, Any] = json.loads(done.stdout)
    return found


def measure(
    scene_path: Path, *, resolution: int, samples: int, repeat: int, sky: str | None
) -> dict[str, Any]:
    """Trace a scene's transport and the bare loops alternately, `repeat` times.

    Returns
    -------
    dict
        scene, resolution, triangles, texels; `stages` {stage: {seconds, rays, rate}} and
        `bare` {kind: {ready, made}}: Mrays/s, the best of all turns; `spread` has the medians.
    """
    values: dict[str, Any] = {
        "resolution": resolution,
        "samples": samples,
        "light_samples": samples,
        "uv": "auto",
    }
    if sky:
        values["sky"] = sky
    settings = make_settings(values)
    scene = load_scene(scene_path, up=settings.up, scale=settings.scale)
    world = prepare(scene, unwrap_scene(scene, settings, silent), settings, Record(silent))
    kinds = _kinds(world, settings)
    for rays in kinds.values():
        rays.warm()
    _turn(scene, world, make_settings({**values, "samples": 1, "light_samples": 1}))
    turns: list[dict[str, tuple[float, int]]] = []
    bare: dict[str, dict[str, list[float]]] = {kind: {"ready": [], "made": []} for kind in kinds}
    for _ in range(repeat):
        turns.append(_turn(scene, world, settings))
        for kind, rays in kinds.items():
            bare[kind]["ready"].append(rays.rate(ready=True))
            if kind != "towards emitters":
                bare[kind]["made"].append(rays.rate(ready=False))
    stages = {}
    for name in turns[0]:
        seconds = [turn[name][0] for turn in turns]
        rays_cast = turns[0][name][1]
        stages[name] = {
            "seconds": min(seconds),
            "median": statistics.median(seconds),
            "rays": rays_cast,
            "rate": rays_cast / min(seconds) / 1e6,
            "beside": BESIDE[name],
        }
    result = {
        "scene": scene_path.name,
        "resolution": resolution,
        "triangles": len(world.geometry.triangle),
        "texels": world.texels.n_front,
        "width": world.rays.tracer.width,
        "stages": stages,
        "bare": {kind: {loop: max(r) for loop, r in loops.items() if r} for kind, loops in bare.items()},
        "bare_median": {
            kind: {loop: statistics.median(r) for loop, r in loops.items() if r}
            for kind, loops in bare.items()
        },
    }
    world.rays.close()
    return result


def _kinds(world: World, settings: BakeSettings) -> dict[str, BareRays]:
    threads, n = thread_count(settings.threads), settings.hemisphere_samples
    same: dict[str, Any] = {"n_samples": n, "seed": settings.seed, "threads": threads}
    kinds = {
        "closest hit": BareRays(world, occlusion=False, **same),
        "occlusion within the AO distance": BareRays(
            world, occlusion=True, distance=settings.ao_reach(world.geometry.diagonal), **same
        ),
        "occlusion, unlimited": BareRays(world, occlusion=True, **same),
    }
    if len(world.emitters.row):
        kinds["towards emitters"] = BareRays(world, occlusion=True, to_emitters=True, **same)
    return kinds


def _turn(scene: Any, world: World, settings: BakeSettings) -> dict[str, tuple[float, int]]:
    """Cast all rays of a bake once; return seconds and rays of each stage."""
    record = Record(silent)
    trace_transport(scene, world, {"irradiance": CHANNELS.get("irradiance")}, settings, record)
    trace_transport(scene, world, {"ao": CHANNELS.get("ao")}, settings, record)
    # `prepare` finds points inside geometry once, outside these turns; cast its rays again to time them.
    from baker.radiosity.inside_geometry import find_buried

    start = perf_counter()
    _, cast = find_buried(
        world.texels, world.surface, world.table, world.tells, world.rays.tracer,
        seed=settings.seed, threads=thread_count(settings.threads), progress=silent,
    )  # fmt: skip
    record.timings[INSIDE_GEOMETRY], record.rays[INSIDE_GEOMETRY] = perf_counter() - start, cast
    return {name: (record.timings[name], cast) for name, cast in record.rays.items() if cast}


if __name__ == "__main__":
    asked = json.loads(sys.argv[1])
    print(json.dumps(measure(Path(asked.pop("scene_path")), **asked)))
