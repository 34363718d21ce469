"""The check `albedo` reports the product of factor, texture and vertex colour."""

from __future__ import annotations

import numpy as np
import pytest
from flawed_scenes import SQUARE, png, quad, scene
from gltf_builder import write

from baker.checks.context import CheckContext
from baker.checks.rules.light_sources import albedos
from baker.core.settings import BakeSettings
from baker.io.load import load_scene


@pytest.mark.parametrize(
    ("factor", "level", "vertex", "expected"),
    [
        (1.0, 255, None, 1.0),
        (0.97, 255, None, 0.97),
        (1.0, 255, 0.5, 0.5),
        (1.0, 128, None, 0.2159),
        (1.0, 128, 0.97, 0.2159 * 0.97),
    ],
)
def test_albedo_is_the_product_of_factor_texture_and_vertex_colour(tmp_path, factor, level, vertex, expected):
    def textured(builder):
        texture = {"index": builder.image(png(level))}
        surface = {"baseColorFactor": [factor, factor, factor, 1.0], "baseColorTexture": texture}
        builder.json["materials"][0] = {"pbrMetallicRoughness": surface}

    attributes = {"TEXCOORD_0": SQUARE}
    if vertex is not None:
        attributes["COLOR_0"] = np.full((4, 3), vertex, np.float32)
    path = write(tmp_path / "a.glb", scene(quad(**attributes), extra=textured))
    found = albedos(CheckContext(load_scene(path), BakeSettings()))
    assert found == pytest.approx([expected], abs=1e-3)
