"""What Python programs call, also after every package has been imported."""

from __future__ import annotations

import pkgutil
from pathlib import Path

import numpy as np

import baker

CORNELL = Path(__file__).parents[2] / "assets" / "cornell.glb"


def test_each_stage_alone_before_and_after_a_bake():
    scene = baker.load(CORNELL)
    first = baker.unwrap(scene, resolution=64)
    result = baker.bake(scene, resolution=64, samples=2, denoise=False)
    again = baker.unwrap(scene, resolution=64)
    assert first.resolution == again.resolution == 64
    for one, other in zip(first.layouts, again.layouts, strict=True):
        np.testing.assert_array_equal(one.uv, other.uv)
    assert result.lightmaps["irradiance"].value.shape == (1, 64, 64, 3)


def test_no_module_hides_a_function():
    """Packages are nouns and functions are verbs, those that are still to come among them."""
    modules = {found.name for found in pkgutil.iter_modules(baker.__path__)}
    verbs = {"check", "compare", "fix", "render", "save", "verify", "view"}
    assert modules & {*baker.__all__, *verbs} == set()
