"""Estimates the cost of a bake: texels, pages, rays, memory, time, and the share of each object."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from baker.checks.bake_rates import RAY_STAGES, Rates
from baker.checks.context import CheckContext
from baker.checks.finding import RawFinding
from baker.checks.rule import check
from baker.core.budget import FILLED, Workload, image_bytes, texels_and_pages
from baker.core.readable import amount, number
from baker.core.stage import Stage

# Constants of the time estimate if there is no earlier bake, measured on the scenes cornell.glb, hall.glb and
# interior.glb:
# _OF_PROBE: mean number of rays that a bake traces in the time in which the probe traces one ray;
# _PER_TEXEL_SECONDS: time per texel of all stages without rays, multiplied by the number of threads, seconds.
_OF_PROBE, _PER_TEXEL_SECONDS = 1.7, 1.5e-5
# Minimum duration of the probe, seconds.
PROBE_SECONDS = 1.0
# Largest number of objects whose share of the texels is listed.
MOST_SHARES = 20


@dataclass(frozen=True)
class Cost:
    """Estimated cost of a bake.

    Attributes
    ----------
    texels, pages, triangles : int
    rays : dict of Stage to int
        Number of rays of each stage, see `Workload.rays`.
    bytes : int
        Peak memory, bytes.
    shares : list of dict
        Name, node, share of the area in percent and number of texels of the objects with the largest area.
    """

    texels: int
    pages: int
    rays: dict[Stage, int]
    bytes: int
    triangles: int
    shares: list[dict[str, Any]]


def estimate_cost(context: CheckContext) -> Cost:
    """Estimate the cost of a bake.

    Parameters
    ----------
    context : CheckContext
        The scene and the settings of its bake.

    Returns
    -------
    Cost
        The estimate, without time.
    """
    settings, world = context.settings, context.world
    area = np.bincount(world.instance, world.area, len(context.source.instances)).astype(np.float64)
    texels, pages = texels_and_pages(settings, float(area.sum()))
    if settings.density is None and all(
        context.uv(m).valid for m, facts in enumerate(context.meshes) if len(facts.good)
    ):
        laid = sum(float(np.abs(context.uv(i.mesh).signed_area).sum()) for i in context.source.instances)
        texels = round(min(laid, FILLED) * settings.resolution**2)
    workload = Workload(
        texels=texels,
        pages=pages,
        triangles=len(world.triangle),
        image_bytes=image_bytes(context.scene),
        light=context.bakes_light,
        ambient_occlusion=context.bakes_ambient_occlusion,
    )
    lit = sum(max(light.intensity) > 0 for light in context.scene.lights)
    rays = workload.rays(settings, delta_lights=lit, emitters=context.bakes_light and context.emits)
    need = workload.peak_bytes(settings)
    return Cost(texels, pages, rays, need, workload.triangles, _shares(context, area, texels))


def _shares(context: CheckContext, area: NDArray[np.float64], texels: int) -> list[dict[str, Any]]:
    """Return `Cost.shares`. `area` (I,), m2, is the area of each instance."""
    order = np.argsort(-area, kind="stable")[:MOST_SHARES]
    total = max(float(area.sum()), 1e-300)
    return [
        {
            "object": context.source.instances[k].name,
            "node": context.source.instances[k].node,
            "percent": round(100.0 * float(area[k]) / total, 2),
            "texels": round(texels * float(area[k]) / total),
        }
        for k in order
    ]


def probe(context: CheckContext) -> Rates:
    """Measure the speed of rays by tracing cosine-weighted rays from the surfaces for about one second."""
    world = context.world
    random = np.random.default_rng(context.settings.seed)
    share = np.cumsum(world.area)
    pick = np.sort(random.random(1 << 16)) * share[-1]
    chosen = np.minimum(np.searchsorted(share, pick), len(share) - 1)
    middle = world.position[world.triangle[chosen]].mean(axis=1).astype(np.float64)
    origin = world.lifted(middle, chosen, world.normal[chosen])
    direction = random.normal(size=origin.shape)
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    direction += world.normal[chosen]
    near, far = np.zeros(len(direction)), np.full(len(direction), 1e30)
    # Load the kernel and build the ray tree before the measurement.
    world.first_hits(origin, direction, near, far)
    start, cast = time.perf_counter(), 0
    while time.perf_counter() - start < PROBE_SECONDS:
        world.first_hits(origin, direction, near, far)
        cast += len(direction)
    each = (time.perf_counter() - start) / cast / _OF_PROBE
    texel = _PER_TEXEL_SECONDS / world.threads
    return Rates(dict.fromkeys(RAY_STAGES, each), {Stage.FINISH: texel}, 0.0, "a probe of one second")


def seconds_of(cost: Cost, rates: Rates) -> float:
    """Return the estimated duration of a bake, seconds.

    For a ray stage whose speed is unknown, the lowest speed of the other ray stages is used.
    """
    slowest = max(rates.ray.values(), default=0.0)
    rays = sum(n * rates.ray.get(stage, slowest) for stage, n in cost.rays.items())
    return rays + cost.texels * sum(rates.texel.values()) + cost.triangles * rates.triangle


@check(
    "cost", group="cost", severity="info", fix="lower `resolution`, `density` or `quality` if it is too much"
)
def cost_of_bake(context: CheckContext) -> Iterator[RawFinding]:
    """The cost of a bake with these settings: texels, pages, rays, memory, and time if known.

    Time is estimated from the speed of an earlier bake: the bake that `rates` names, or else the latest bake
    of this scene in a folder beside the scene file. If there is no such bake and `cost` is set, the speed of
    rays is measured for about one second. Otherwise no time is given. The time does not include unwrapping.
    `objects` lists the 20 objects with the largest area. An object's share of the texels is
    assumed to equal its share of the area, and is approximately its share of the time.
    """
    if not context.world.area.sum() > 0:
        return
    cost = estimate_cost(context)
    rates = context.rates
    if rates is None and context.probe:
        rates = probe(context)
    rays = sum(cost.rays.values())
    pages = "1 page" if cost.pages == 1 else f"{cost.pages} pages"
    memory = number(cost.bytes / 2**30)
    text = f"about {amount(cost.texels)} texels on {pages}, {amount(rays)} rays, {memory} GiB of memory"
    more: dict[str, Any] = {
        "texels": cost.texels,
        "pages": cost.pages,
        "rays": cost.rays,
        "bytes": cost.bytes,
        "objects": cost.shares,
    }
    if rates is not None:
        seconds = seconds_of(cost, rates)
        shown = f"{seconds / 60:.2g} minutes" if seconds >= 90 else f"{seconds:.2g} s"
        text += f", {shown} by {rates.basis}"
        more.update(seconds=round(seconds, 2), basis=rates.basis)
    yield RawFinding(text, count=1, more=more)
