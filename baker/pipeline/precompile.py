"""Compiles kernels in a second process while the first bake after an install reads its scene.

Numba compiles one function at a time per process and stores the machine code on disk, from where other
processes load it. The second process runs `python -m baker.pipeline.precompile`. It computes light from one
emitter at a few points and finishes a small page, which compiles and stores these kernels. At the same time,
the bake compiles the kernels for uv and texels.

Kernels are imported inside functions, because the process must call `skip_blas` before the import.
"""

from __future__ import annotations

import gc
import os
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from baker.core.parent_death import end_with_parent
from baker.core.progress import Progress, report
from baker.core.scene import Instance, Material, Mesh, Scene
from baker.core.stage import COMPILING, Stage

# Time between two polls of the process, seconds.
_POLL = 0.1
# Side of the small page, texels.
_PAGE = 48
# Number of texels at which light is computed.
_TEXELS = 16
# The process, or None if nothing has to be compiled or nothing can be stored.
Process = subprocess.Popen[bytes] | None


def start() -> Process:
    """Start compiling in the background.

    Returns
    -------
    Process
        None if the compiled kernels are already on disk, or if they cannot be stored there.
    """
    from baker.finish.kernels.page_guard import hold_to_samples
    from baker.trace.kernel_cache import is_stored

    # Test a kernel of `finish_pages`, the last step.
    return _run() if is_stored(hold_to_samples) is False else None


def restart_for_materials(process: Process, scene: Scene) -> Process:
    """Restart the process for other kernels if a material of the scene lets light through.

    Parameters
    ----------
    process : Process
        From `start`.
    scene : Scene
        The scene to bake.

    Returns
    -------
    Process
        The given process if it is None, or if no material lets light through.
    """
    passing = [material for material in scene.materials if _passes(material)]
    if process is None or not passing:
        return process
    stop(process)
    blend = any(material.alpha_mode == "BLEND" for material in passing)
    return _run("glass" if blend else "holes")


def labelled(process: Process, progress: Progress) -> Progress:
    """Return a callback that marks reports with `COMPILING` as long as the process runs.

    Meanwhile, the bake compiles other kernels at their first calls. A stage that usually takes a fraction of
    a second may therefore report no progress for many seconds.

    Parameters
    ----------
    process : Process
        From `start` or `restart_for_materials`.
    progress : Progress
        Receives the reports; those with the fraction 0 get the detail `COMPILING`.

    Returns
    -------
    Progress
        `progress` itself if there is no process.
    """
    if process is None:
        return progress

    def report_compiling(stage: str, fraction: float, detail: str = "", /) -> object:
        compiling = fraction == 0.0 and process.poll() is None
        return progress(stage, fraction, COMPILING if compiling else detail)

    return report_compiling


def _passes(material: Material) -> bool:
    """Return whether alpha x smallest texture alpha of a material is below 1; False for OPAQUE materials.

    Vertex colours are ignored.
    """
    lowest = material.base_colour[3]
    if material.base_colour_texture is not None:
        alpha = material.base_colour_texture.image[..., 3]
        lowest *= float(alpha.min()) / (255 if alpha.dtype == np.uint8 else 1)
    return material.alpha_mode != "OPAQUE" and lowest < 1.0


def _run(*kind: str) -> Process:
    command = [sys.executable, "-m", "baker.pipeline.precompile", *kind]
    silence = subprocess.DEVNULL
    return subprocess.Popen(command, stdin=silence, stdout=silence, stderr=silence)


def wait_for_rays(process: Process, progress: Progress) -> None:
    """Wait until the ray kernels are compiled, so that this process does not compile the same kernels.

    Parameters
    ----------
    process : Process
        From `start` or `restart_for_materials`.
    progress : Progress
        Called while waiting.
    """
    from baker.radiosity.kernels.gather import gather
    from baker.trace.kernel_cache import is_stored

    # Test the last kernel that `cast_rays` compiles.
    _wait(process, progress, lambda: is_stored(gather) is not False)


def finish(process: Process, progress: Progress) -> None:
    """Wait for the process to end. If it failed, this process compiles the kernels at their first call.

    Parameters
    ----------
    process : Process
        From `start` or `restart_for_materials`.
    progress : Progress
        Called while waiting.
    """
    _wait(process, progress, lambda: False)


def _wait(process: Process, progress: Progress, enough: Callable[[], bool]) -> None:
    """Wait until the process ends or `enough` is true."""
    while process is not None and not enough():
        try:
            process.wait(_POLL)
        except subprocess.TimeoutExpired:
            report(progress, Stage.COMPILE, 0.5, COMPILING)
        else:
            process = None


def stop(process: Process) -> None:
    """Kill the process if it runs.

    Parameters
    ----------
    process : Process
        From `start` or `restart_for_materials`.
    """
    if process is not None and process.poll() is None:
        process.kill()
        process.wait()


def cast_rays(kind: str = "") -> None:
    """Compute the light of one emitter at a few texels, first by shadow rays, then by a final gather.

    Parameters
    ----------
    kind : str
        "holes" for an emitter with a MASK material, "glass" for an emitter with a BLEND material.
    """
    from baker.core.atlas import Atlas, InstanceLayout
    from baker.core.geometry import world_geometry
    from baker.kernels.emitters import needed_shading, tile_emitters, widest_view
    from baker.kernels.sampling import shared_bits_mask, sobol_reversed
    from baker.kernels.triangle_lookup import TriangleLookup
    from baker.lights.emissive import build_emitters
    from baker.radiosity.kernels.area_light import light_samples
    from baker.radiosity.kernels.emitter_probe import probe_clusters
    from baker.radiosity.kernels.gather import N_COLUMNS, gather
    from baker.radiosity.kernels.side_table import nothing_seen
    from baker.shading.materials import resolve_materials
    from baker.shading.ray_tree import build_ray_tree
    from baker.trace.packets import new_packet_buffers

    scene = _one_emitter(kind)
    mesh = scene.meshes[0]
    chart, uv = np.zeros(1, np.int32), mesh.position[:, :2]
    layout = InstanceLayout(0, 0, np.arange(3, dtype=np.int32), uv, mesh.triangle, chart, False, 1.0)
    geometry = world_geometry(scene, Atlas(16, 1, (layout,), 1, 2))
    shading = resolve_materials(scene, geometry)
    emitters = build_emitters(geometry, shading)
    rays = build_ray_tree(geometry, shading, threads=1)
    lookup = TriangleLookup(np.zeros((1, 16), np.float32), 16, 256)

    # Place the points one metre in front of the emitter, with normals towards it.
    origin, normal = np.zeros((_TEXELS, 16, 3), np.float32), np.zeros((_TEXELS, 16, 3), np.float32)
    origin[..., 2], normal[..., 2] = 1.0, -1.0
    buffers, points, shared = new_packet_buffers(rays.tracer), sobol_reversed(16, 0, 1), shared_bits_mask(16)
    seen, analytic = tile_emitters(emitters, origin), np.zeros(_TEXELS, np.uint8)
    needed = needed_shading(emitters, shading)

    # Compile kernels in the order in which a bake calls them: choice of emitters, shadow rays, gather. In the
    # meantime, the bake itself compiles the kernels of all stages before direct light, and the kernels of
    # narrow gaps and form factors. Both processes need about the same time.
    widest_view(emitters, origin)
    counts, every = np.zeros((2, 1, 1), np.int32), np.ones(1, bool)
    bounds = np.array([0, _TEXELS])
    probe_clusters(origin, normal, emitters.row, emitters.first, buffers, bounds, every, 16, *counts)
    hemisphere, limits = np.array([16.0, 4.0]), np.array([1.0, 16.0])
    sums, squares = np.zeros((_TEXELS, 6), np.float32), np.zeros(_TEXELS, np.float32)
    light_samples(
        origin, normal, seen, needed, buffers, 0, points, shared, hemisphere, analytic, sums, squares
    )  # fmt: skip
    dark, black = nothing_seen(), np.zeros(3, np.float32)
    out = np.zeros((_TEXELS, N_COLUMNS), np.float32)
    gather(
        origin, normal, lookup, dark, seen, needed, buffers, 0, points, shared, black, limits, analytic, out
    )  # fmt: skip
    rays.close()


def _one_emitter(kind: str) -> Scene:
    """Return a scene of one emissive triangle; see `cast_rays`."""
    corner = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32)
    face, zero = np.array([[0, 1, 2]], np.int32), np.zeros(1, np.int32)
    up = np.tile(np.array([0, 0, 1], np.float32), (3, 1))
    mesh = Mesh("emitter", corner, up, face, zero, zero, np.zeros(3, np.int32), np.arange(3, dtype=np.int32))
    material = Material(emission=(1.0, 1.0, 1.0))
    if kind:
        mode = "BLEND" if kind == "glass" else "MASK"
        material = replace(material, base_colour=(0.5, 1.0, 1.0, 0.4), alpha_mode=mode)
    return Scene("emitter", None, (mesh,), (material,), (Instance(0, "emitter", 0, np.eye(4)),))


def finish_pages() -> None:
    """Finish a page of two charts, one of them with an invalid texel."""
    from baker.finish.finish import ComponentRules, PageLayer, PagePlan, finish_page, open_finisher

    chart = np.full((_PAGE, _PAGE), -1, np.int32)
    chart[4:20, 4:40] = 0
    chart[24:40, 4:40] = 1
    valid = chart >= 0
    valid[30, 20] = False
    plan = PagePlan(chart, valid, np.full((_PAGE, _PAGE, 2), 0.1, np.float32))
    noise = np.random.Generator(np.random.PCG64(0))
    value = noise.random((_PAGE, _PAGE, 3), np.float32)
    error = np.full((_PAGE, _PAGE), 0.3, np.float32)
    layers = [PageLayer(value, error, bound=True)]
    rules = ComponentRules(0.0, 1.0, (slice(0, 3),))
    with open_finisher(threads=1, dilation=4, denoise=True) as finisher:
        finish_page(plan, layers, rules, finisher)


if __name__ == "__main__":
    from baker.trace.numba_start import skip_blas

    skip_blas()
    end_with_parent(os.getppid())
    # Disable garbage collection, which takes 5 % of the time: compilation allocates millions of small
    # objects, but few reference cycles.
    gc.disable()
    cast_rays(*sys.argv[1:])
    finish_pages()
