"""Measures the ray rates of a bake's stages and of the loops of `bare.py`, alternately in one process."""

from __future__ import annotations

import json
import statistics
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from time import perf_counter
from typing import Any

from bare import BareRays

from baker.channels.channel import CHANNELS
from baker.core.parallel import thread_count
from baker.core.progress import silent
from baker.core.settings import BakeSettings, make_settings
from baker.core.stage import Stage
from baker.io.load import load_scene
from baker.pipeline.prepare import PreparedScene, prepare_scene
from baker.pipeline.record import Record
from baker.pipeline.transport import trace_transport
from baker.radiosity.inside_geometry import find_inside_geometry
from baker.uv.unwrap import unwrap_scene

# {stage of the bake: kind of rays in `bare.py` that its rate is compared with}.
BESIDE = {
    Stage.FINAL_GATHER: "closest hit",
    Stage.FORM_FACTORS: "closest hit",
    Stage.INSIDE_GEOMETRY: "closest hit",
    Stage.DIRECT_LIGHT: "towards emitters",
    Stage.AMBIENT_OCCLUSION: "occlusion within the AO distance",
}


def measure_apart(**what: Any) -> dict[str, Any]:
    """Call `measure` with these arguments in a separate process, so that its memory is freed afterwards."""
    words = json.dumps(what, default=str)
    done = subprocess.run([sys.executable, __file__, words], stdout=subprocess.PIPE, text=True, check=True)
    found: dict[str, Any] = json.loads(done.stdout)
    return found


def measure(
    scene_path: Path, *, resolution: int, samples: int, repeat: int, sky: str | None
) -> dict[str, Any]:
    """Run a scene's light transport and the bare loops alternately, `repeat` times each.

    Returns
    -------
    dict
        - `scene`, `resolution`, `triangles`, `texels`, and `width`, the number of rays in a packet.
        - `stages`: {stage: {`seconds`, `median`, `rays`, `rate`, `beside`}}. `seconds` is the shortest time,
          `median` the median time in seconds, `rate` the number of Mrays/s in the shortest time, and `beside`
          the kind of bare rays to compare with.
        - `bare`, `bare_median`: {kind: {`ready`, `made`}}, the largest and the median rate of the loops of
          `bare.py`, Mrays/s. Rays towards emitters have no `made`.
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
    world = prepare_scene(scene, unwrap_scene(scene, settings, silent), settings, Record(silent))
    kinds = _kinds(world, settings)
    for rays in kinds.values():
        rays.warm()
    _turn(replace(world, settings=make_settings({**values, "samples": 1, "light_samples": 1})))
    turns: list[dict[str, tuple[float, int]]] = []
    bare: dict[str, dict[str, list[float]]] = {kind: {"ready": [], "made": []} for kind in kinds}
    for _ in range(repeat):
        turns.append(_turn(world))
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


def _kinds(world: PreparedScene, settings: BakeSettings) -> dict[str, BareRays]:
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


def _turn(world: PreparedScene) -> dict[str, tuple[float, int]]:
    """Cast all rays of a bake once; return {stage: (seconds, number of rays)}."""
    record = Record(silent)
    trace_transport(world, {"irradiance": CHANNELS.get("irradiance")}, record)
    trace_transport(world, {"ao": CHANNELS.get("ao")}, record)
    # Measure the search for points inside geometry, too. In a bake, this search is a part of `prepare_scene`.
    start = perf_counter()
    _, cast = find_inside_geometry(world.texels, world.job, world.hit_kind)
    record.timings[Stage.INSIDE_GEOMETRY] = perf_counter() - start
    record.rays[Stage.INSIDE_GEOMETRY] = cast
    return {name: (record.timings[name], cast) for name, cast in record.rays.items() if cast}


if __name__ == "__main__":
    asked = json.loads(sys.argv[1])
    print(json.dumps(measure(Path(asked.pop("scene_path")), **asked)))
