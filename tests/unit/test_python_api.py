"""What Python programs call, also after the package of the same name has been imported."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import baker

CORNELL = Path(__file__).parents[2] / "assets" / "cornell.glb"


def test_each_stage_alone_before_and_after_a_bake():
    scene = baker.load(CORNELL)
    first = baker.unwrap(scene, resolution=64)
    result = baker.bake(scene, resolution=64, samples=2, denoise=False)
    # By now `baker.unwrap` is a package, too.
    again = baker.unwrap(scene, resolution=64)
    assert first.resolution == again.resolution == 64
    for one, other in zip(first.layouts, again.layouts, strict=True):
        np.testing.assert_array_equal(one.uv, other.uv)
    assert result.lightmaps["irradiance"].value.shape == (1, 64, 64, 3)
