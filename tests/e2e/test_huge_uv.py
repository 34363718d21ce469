"""Texture coordinates of any size give finite light of the correct colour, and a warning if they are huge."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from gltf_builder import QUAD, QUAD_NORMAL, QUAD_TRIANGLE, GltfBuilder, write

import baker
from baker.core.colour import linear_from_srgb
from baker.core.lightmap import TexelStatus
from baker.io.png import encode_png

PIXELS = np.random.default_rng(5).integers(0, 256, (16, 16, 4), np.uint8)


def textured(path: Path, scale: float, transform: float, **material: object) -> Path:
    """Write a file with a unit square whose texture repeats `scale` x `transform` times along each side."""
    builder = GltfBuilder()
    texture: dict[str, object] = {"index": builder.image(encode_png(PIXELS))}
    if transform != 1.0:
        texture["extensions"] = {"KHR_texture_transform": {"scale": [transform, transform]}}
        builder.json["extensionsUsed"] = ["KHR_texture_transform"]
    content = {"pbrMetallicRoughness": {"baseColorTexture": texture}, **material}
    if "emissiveFactor" in content:
        content["emissiveTexture"] = texture
    number = builder.add("materials", content)
    uv = (QUAD[:, :2].astype(np.float64) * scale).astype(np.float32)
    primitive = builder.primitive(QUAD, QUAD_TRIANGLE, NORMAL=QUAD_NORMAL, TEXCOORD_0=uv, material=number)
    builder.node(mesh=builder.mesh(primitive, name="square"))
    return write(path, builder)


@pytest.mark.parametrize(
    ("scale", "transform", "material"),
    [
        (1e20, 1.0, {}),
        (3e38, 1.0, {"alphaMode": "MASK"}),
        (1.0, 1e30, {"alphaMode": "BLEND"}),
        (1e20, 1e300, {"emissiveFactor": [1, 1, 1]}),
        (1e20, 1.0, {"emissiveFactor": [1, 1, 1], "alphaMode": "BLEND"}),
    ],
)
def test_light_stays_finite(tmp_path: Path, scale: float, transform: float, material: dict) -> None:
    scene = textured(tmp_path / "s.glb", scale, transform, **material)
    result = baker.bake(scene, resolution=32, samples=4, sky="1,1,1", denoise=False)
    value = result.lightmaps["irradiance"].value
    assert np.isfinite(value).all()
    assert value.max() < 4.0
    codes = {warning.code for warning in baker.load(scene).warnings}
    assert ("bad-texcoord" in codes) == (scale > 1e6)


def test_the_light_of_very_many_repeats_is_that_of_their_mean(tmp_path: Path) -> None:
    """A square with very many repeats of an emissive texture emits the mean of the texture."""
    mean = [float(x) for x in linear_from_srgb(PIXELS[..., :3] / 255.0).mean((0, 1))]
    found = []
    for scale, factor in ((1e20, [1.0, 1.0, 1.0]), (None, mean)):
        builder = GltfBuilder()
        material = {"emissiveFactor": factor, "pbrMetallicRoughness": {"baseColorFactor": [0, 0, 0, 1]}}
        if scale:
            material["emissiveTexture"] = {"index": builder.image(encode_png(PIXELS))}
        uv = (QUAD[:, :2].astype(np.float64) * (scale or 1.0)).astype(np.float32)
        given = {"NORMAL": QUAD_NORMAL, "TEXCOORD_0": uv, "material": builder.add("materials", material)}
        builder.node(mesh=builder.mesh(builder.primitive(QUAD, QUAD_TRIANGLE, **given)))
        # Rotated by 180 degrees about y, so that the two fronts face each other.
        builder.node(
            mesh=builder.mesh(builder.primitive(QUAD, QUAD_TRIANGLE, NORMAL=QUAD_NORMAL)),
            translation=[1, 0, 1],
            rotation=[0, 1, 0, 0],
        )
        scene = write(tmp_path / f"{len(found)}.glb", builder)
        result = baker.bake(scene, resolution=64, samples=64, denoise=False)
        value = result.lightmaps["irradiance"].value[result.status == TexelStatus.COVERED]
        found.append(value[value.sum(axis=-1) > 0])
    # The form factor from the centre of one square to the other square is F = 4 / pi * B * atan(B), where
    # B = A / sqrt(1 + A^2) and A = 1/2 (Howell, configuration B-4).
    side = 0.5 / np.sqrt(1.25)
    centre = 4.0 / np.pi * side * np.arctan(side)
    np.testing.assert_allclose(found[1].max(axis=0), np.pi * centre * np.array(mean), rtol=0.01)
    # Each of the 64 samples of a lightmap texel hits one texel of the texture. The relative noise is 0.11 for
    # one lightmap texel and 0.003 for the mean of all.
    np.testing.assert_allclose(found[0].mean(axis=0), found[1].mean(axis=0), rtol=0.015)
