"""Materials of KHR_materials_transmission become panes with the right share, colour and reflectance."""

from __future__ import annotations

import io

import numpy as np
import pytest
from gltf_builder import quad_builder, write
from PIL import Image

from baker.core.errors import InputError
from baker.io.load import load_scene

TRANSMISSION, VOLUME, IOR = "KHR_materials_transmission", "KHR_materials_volume", "KHR_materials_ior"


def png(pixels):
    stream = io.BytesIO()
    Image.fromarray(np.uint8(pixels)).save(stream, "PNG")
    return stream.getvalue()


def glass(base=None, *, transmission=None, extensions=None, **material):
    through = {TRANSMISSION: {"transmissionFactor": 1, **(transmission or {})}, **(extensions or {})}
    return quad_builder(name="glass", pbrMetallicRoughness=base or {}, extensions=through, **material)


def read(tmp_path, builder):
    scene = load_scene(write(tmp_path / "a.glb", builder))
    return scene.materials[0], [w.code for w in scene.warnings]


def test_the_alpha_of_a_pane_is_what_it_does_not_transmit(tmp_path):
    builder = glass({"baseColorFactor": [0.5, 0.25, 1, 0.125]}, transmission={"transmissionFactor": 0.75})
    builder.json["extensionsUsed"] = builder.json["extensionsRequired"] = [TRANSMISSION]
    material, codes = read(tmp_path, builder)
    # The alpha of OPAQUE materials is ignored.
    assert material.base_colour == (0.5, 0.25, 1, 0.25)
    assert (material.alpha_mode, codes) == ("BLEND", [])
    assert material.reflectance == pytest.approx(0.04)


@pytest.mark.parametrize(("ior", "reflectance"), [(1.0, 0.0), (1.5, 0.04), (2.0, 1 / 9), (0.0, 1.0)])
def test_the_refractive_index_gives_the_reflectance(tmp_path, ior, reflectance):
    material, _ = read(tmp_path, glass(extensions={IOR: {"ior": ior}}))
    assert material.reflectance == pytest.approx(reflectance)


def test_two_crossings_attenuate_as_much_as_the_thickness(tmp_path):
    volume = {"attenuationColor": [0.5, 0.25, 1], "attenuationDistance": 0.1, "thicknessFactor": 0.2}
    builder = glass({"baseColorFactor": [1, 1, 0.5, 1]}, extensions={VOLUME: volume})
    builder.json["extensionsUsed"] = builder.json["extensionsRequired"] = [TRANSMISSION, VOLUME]
    material, codes = read(tmp_path, builder)
    np.testing.assert_allclose(np.square(material.base_colour[:3]), [0.5**2, 0.25**2, 0.25])
    assert codes == []
    thin, _ = read(tmp_path, glass(extensions={VOLUME: {**volume, "thicknessFactor": 0}}))
    assert thin.base_colour[:3] == (1, 1, 1)
    clear, _ = read(tmp_path, glass(extensions={VOLUME: {"thicknessFactor": 3}}))
    assert clear.base_colour[:3] == (1, 1, 1)


def test_the_red_of_the_texture_is_the_share(tmp_path):
    builder = glass(
        transmission={"transmissionTexture": {"index": 0, "texCoord": 1}, "transmissionFactor": 0.5}
    )
    builder.image(png([[[255, 9, 9], [0, 9, 9]]]))
    material, _ = read(tmp_path, builder)
    assert material.base_colour[3] == 1
    assert material.base_colour_texture.texcoord == 1
    np.testing.assert_array_equal(material.base_colour_texture.image, [[[255] * 3 + [128], [255] * 4]])


def test_a_texture_with_the_place_of_the_base_colour_becomes_its_alpha(tmp_path):
    base = {"baseColorTexture": {"index": 0}}
    builder = glass(base, transmission={"transmissionTexture": {"index": 1}})
    builder.image(png([[[10, 20, 30, 40]], [[50, 60, 70, 80]]]))
    builder.image(png([[[255, 0, 0], [51, 0, 0]]]))
    material, codes = read(tmp_path, builder)
    want = [[[10, 20, 30, 0], [10, 20, 30, 204]], [[50, 60, 70, 0], [50, 60, 70, 204]]]
    np.testing.assert_array_equal(material.base_colour_texture.image, want)
    assert codes == []
    builder.json["materials"][0]["extensions"][TRANSMISSION]["transmissionTexture"]["texCoord"] = 1
    material, codes = read(tmp_path, builder)
    # The mean of 255 and 51 is 0.6; the alpha of the base colour texture is ignored.
    assert material.base_colour[3] == pytest.approx(0.4)
    np.testing.assert_array_equal(material.base_colour_texture.image[..., 3], 255)
    assert codes == ["transmission"]


def test_alpha_precedes_transmission(tmp_path):
    material, codes = read(tmp_path, glass({"baseColorFactor": [1, 1, 1, 0.5]}, alphaMode="BLEND"))
    assert (material.reflectance, material.base_colour[3], codes) == (None, 0.5, ["transmission"])
    # Exporters write BLEND for glass whose alpha is 1.
    material, codes = read(tmp_path, glass(alphaMode="BLEND"))
    assert (material.reflectance, material.base_colour[3], codes) == (pytest.approx(0.04), 0, [])


@pytest.mark.parametrize(
    ("transmission", "extensions", "words"),
    [
        ({"transmissionFactor": 2}, {}, "between 0 and 1"),
        ({"transmissionTexture": {"index": 0}}, {}, "textures|out of range|list index"),
        ({}, {VOLUME: {"attenuationDistance": 0}}, "not above 0"),
        ({}, {IOR: {"ior": -1}}, "at least 0"),
    ],
)
def test_broken_values_are_refused(tmp_path, transmission, extensions, words):
    with pytest.raises(InputError, match=words):
        read(tmp_path, glass(transmission=transmission, extensions=extensions))


def test_a_transmission_of_zero_changes_nothing(tmp_path):
    material, codes = read(tmp_path, glass(transmission={"transmissionFactor": 0}))
    assert (material.alpha_mode, material.reflectance, codes) == ("OPAQUE", None, [])
