"""The check `cost` and the memory limit use one estimate of peak memory, within 30 % of measured peaks."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from baker.checks.context import CheckContext
from baker.checks.rules.cost import estimate_cost
from baker.core.budget import (
    BASE_BYTES,
    LARGEST_IMAGE_SIDE,
    MAX_PATCHES,
    Workload,
    image_bytes,
    patch_rays,
    texels_and_pages,
)
from baker.core.scene import Material, Scene, Texture
from baker.core.settings import make_settings
from baker.io.load import load_for_bake
from baker.jobs.memory import estimate_peak

ROOT = Path(__file__).parents[3]
# Script that bakes a scene and prints its peak resident memory in bytes, and its rays, pages and texels. It
# prefers `VmHWM`, the peak of the script's process only, to `ru_maxrss`, which includes the memory of the
# process that started the script.
BAKE = """
import json, re, resource, sys
from baker.core.settings import make_settings
from baker.pipeline.bake import bake

result = bake(sys.argv[1], settings=make_settings(json.loads(sys.argv[2])))
try:
    peak = 1024 * int(re.search(r"VmHWM:\\s*(\\d+)", open("/proc/self/status").read())[1])
except OSError:
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1 if sys.platform == "darwin" else 1024)
texels = int(result.texel_count.sum())
print(json.dumps({"peak": peak, "rays": result.rays, "pages": result.atlas.n_pages, "texels": texels}))
"""
CASES = [
    ("cornell", {"resolution": 64, "samples": 4}),
    ("cornell", {"resolution": 256, "samples": 8}),
    ("cornell", {"resolution": 512, "samples": 4, "channels": "ao"}),
    ("hall", {"resolution": 256, "samples": 4}),
    ("interior", {"resolution": 256, "samples": 4, "denoise": False}),
]


@pytest.mark.parametrize(("name", "values"), CASES, ids=[f"{n}-{len(v)}-{v['resolution']}" for n, v in CASES])
def test_the_estimate_is_within_30_percent_of_the_measured_peak(name, values):
    path = ROOT / "assets" / f"{name}.glb"
    command = [sys.executable, "-c", BAKE, str(path), json.dumps(values)]
    settings = make_settings(values)
    estimate = estimate_peak(path, settings)
    # Compiling kernels takes memory. If the first run compiles them, the second loads them from the cache.
    for _ in range(2):
        done = subprocess.run(command, capture_output=True, text=True, timeout=300)
        assert done.returncode == 0, done.stderr
        measured = json.loads(done.stdout.splitlines()[-1])
        if estimate == pytest.approx(measured["peak"], rel=0.3):
            break
    assert estimate == pytest.approx(measured["peak"], rel=0.3)

    cost = estimate_cost(CheckContext(load_for_bake(path, settings), settings))
    # The numbers differ slightly, because the check leaves out degenerate triangles.
    assert cost.bytes == pytest.approx(estimate, rel=0.01)
    assert cost.pages == measured["pages"]
    assert 0.3 < measured["texels"] / cost.texels < 1.1
    # The rays that detect split texels and narrow gaps are few and are not estimated.
    assert set(cost.rays) == set(measured["rays"]) - {"texel sides", "narrow gaps"}


def test_pages_follow_density():
    settings = make_settings({"resolution": 100, "density": 10, "max_pages": 3})
    assert texels_and_pages(settings, 1.0) == (100, 1)
    assert texels_and_pages(settings, 65.0) == (6500, 1)
    assert texels_and_pages(settings, 66.0) == (6600, 2)
    assert texels_and_pages(settings, 1e6) == (24000, 3)
    assert texels_and_pages(make_settings({"resolution": 100}), 1e6) == (8000, 1)


def test_patches_and_rays_keep_to_their_limits():
    def work(texels, **more):
        fields = {"light": True, "ambient_occlusion": False} | more
        return Workload(texels=texels, pages=1, triangles=0, image_bytes=(0, 0), **fields)

    settings = make_settings({"samples": 4})
    assert [patch_rays(make_settings({"samples": n})) for n in (4, 200, 5000)] == [128, 200, 512]
    assert work(1000).patches(settings) == 1000
    assert MAX_PATCHES / 4 < work(10**7).patches(settings) <= MAX_PATCHES
    assert work(1000).patches(make_settings({"bounces": 0})) == 0
    assert work(1000, light=False).patches(settings) == 0
    rays = work(100, ambient_occlusion=True).rays(settings, delta_lights=2, emitters=True)
    assert rays == {
        "inside geometry": 400,
        "direct light": 100 * (16 * 2 + 4 + 4),
        "form factors": 100 * 128,
        "final gather": 400,
    }
    alone = work(100, light=False, ambient_occlusion=True)
    assert alone.rays(settings, delta_lights=2, emitters=True) == {
        "inside geometry": 400,
        "ambient occlusion": 400,
    }


def test_the_estimate_covers_the_decoding_of_a_large_image():
    def scene(*sides):
        images = [np.broadcast_to(np.uint8(0), (side, side, 4)) for side in sides]
        return Scene(
            name="s",
            path=Path("s.glb"),
            meshes=[],
            instances=[],
            materials=[Material(name="m", base_colour_texture=Texture(image)) for image in images],
            lights=[],
        )

    half = LARGEST_IMAGE_SIDE // 2
    assert image_bytes(scene()) == (0, 0)
    assert image_bytes(scene(64, half)) == (4 * (64**2 + half**2), 4 * (64**2 + 2 * half**2))
    # An image of this size may be the reduced version of an image of twice its width and height.
    assert image_bytes(scene(half + 1)) == (4 * (half + 1) ** 2, 5 * 4 * (half + 1) ** 2)
    twice = replace(scene(64), materials=scene(64).materials * 2)
    assert image_bytes(twice)[0] == 4 * 64**2

    def peak(images):
        work = Workload(
            texels=1, pages=1, triangles=0, image_bytes=images, light=False, ambient_occlusion=True
        )
        return work.peak_bytes(make_settings({"resolution": 16, "denoise": False}))

    assert peak((10**9, 5 * 10**9)) == BASE_BYTES + 5 * 10**9
    assert peak((10**9, 2 * 10**9)) == pytest.approx(BASE_BYTES + 3.5e9, rel=1e-3)
