"""Compiles kernels in a second process while the first bake after an install begins its work.

Numba compiles one function at a time in a process, and keeps what it compiled on disk: what this process
compiles, the bake finds. It is run as `python -m baker.pipeline.precompile`, lights and gathers from a single
lamp, finishes a small page, and writes nothing but that cache. The bake itself compiles uv, texels and the
rest.
"""

from __future__ import annotations

import gc
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from baker.core.progress import Progress, report, silent
from baker.core.scene import Instance, Material, Mesh, Scene
from baker.core.stage import Stage

_LOOK = 0.1
_PAGE = 48
_TEXELS = 16


def start() -> subprocess.Popen[bytes] | None:
    """Start compiling in the background, if the kernels are not on disk yet."""
    from baker.finish.kernels.page_guard import hold_to_samples

    folder = hold_to_samples._cache.cache_path
    # Where nothing can be kept, another process cannot help.
    if folder is None or any(Path(folder).glob("page_guard.hold_to_samples-*.nbi")):
        return None
    return _run()


def suit(process: subprocess.Popen[bytes] | None, scene: Scene) -> subprocess.Popen[bytes] | None:
    """Start anew where the scene has surfaces that let light through: its kernels are others."""
    passing = [material for material in scene.materials if _passes(material)]
    if process is None or not passing:
        return process
    stop(process)
    blend = any(material.alpha_mode == "BLEND" for material in passing)
    return _run("glass" if blend else "holes")


def _passes(material: Material) -> bool:
    """Tell whether light passes a surface of the material, if its vertices have no alpha of their own."""
    lowest = material.base_colour[3]
    if material.base_colour_texture is not None:
        alpha = material.base_colour_texture.image[..., 3]
        lowest *= float(alpha.min()) / (255 if alpha.dtype == np.uint8 else 1)
    return material.alpha_mode != "OPAQUE" and lowest < 1.0


def _run(*kind: str) -> subprocess.Popen[bytes]:
    command = [sys.executable, "-m", "baker.pipeline.precompile", *kind]
    silence = subprocess.DEVNULL
    return subprocess.Popen(command, stdin=silence, stdout=silence, stderr=silence)


def wait_for_rays(process: subprocess.Popen[bytes] | None, progress: Progress) -> None:
    """Wait until the background compilation has its ray kernels: else both processes compiled the same."""
    from baker.radiosity.kernels.gather import gather

    # The last one that `cast_rays` compiles.
    folder, name = gather._cache.cache_path, "gather.gather-*.nbc"
    _wait(process, progress, lambda: folder is None or any(Path(folder).glob(name)))


def finish(process: subprocess.Popen[bytes] | None, progress: Progress) -> None:
    """Wait for the background compilation; if it failed, the kernels are compiled where they are used."""
    _wait(process, progress, lambda: False)


def _wait(process: subprocess.Popen[bytes] | None, progress: Progress, enough: Callable[[], bool]) -> None:
    while process is not None and not enough():
        try:
            process.wait(_LOOK)
        except subprocess.TimeoutExpired:
            report(progress, Stage.COMPILE, 0.5, "first run only")
        else:
            process = None


def stop(process: subprocess.Popen[bytes] | None) -> None:
    """End the background compilation."""
    if process is not None and process.poll() is None:
        process.kill()
        process.wait()


def cast_rays(kind: str = "") -> None:
    """Light texels by one lamp that shines into the open, and gather from them.

    Parameters
    ----------
    kind : str
        "holes" for a lamp with a MASK material, "glass" for one with a BLEND material.
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

    corner = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32)
    face, zero = np.array([[0, 1, 2]], np.int32), np.zeros(1, np.int32)
    up = np.tile(np.array([0, 0, 1], np.float32), (3, 1))
    mesh = Mesh("lamp", corner, up, face, zero, zero, np.zeros(3, np.int32), np.arange(3, dtype=np.int32))
    material = Material(emission=(1.0, 1.0, 1.0))
    if kind:
        mode = "BLEND" if kind == "glass" else "MASK"
        material = replace(material, base_colour=(0.5, 1.0, 1.0, 0.4), alpha_mode=mode)
    scene = Scene("lamp", None, (mesh,), (material,), (Instance(0, "lamp", 0, np.eye(4)),))
    layout = InstanceLayout(0, 0, np.arange(3, dtype=np.int32), corner[:, :2], face, zero, False, 1.0)
    geometry = world_geometry(scene, Atlas(16, 1, (layout,), 1, 2))
    shading = resolve_materials(scene, geometry)
    emitters = build_emitters(geometry, shading)
    rays = build_ray_tree(geometry, shading, threads=1)
    table = TriangleLookup(np.zeros((1, 16), np.float32), 16, 256)

    origin, normal = np.zeros((_TEXELS, 16, 3), np.float32), np.zeros((_TEXELS, 16, 3), np.float32)
    origin[..., 2], normal[..., 2] = 1.0, -1.0
    buffers, net, shared = new_packet_buffers(rays.tracer), sobol_reversed(16, 0, 1), shared_bits_mask(16)
    lamps, exact = tile_emitters(emitters, origin), np.zeros(_TEXELS, np.uint8)
    needed = needed_shading(emitters, shading)
    # In the order in which a bake needs them. As long again takes what it compiles itself: everything before
    # direct light, the rays of gaps and form factors, and the matrix.
    weigh, two = np.array([16.0, 4.0]), np.array([1.0, 16.0])
    widest_view(emitters, origin)
    counts, every = np.zeros((2, 1, 1), np.int32), np.ones(1, bool)
    bounds = np.array([0, _TEXELS])
    probe_clusters(origin, normal, emitters.row, emitters.first, buffers, bounds, every, 16, *counts)
    sums, squares = np.zeros((_TEXELS, 6), np.float32), np.zeros(_TEXELS, np.float32)
    light_samples(origin, normal, lamps, needed, buffers, 0, net, shared, weigh, exact, sums, squares)
    dark, black = nothing_seen(), np.zeros(3, np.float32)
    out = np.zeros((_TEXELS, N_COLUMNS), np.float32)
    gather(origin, normal, table, dark, lamps, needed, buffers, 0, net, shared, black, two, exact, out)
    rays.close()


def finish_pages() -> None:
    """Finish a page of two charts, one of them with a buried texel."""
    from baker.finish.finish import PageLayer, PagePlan, finish_page
    from baker.finish.oidn import LightmapDenoiser

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
    finish_page(plan, layers, upper=1.0, denoiser=LightmapDenoiser(1), dilation=4, threads=1, progress=silent)


if __name__ == "__main__":
    from baker.trace.numba_start import skip_blas

    skip_blas()
    # Compiling makes millions of small objects and hardly a cycle of them: looking for some takes 5 %.
    gc.disable()
    cast_rays(*sys.argv[1:])
    finish_pages()
