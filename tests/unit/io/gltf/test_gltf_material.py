"""The glTF importer copies all material and texture values that a bake reads to `Material`."""

from __future__ import annotations

import base64
import io
import math

import numpy as np
import pytest
from glb_reader import Glb
from gltf_builder import quad_builder, write
from io_scenes import make_atlas, split_layout
from PIL import Image

from baker.core.colour import linear_from_srgb
from baker.core.errors import InputError, SettingsError
from baker.core.geometry import world_geometry
from baker.core.read_options import ReadOptions
from baker.io.gltf.texture import texture_transform
from baker.io.gltf.write_baked import make_glb
from baker.io.images import decode_image
from baker.io.load import load_scene
from baker.shading.materials import resolve_materials


def encode(pixels, kind="PNG", **options):
    stream = io.BytesIO()
    Image.fromarray(pixels).save(stream, kind, **options)
    return stream.getvalue()


PIXELS = np.arange(24, dtype=np.uint8).reshape(2, 3, 4) * 10


def material_of(tmp_path, builder):
    return load_scene(write(tmp_path / "a.glb", builder)).materials[0]


def test_defaults_are_those_of_the_specification(tmp_path):
    material = material_of(tmp_path, quad_builder(name="plain"))
    assert material.name == "plain"
    assert material.base_colour == (1, 1, 1, 1)
    assert material.emission == (0, 0, 0)
    assert (material.alpha_mode, material.alpha_cutoff, material.double_sided) == ("OPAQUE", 0.5, False)
    assert (material.metallic, material.roughness) == (1, 1)
    assert material.base_colour_texture is None


def test_factors_strength_and_sides(tmp_path):
    material = material_of(
        tmp_path,
        quad_builder(
            pbrMetallicRoughness={"baseColorFactor": [0.1, 0.2, 0.3, 0.4], "metallicFactor": 0.5},
            emissiveFactor=[1, 0.5, 0.25],
            extensions={"KHR_materials_emissive_strength": {"emissiveStrength": 40}},
            doubleSided=True,
            alphaMode="MASK",
            alphaCutoff=0.25,
        ),
    )
    assert material.base_colour == (0.1, 0.2, 0.3, 0.4)
    assert material.emission == (40, 20, 10)
    assert material.double_sided
    assert (material.alpha_mode, material.alpha_cutoff, material.metallic) == ("MASK", 0.25, 0.5)


def test_unlit_emits_nothing_and_reflects_only_if_asked(tmp_path):
    builder = quad_builder(
        name="sign",
        pbrMetallicRoughness={"baseColorFactor": [0.5, 0.25, 0, 1], "baseColorTexture": {"index": 0}},
        emissiveFactor=[1, 1, 1],
        extensions={"KHR_materials_unlit": {}},
    )
    builder.json["images"], builder.json["textures"] = [{"uri": "gone.png"}], [{"source": 0}]
    path = write(tmp_path / "a.glb", builder)
    scene = load_scene(path)
    material = scene.materials[0]
    assert material.base_colour[:3] == (0.5, 0.25, 0)
    assert material.emission == (0, 0, 0)
    assert [w.object for w in scene.warnings if w.code == "unlit"] == ["sign"]
    geometry = world_geometry(scene, make_atlas(split_layout(scene, 0)))
    np.testing.assert_array_equal(resolve_materials(scene, geometry).base, [[0, 0, 0]])
    # A black surface does not need its picture.
    assert {w.code for w in scene.warnings} == {"unlit", "missing-texture"}
    with pytest.raises(InputError, match=r"gone\.png"):
        load_scene(path, options=ReadOptions(unlit="lit"))
    lit = load_scene(path, options=ReadOptions(unlit="lit", missing_textures="white"))
    np.testing.assert_array_equal(resolve_materials(lit, geometry).base, np.float32([[0.5, 0.25, 0]]))
    assert "unlit" not in {w.code for w in lit.warnings}


def test_a_variant_chooses_materials_and_all_variants_stay(tmp_path):
    builder = quad_builder(name="plain", pbrMetallicRoughness={"baseColorFactor": [1, 0, 0, 1]})
    blue = builder.add(
        "materials", {"name": "blue", "pbrMetallicRoughness": {"baseColorFactor": [0, 0, 1, 1]}}
    )
    builder.json["extensions"] = {
        VARIANTS: {"variants": [{"name": "day"}, {"name": "night"}, {"name": "fog"}]}
    }
    builder.json["extensionsUsed"] = [VARIANTS]
    mappings = [{"material": blue, "variants": [1, 2]}]
    builder.json["meshes"][0]["primitives"][0]["extensions"] = {VARIANTS: {"mappings": mappings}}
    path = write(tmp_path / "a.glb", builder)

    def colour(variant):
        scene = load_scene(path, options=ReadOptions(variant=variant))
        return scene.materials[scene.meshes[0].material[0]].base_colour[:3]

    assert [colour(v) for v in (None, "day", "night", "fog")] == [(1, 0, 0)] * 2 + [(0, 0, 1)] * 2
    with pytest.raises(SettingsError, match="no variant 'nigt'; did you mean 'night'"):
        colour("nigt")
    scene = load_scene(path, options=ReadOptions(variant="night"))
    document = Glb(make_glb(scene, make_atlas(split_layout(scene, 0))).data).json
    assert document["extensions"] == builder.json["extensions"]
    assert document["meshes"][0]["primitives"][0]["extensions"] == {VARIANTS: {"mappings": mappings}}
    del builder.json["extensions"]
    write(path, builder)
    with pytest.raises(SettingsError, match="the file has no material variants"):
        colour("day")


VARIANTS = "KHR_materials_variants"
GLOSSY = "KHR_materials_pbrSpecularGlossiness"


def test_specular_glossiness_gives_the_base_colour_in_place_of_metallic_roughness(tmp_path):
    moved = {"KHR_texture_transform": {"offset": [0.25, 0], "texCoord": 1}}
    glossy = {
        "diffuseFactor": [0.5, 0.25, 0.125, 0.75],
        "diffuseTexture": {"index": 0, "extensions": moved},
        "specularFactor": [0, 0, 0],
        "glossinessFactor": 0.25,
    }
    plain = {"pbrMetallicRoughness": {"baseColorFactor": [1, 0, 0, 1], "baseColorTexture": {"index": 99}}}
    for more in ({}, plain):
        builder = quad_builder(
            name="g",
            **more,
            extensions={GLOSSY: glossy, "KHR_materials_emissive_strength": {"emissiveStrength": 4}},
            emissiveFactor=[1, 0.5, 0],
            alphaMode="BLEND",
            doubleSided=True,
        )
        builder.image(encode(PIXELS))
        builder.json["extensionsUsed"] = builder.json["extensionsRequired"] = [GLOSSY]
        scene = load_scene(write(tmp_path / "a.glb", builder))
        material = scene.materials[0]
        assert material.base_colour == (0.5, 0.25, 0.125, 0.75)
        np.testing.assert_array_equal(material.base_colour_texture.image, PIXELS)
        assert material.base_colour_texture.texcoord == 1
        assert material.base_colour_texture.transform[0, 2] == 0.25
        assert material.emission == (4, 2, 0)
        assert (material.metallic, material.roughness) == (0, 0.75)
        assert (material.alpha_mode, material.double_sided) == ("BLEND", True)
        assert "extension-ignored" not in {w.code for w in scene.warnings}


def test_specular_glossiness_without_a_colour_is_white_and_a_missing_texture_of_it_is_refused(tmp_path):
    assert material_of(tmp_path, quad_builder(extensions={GLOSSY: {}})).base_colour == (1, 1, 1, 1)
    builder = quad_builder(extensions={GLOSSY: {"diffuseTexture": {"index": 0}}})
    builder.json |= {"images": [{"uri": "gone.png"}], "textures": [{"source": 0}]}
    with pytest.raises(InputError, match=r"gone\.png.*missing"):
        material_of(tmp_path, builder)


@pytest.mark.parametrize(
    "name", ["KHR_techniques_webgl", "VRMC_materials_mtoon", "ACME_materials_paint", "KHR_materials_common"]
)
def test_an_unknown_model_without_a_base_colour_reflects_half(tmp_path, name):
    def load(**material):
        builder = quad_builder(name="odd", extensions={name: {"colour": [1, 0, 0]}}, **material)
        builder.json["extensionsUsed"] = [name]
        scene = load_scene(write(tmp_path / "a.glb", builder))
        return scene.materials[0], [w for w in scene.warnings if w.code == "unknown-material"]

    for more in ({}, {"pbrMetallicRoughness": {"metallicFactor": 0}}):
        material, found = load(**more)
        assert material.base_colour == (0.5, 0.5, 0.5, 1)
        assert len(found) == 1
        assert found[0].object == "odd"
        assert name in found[0].message
    # If the core material has a base colour, that colour is the author's fallback for readers without the
    # extension.
    material, found = load(pbrMetallicRoughness={"baseColorFactor": [0.1, 0.2, 0.3, 1]})
    assert (material.base_colour, found) == ((0.1, 0.2, 0.3, 1), [])


@pytest.mark.parametrize("name", ["KHR_materials_clearcoat", "KHR_materials_volume", "KHR_materials_unlit"])
def test_layers_leave_the_default_white(tmp_path, name):
    scene = load_scene(write(tmp_path / "a.glb", quad_builder(extensions={name: {}})))
    assert scene.materials[0].base_colour == (1, 1, 1, 1)
    assert [w for w in scene.warnings if w.code == "unknown-material"] == []


@pytest.mark.parametrize("how", ["view", "data", "file"])
def test_a_texture_is_found_wherever_it_is_kept(tmp_path, how):
    builder = quad_builder(pbrMetallicRoughness={"baseColorTexture": {"index": 0}}, name="t")
    png = encode(PIXELS)
    builder.json["samplers"] = [{"wrapS": 33071, "wrapT": 33648}]
    if how == "view":
        builder.image(png, sampler=0)
    else:
        uri = f"data:image/png;base64,{base64.b64encode(png).decode()}" if how == "data" else "a%20b.png"
        (tmp_path / "a b.png").write_bytes(png)
        builder.json["images"] = [{"uri": uri}]
        builder.json["textures"] = [{"source": 0, "sampler": 0}]
    texture = material_of(tmp_path, builder).base_colour_texture
    np.testing.assert_array_equal(texture.image, PIXELS)
    assert texture.image.dtype == np.uint8
    assert texture.wrap == ("clamp", "mirror")
    assert not texture.nearest
    assert texture.texcoord == 0
    np.testing.assert_array_equal(texture.transform, np.eye(2, 3))


@pytest.mark.parametrize(("code", "nearest"), [(9728, True), (9729, False), (None, False)])
def test_only_magnification_decides_about_nearest_lookups(tmp_path, code, nearest):
    builder = quad_builder(emissiveFactor=[1, 1, 1], emissiveTexture={"index": 0})
    builder.json["samplers"] = [{"minFilter": 9728, **({"magFilter": code} if code else {})}]
    builder.image(encode(PIXELS), sampler=0)
    assert material_of(tmp_path, builder).emission_texture.nearest == nearest


def test_one_image_is_decoded_once_and_shared(tmp_path):
    builder = quad_builder(
        pbrMetallicRoughness={"baseColorTexture": {"index": 0}}, emissiveTexture={"index": 0}
    )
    builder.image(encode(PIXELS))
    material = material_of(tmp_path, builder)
    assert material.base_colour_texture.image is material.emission_texture.image
    assert material.base_colour_texture.wrap == ("repeat", "repeat")


def test_webp_through_its_extension(tmp_path):
    builder = quad_builder(pbrMetallicRoughness={"baseColorTexture": {"index": 0}})
    webp = encode(PIXELS, "WEBP", lossless=True, exact=True)
    builder.json["images"] = [{"bufferView": builder.view(webp), "mimeType": "image/webp"}]
    builder.json["textures"] = [{"extensions": {"EXT_texture_webp": {"source": 0}}}]
    builder.json["extensionsUsed"] = builder.json["extensionsRequired"] = ["EXT_texture_webp"]
    np.testing.assert_array_equal(material_of(tmp_path, builder).base_colour_texture.image, PIXELS)


def test_texture_transform_overrides_the_set_and_scales_then_turns_then_shifts(tmp_path):
    moved = {"offset": [0.25, 0.5], "rotation": 0.3, "scale": [2, 3], "texCoord": 1}
    info = {"index": 0, "texCoord": 0, "extensions": {"KHR_texture_transform": moved}}
    builder = quad_builder(pbrMetallicRoughness={"baseColorTexture": info})
    builder.image(encode(PIXELS))
    texture = material_of(tmp_path, builder).base_colour_texture
    assert texture.texcoord == 1
    u, v = 0.7, 0.2
    c, s = math.cos(0.3), math.sin(0.3)
    expected = (2 * u * c + 3 * v * s + 0.25, -2 * u * s + 3 * v * c + 0.5)
    np.testing.assert_allclose(texture.transform @ (u, v, 1), expected, rtol=1e-14)


def test_texture_transform_gives_the_quadrant_of_the_extensions_example():
    # The specification of KHR_texture_transform describes this example: "utilizes only the lower left
    # quadrant of the source image, rotated clockwise". v points down.
    matrix = texture_transform((0, 1), math.pi / 2, (0.5, 0.5))
    corner = np.array([[u, v, 1] for u in (0, 1) for v in (0, 1)]) @ matrix.T
    np.testing.assert_allclose(corner.min(axis=0), (0, 0.5), atol=1e-15)
    np.testing.assert_allclose(corner.max(axis=0), (0.5, 1), atol=1e-15)


@pytest.mark.parametrize(
    ("pixels", "expected"),
    [
        (np.array([[0, 65535, 32896, 257]], np.uint16), [0, 255, 128, 1]),
        (np.array([[0, 255, 128, 1]], np.uint8), [0, 255, 128, 1]),
    ],
)
def test_grey_images_of_eight_and_sixteen_bits(pixels, expected):
    image = decode_image(encode(pixels), file="f", object="o")
    assert image.shape == (1, 4, 4)
    assert image[0, :, 0].tolist() == image[0, :, 2].tolist() == expected
    assert (image[..., 3] == 255).all()


def test_jpeg_and_palette_images_decode_to_opaque_rgba():
    flat = np.full((8, 8, 3), (200, 100, 50), np.uint8)
    jpeg = decode_image(encode(flat, "JPEG", quality=95), file="f", object="o")
    assert np.abs(jpeg[..., :3].astype(int) - flat).max() <= 3  # JPEG is lossy
    stream = io.BytesIO()
    Image.fromarray(flat).convert("P", palette=Image.Palette.ADAPTIVE).save(stream, "PNG")
    palette = decode_image(stream.getvalue(), file="f", object="o")
    np.testing.assert_array_equal(palette[..., :3], flat)
    assert (palette[..., 3] == 255).all()


def test_srgb_decoding_at_known_points():
    got = linear_from_srgb(np.array([0, 0.04045, 0.5, 1], np.float32))
    np.testing.assert_allclose(got, [0, 0.0031308, 0.21404114, 1], rtol=2e-5)
