"""Textures of every kind of image give the colours of the image; missing ones are refused or replaced."""

from __future__ import annotations

import base64
import io
import sys

import numpy as np
import pytest
from gltf_builder import quad_builder, write
from PIL import Image, features

from baker.core.errors import InputError
from baker.core.read_options import ReadOptions
from baker.core.scene import Texture
from baker.io.load import load_scene

# Basis Universal textures of 8 x 8 texels, made with alktx2 0.1.7: red and green above blue and grey, which
# has alpha 128.
ETC1S = (
    "q0tUWCAyMLsNChoKAAAAAAEAAAAIAAAACAAAAAAAAAAAAAAAAQAAAAEAAAABAAAAaAAAADwAAACkAAAAJAAAAMgAAAAAAAAA"
    "mAAAAAAAAABgAQAAAAAAAAMAAAAAAAAAAAAAAAAAAAA8AAAAAAAAAAIAOACjAQIAAwMAAAgIAAAAAAAAAAA/AAAAAAAAAAAA"
    "/////0AAPw8AAAAAAAAAAP////8fAAAAS1RYd3JpdGVyAEJhc2lzIFVuaXZlcnNhbCAyLjEwAAAGAAMANQAAAA0AAAAuAAAA"
    "AAAAAAAAAAAAAAAAAgAAAAIAAAABAAAAIEAUAAEAAEAQPXf4vQBmAAAAAACAIB6TLYC5AQIAAIAw7AGRLEUAYgAAAAAAQDDQ"
    "s9fu0BBUVVVVBQAAAKiqqqoCAMFEAAAAAAAA8t8nSAEwAUAAAAAAArkQARECBAAAACBhGgFgAkAAAAAAABEIAEMUHg=="
)
UASTC = (
    "q0tUWCAyMLsNChoKAAAAAAEAAAAIAAAACAAAAAAAAAAAAAAAAQAAAAEAAAAAAAAAaAAAACwAAACUAAAALAAAAAAAAAAAAAAA"
    "AAAAAAAAAADAAAAAAAAAAEAAAAAAAAAAQAAAAAAAAAAsAAAAAAAAAAIAKACmAQIAAwMAABAAAAAAAAAAAAB/AwAAAAAAAAAA"
    "/////x8AAABLVFh3cml0ZXIAQmFzaXMgVW5pdmVyc2FsIDIuMTAAAAQAAAB/fwAAFxkF5T/IxgAAAAAAAAAAABcFGeU/MNkA"
    "AAAAAAAAAAAXBQX5PzAmAwAAAAAAAAAAFw8PDxA1xgAAAAAAAAAAAA=="
)
QUARTERS = np.uint8([[[200, 40, 40, 255], [40, 200, 40, 255]], [[40, 40, 200, 255], [120, 120, 120, 128]]])
PIXELS = np.arange(24, dtype=np.uint8).reshape(2, 3, 4) * 10
GONE = {"uri": "gone.png"}


def encode(pixels, kind="PNG", **options):
    stream = io.BytesIO()
    image = pixels if isinstance(pixels, Image.Image) else Image.fromarray(pixels)
    image.save(stream, kind, **options)
    return stream.getvalue()


def builder_of(images, texture, key="baseColorTexture", **material):
    """Return a square whose material reads `texture`; each image is bytes, or JSON without data."""
    holder = (
        {"pbrMetallicRoughness": {key: {"index": 0}}} if key == "baseColorTexture" else {key: {"index": 0}}
    )
    builder = quad_builder(name="paint", **(holder | material))
    builder.json["images"] = [
        image if isinstance(image, dict) else {"bufferView": builder.view(image)} for image in images
    ]
    builder.json["textures"] = [texture]
    return builder


def read(tmp_path, builder, **options) -> tuple[Texture | None, list[str]]:
    scene = load_scene(write(tmp_path / "a.glb", builder), options=ReadOptions(**options))
    return scene.materials[0].base_colour_texture, [w.code for w in scene.warnings]


def image_of(tmp_path, data):
    found, _ = read(tmp_path, builder_of([data], {"source": 0}))
    return found.image


def png16(values):
    """Return a PNG of 16 bits; `values` is (H, W) for grey and (H, W, 3) for RGB."""
    import struct
    import zlib

    rows = b"".join(b"\0" + np.ascontiguousarray(row).astype(">u2").tobytes() for row in values)
    height, width = values.shape[:2]
    head = struct.pack(">IIBBBBB", width, height, 16, 0 if values.ndim == 2 else 2, 0, 0, 0)
    chunks = ((b"IHDR", head), (b"IDAT", zlib.compress(rows)), (b"IEND", b""))
    body = (struct.pack(">I", len(d)) + t + d + struct.pack(">I", zlib.crc32(t + d)) for t, d in chunks)
    return b"\x89PNG\r\n\x1a\n" + b"".join(body)


def test_png_of_16_bits_is_rounded_to_8():
    values = np.uint16([[0, 128, 129, 32768, 65535]])
    want = np.round(values / 257.0)
    from baker.io.images import decode_image

    grey = decode_image(png16(values), file="f", object="o")
    np.testing.assert_array_equal(grey[..., 0], want)
    colour = decode_image(png16(np.repeat(values[..., None], 3, axis=2)), file="f", object="o")
    # Pillow drops the low byte of colours, which is at most one level off.
    assert np.abs(colour[..., 1].astype(int) - want).max() <= 1


@pytest.mark.parametrize("kind", ["grey", "grey alpha", "palette", "palette with alpha", "bits"])
def test_png_kinds_give_rgba(tmp_path, kind):
    grey = np.uint8([[0, 100], [200, 255]])
    if kind == "grey":
        image, want = Image.fromarray(grey), [(100, 100, 100, 255), (200, 200, 200, 255)]
    elif kind == "grey alpha":
        image = Image.merge("LA", (Image.fromarray(grey), Image.fromarray(grey[::-1])))
        want = [(100, 100, 100, 255), (200, 200, 200, 0)]
    elif kind == "bits":
        image, want = Image.fromarray(grey > 150), [(0, 0, 0, 255), (255, 255, 255, 255)]
    else:
        image = Image.fromarray(np.uint8([[0, 1], [2, 0]])).convert("P")
        image.putpalette([9, 8, 7, 10, 20, 30, 40, 50, 60])
        want = [(10, 20, 30, 255), (40, 50, 60, 255 if kind == "palette" else 128)]
    more = {"transparency": bytes([255, 255, 128])} if kind == "palette with alpha" else {}
    found = image_of(tmp_path, encode(image, **more))
    assert [tuple(found[0, 1]), tuple(found[1, 0])] == want


def test_jpeg_of_four_inks_and_of_grey(tmp_path):
    ink = np.broadcast_to(np.uint8([255, 0, 0, 128]), (8, 8, 4))
    found = image_of(tmp_path, encode(Image.fromarray(ink, "CMYK"), "JPEG", quality=100))
    # Cyan absorbs red; half of the black ink halves green and blue.
    np.testing.assert_allclose(found[4, 4].astype(int), [0, 127, 127, 255], atol=2)
    found = image_of(tmp_path, encode(np.full((8, 8), 77, np.uint8), "JPEG", quality=100))
    np.testing.assert_allclose(found[4, 4].astype(int), [77, 77, 77, 255], atol=1)


def test_the_rotation_of_exif_data_is_ignored(tmp_path):
    exif = Image.Exif()
    exif[0x0112] = 6
    pixels = np.zeros((8, 16, 3), np.uint8)
    pixels[:, :8] = (255, 0, 0)
    found = image_of(tmp_path, encode(pixels, "JPEG", quality=95, exif=exif))
    assert found.shape == (8, 16, 4)
    assert found[4, 2, 0] > 200
    assert found[4, 13, 0] < 50


@pytest.mark.skipif(not features.check("avif"), reason="this Pillow cannot write AVIF")
def test_avif_through_its_extension(tmp_path):
    pixels = np.broadcast_to(np.uint8([200, 100, 50]), (16, 16, 3))
    builder = builder_of(
        [encode(pixels, "AVIF", quality=100), encode(PIXELS)],
        {"source": 1, "extensions": {"EXT_texture_avif": {"source": 0}}},
    )
    builder.json["extensionsUsed"] = builder.json["extensionsRequired"] = ["EXT_texture_avif"]
    found, codes = read(tmp_path, builder)
    np.testing.assert_allclose(found.image[8, 8].astype(int), [200, 100, 50, 255], atol=3)
    assert codes == []


@pytest.mark.parametrize("data", [ETC1S, UASTC], ids=["ETC1S", "UASTC"])
def test_basis_textures_are_transcoded(tmp_path, data):
    pytest.importorskip("opengl_basisu")
    builder = builder_of([base64.b64decode(data)], {"extensions": {"KHR_texture_basisu": {"source": 0}}})
    builder.json["extensionsUsed"] = builder.json["extensionsRequired"] = ["KHR_texture_basisu"]
    found, codes = read(tmp_path, builder)
    assert found.image.shape == (8, 8, 4)
    np.testing.assert_allclose(found.image[::7, ::7].astype(int), QUARTERS, atol=4)
    assert codes == []


def test_a_png_fallback_is_preferred_to_basis(tmp_path):
    texture = {"source": 1, "extensions": {"KHR_texture_basisu": {"source": 0}}}
    builder = builder_of([base64.b64decode(UASTC), encode(PIXELS)], texture)
    builder.json["extensionsUsed"] = ["KHR_texture_basisu"]
    found, codes = read(tmp_path, builder)
    np.testing.assert_array_equal(found.image, PIXELS)
    assert codes == []


def test_basis_without_its_package_says_what_to_install(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "opengl_basisu", None)
    builder = builder_of([base64.b64decode(UASTC)], {"extensions": {"KHR_texture_basisu": {"source": 0}}})
    with pytest.raises(InputError, match="pip install opengl-basisu") as error:
        read(tmp_path, builder)
    assert error.value.object == "images[0]"
    found, _ = read(tmp_path, builder, missing_textures="white")
    np.testing.assert_array_equal(found.image, [[[1, 1, 1, 1]]])


@pytest.mark.parametrize("length", [11, 60, 100, 200])
def test_a_basis_texture_that_is_cut_off_is_refused(tmp_path, length):
    pytest.importorskip("opengl_basisu")
    with pytest.raises(InputError, match=r"decoded|cut off"):
        image_of(tmp_path, base64.b64decode(UASTC)[:length])


def test_an_image_that_cannot_be_decoded_leaves_the_fallback(tmp_path):
    texture = {"source": 1, "extensions": {"EXT_texture_webp": {"source": 0}}}
    found, _ = read(tmp_path, builder_of([GONE, encode(PIXELS)], texture))
    np.testing.assert_array_equal(found.image, PIXELS)


@pytest.mark.parametrize(
    ("colour", "linear"),
    [("white", (1, 1, 1, 1)), ("grey", (0.5, 0.5, 0.5, 1)), ("magenta", (1, 0, 1, 1))],
)
@pytest.mark.parametrize("image", [GONE, b"no image"])
def test_a_colour_replaces_a_missing_base_colour(tmp_path, colour, linear, image):
    builder = builder_of([image], {"source": 0})
    with pytest.raises(InputError):
        read(tmp_path, builder)
    found, codes = read(tmp_path, builder, missing_textures=colour)
    np.testing.assert_array_equal(found.image, [[linear]])
    assert codes == ["missing-texture"]


@pytest.mark.parametrize("key", ["normalTexture", "occlusionTexture"])
def test_a_missing_texture_that_light_does_not_need_is_a_warning(tmp_path, key):
    for options in ({}, {"missing_textures": "magenta"}):
        found, codes = read(tmp_path, builder_of([GONE], {"source": 0}, key), **options)
        assert (found, codes) == (None, ["missing-texture"])


def test_a_missing_emission_is_replaced_only_if_the_material_emits(tmp_path):
    builder = builder_of([GONE], {"source": 0}, "emissiveTexture", emissiveFactor=[2, 2, 2])
    with pytest.raises(InputError, match=r"gone\.png"):
        read(tmp_path, builder)
    path = write(tmp_path / "a.glb", builder)
    scene = load_scene(path, options=ReadOptions(missing_textures="grey"))
    np.testing.assert_array_equal(scene.materials[0].emission_texture.image, [[[0.5, 0.5, 0.5, 1]]])
    _, codes = read(tmp_path, builder_of([GONE], {"source": 0}, "emissiveTexture"))
    assert codes == ["missing-texture"]
