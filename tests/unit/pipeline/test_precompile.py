"""Kernels are compiled in advance only if the materials of the scene need them."""

from __future__ import annotations

import importlib
from pathlib import Path

import numpy as np
import pytest

from baker.core.scene import Material, Scene, Texture
from baker.finish.kernels.page_guard import hold_to_samples
from baker.pipeline import precompile
from baker.trace import kernel_cache
from baker.trace.kernel_cache import is_stored

SOLID, HOLED = np.full((2, 2, 4), 255, np.uint8), np.full((2, 2, 4), 255, np.uint8)
HOLED[0, 0, 3] = 254


def material(mode, colour=(1.0, 1.0, 1.0), alpha=1.0, image=None):
    texture = None if image is None else Texture(image)
    return Material(base_colour=(*colour, alpha), base_colour_texture=texture, alpha_mode=mode)


@pytest.mark.parametrize(
    ("materials", "kind"),
    [
        ([material("OPAQUE", alpha=0.0)], None),
        ([material("BLEND"), material("BLEND", image=SOLID)], None),
        ([material("OPAQUE"), material("MASK", (1, 0, 0), image=HOLED)], "holes"),
        ([material("BLEND", alpha=0.5)], "glass"),
        ([material("BLEND", (1, 0, 0), 0.5), material("MASK", image=HOLED)], "glass"),
        ([material("BLEND", image=HOLED)], "glass"),
        ([material("BLEND", image=HOLED.astype(np.float32) / 255)], "glass"),
    ],
)
def test_the_scene_decides_what_is_compiled(monkeypatch, materials, kind):
    started, stopped = [], []
    monkeypatch.setattr(precompile, "_run", lambda *kind: started.extend(kind) or "new")
    monkeypatch.setattr(precompile, "stop", stopped.append)
    scene = Scene("", None, (), tuple(materials), ())
    assert precompile.restart_for_materials("old", scene) == ("new" if kind else "old")
    assert started == ([kind] if kind else [])
    assert stopped == (["old"] if kind else [])
    # If all kernels are stored on disk, the process is None, and no other process is started.
    assert precompile.restart_for_materials(None, scene) is None


KERNEL = """
from baker.trace.jit import kernel

@kernel
def twice(x):
    return 2.0 * x
"""


def test_stored_kernels_are_found_under_the_names_that_numba_gives_them(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "cache"))
    (tmp_path / "some_kernels.py").write_text(KERNEL)
    twice = importlib.import_module("some_kernels").twice
    assert is_stored(twice) is False
    assert twice(3.0) == 6.0
    assert is_stored(twice) is True
    # `drop_stale` deletes only the index of a kernel whose source has changed. Then the kernel is not stored.
    for index in Path(twice._cache.cache_path).glob("*.nbi"):
        index.unlink()
    assert is_stored(twice) is False


@pytest.mark.parametrize(("stored", "runs"), [(False, True), (True, False), (None, False)])
def test_a_process_is_started_if_kernels_can_be_stored_and_are_not(monkeypatch, stored, runs):
    asked = []
    monkeypatch.setattr(precompile, "_run", lambda *kind: "process")
    monkeypatch.setattr(kernel_cache, "is_stored", lambda kernel: asked.append(kernel) or stored)
    assert (precompile.start() == "process") == runs
    assert asked == [hold_to_samples]
