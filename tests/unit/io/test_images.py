"""Images are decoded in strips of rows, and images above `LARGEST_IMAGE_SIDE` are reduced by averaging."""

from __future__ import annotations

import io

import numpy as np
import pytest
from PIL import Image

from baker.core.colour import linear_from_srgb
from baker.io import images
from baker.io.images import decode_image

MODES = ("1", "L", "LA", "P", "RGB", "RGBA", "CMYK", "I;16")


def encoded(image: Image.Image, kind: str) -> bytes:
    stream = io.BytesIO()
    image.save(stream, kind)
    return stream.getvalue()


@pytest.mark.parametrize("mode", MODES)
def test_strips_give_the_pixels_of_the_whole_image(mode, monkeypatch):
    rng = np.random.default_rng(3)
    if mode == "I;16":
        source = Image.fromarray(rng.integers(0, 65536, (37, 5)).astype(np.uint16))
    else:
        source = Image.fromarray(rng.integers(0, 256, (37, 5, 4)).astype(np.uint8)).convert(mode)
    data = encoded(source, "TIFF" if mode == "CMYK" else "PNG")
    whole = decode_image(data, file="f", object="o")
    monkeypatch.setattr(images, "_STRIP", 4)
    assert np.array_equal(decode_image(data, file="f", object="o"), whole)
    assert whole.shape == (37, 5, 4)
    if mode != "I;16":
        assert np.array_equal(whole, np.array(Image.open(io.BytesIO(data)).convert("RGBA")))


@pytest.mark.parametrize("shape", [(12, 9), (7, 12)])
def test_large_images_are_averaged_in_linear_light(shape, monkeypatch):
    monkeypatch.setattr(images, "LARGEST_IMAGE_SIDE", 8)
    monkeypatch.setattr(images, "_STRIP", 4)
    rng = np.random.default_rng(4)
    pixels = rng.integers(0, 256, (*shape, 4)).astype(np.uint8)
    found = decode_image(encoded(Image.fromarray(pixels), "PNG"), file="f", object="o")
    h, w = shape[0] // 2, shape[1] // 2
    assert found.shape == (h, w, 4)
    blocks = pixels[: 2 * h, : 2 * w].reshape(h, 2, w, 2, 4)
    light = linear_from_srgb(blocks[..., :3] / 255.0).mean(axis=(1, 3))
    # The average is rounded to 8 bits, so its error is at most half a level.
    low, high = (linear_from_srgb(np.clip(found[..., :3] + d, 0, 255) / 255.0) for d in (-0.51, 0.51))
    assert ((low <= light) & (light <= high)).all()
    alpha = blocks[..., 3].mean(axis=(1, 3))
    assert np.abs(found[..., 3] - alpha).max() <= 0.5


def test_an_image_at_the_limit_keeps_its_texels(monkeypatch):
    monkeypatch.setattr(images, "LARGEST_IMAGE_SIDE", 8)
    pixels = np.random.default_rng(5).integers(0, 256, (8, 3, 4)).astype(np.uint8)
    found = decode_image(encoded(Image.fromarray(pixels), "PNG"), file="f", object="o")
    assert np.array_equal(found, pixels)
    line = decode_image(encoded(Image.fromarray(pixels.reshape(1, 24, 4)), "PNG"), file="f", object="o")
    assert line.shape == (1, 24, 4)
