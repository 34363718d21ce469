"""`check` computes where emissive textures emit, and their mean radiance over the area that the uv cover."""

from __future__ import annotations

import io

import numpy as np
import pytest
from gltf_builder import QUAD, QUAD_NORMAL, QUAD_TRIANGLE, GltfBuilder, write
from PIL import Image

from baker.checks.context import CheckContext
from baker.checks.rules.light_sources import emissive_black, no_light
from baker.core.settings import BakeSettings
from baker.io.load import load_scene

UV = QUAD[:, :2].copy()


def context(tmp_path, uv, texel=(10, 40), scale=(1.0, 1.0, 1.0)):
    """Return the context of a scene of two unit squares that face each other at a distance of one metre.

    One square emits. Its emissive texture has 64 x 64 texels. One of these texels is white, all others are
    black.
    """
    image = np.zeros((64, 64, 3), np.uint8)
    image[texel] = 255
    stream = io.BytesIO()
    Image.fromarray(image).save(stream, "PNG")
    builder = GltfBuilder()
    texture = builder.image(stream.getvalue())
    emissive = builder.add(
        "materials", {"emissiveFactor": [1, 1, 0.5], "emissiveTexture": {"index": texture}}
    )
    grey = builder.add("materials", {})
    for position, normal, triangle, material in (
        (QUAD, QUAD_NORMAL, QUAD_TRIANGLE, emissive),
        (QUAD + np.float32([0, 0, 1]), -QUAD_NORMAL, QUAD_TRIANGLE[:, ::-1], grey),
    ):
        made = builder.primitive(
            position, triangle, NORMAL=np.float32(normal), TEXCOORD_0=np.float32(uv), material=material
        )
        builder.node(mesh=builder.mesh(made), scale=list(scale))
    return CheckContext(load_scene(write(tmp_path / "a.glb", builder)), BakeSettings())


@pytest.mark.parametrize("scale", [(1.0, 1.0, 1.0), (-1.0, 1.0, 1.0)])
@pytest.mark.parametrize("repeats", [1, 7])
def test_the_mean_is_that_of_the_texture(tmp_path, repeats, scale):
    found = context(tmp_path, UV * repeats, scale=scale).emission
    power = (found.area[:, None] * found.radiance).sum(axis=0)
    np.testing.assert_allclose(power, np.array([1, 1, 0.5]) / 4096, rtol=1e-6)


def test_light_levels_are_those_of_the_lit_texel(tmp_path):
    one = context(tmp_path, UV)
    levels = one.levels
    low = QUAD.min(axis=0)
    spot = low[:2] + np.array([40.5, 10.5]) / 64 * np.ptp(QUAD, axis=0)[:2]
    facing = levels.position[:, 2] > 0.5
    square = ((levels.position[facing, :2] - spot) ** 2).sum(axis=1) + 1
    np.testing.assert_allclose(levels.irradiance[facing], 1 / 4096 / square**2, rtol=0.05)


def test_surfaces_in_the_black_part_of_a_texture_emit_nothing(tmp_path):
    dark = context(tmp_path, UV * 0.1 + 0.8)
    assert not dark.emits
    assert len(list(no_light(dark))) == 1
    (told,) = emissive_black(dark)
    assert "where its emissive texture is black" in told.message
    lit = context(tmp_path, UV)
    assert lit.emits
    assert not list(no_light(lit))
    assert not list(emissive_black(lit))
