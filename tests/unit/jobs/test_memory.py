"""Memory sizes are parsed, and the memory estimate depends on settings and scene as expected."""

from __future__ import annotations

import numpy as np
import pytest
from gltf_builder import quad_builder, write

from baker.core.errors import SettingsError
from baker.core.settings import make_settings
from baker.jobs.memory import estimate_peak, parse_size, size_words


@pytest.mark.parametrize(
    ("text", "size"),
    [
        ("8G", 8 * 2**30),
        ("512M", 2**29),
        ("1.5gib", 3 * 2**29),
        ("100", 100),
        ("2 GB", 2**31),
        ("64k", 2**16),
    ],
)
def test_sizes(text, size):
    assert parse_size(text) == size
    assert parse_size(size_words(size)) == size


@pytest.mark.parametrize("text", ["", "much", "-1G", "0", "8X", "G"])
def test_no_sizes(text):
    with pytest.raises(SettingsError, match="no size"):
        parse_size(text)


def test_the_estimate_follows_pages_samples_and_channels(tmp_path):
    scene = write(tmp_path / "a.glb", quad_builder())

    def peak(**settings):
        return estimate_peak(scene, make_settings(settings))

    small = peak(resolution=64)
    assert small < peak(resolution=1024) < peak(resolution=2048)
    plain = {"channels": "ao", "denoise": False}
    assert peak(resolution=1024, **plain) < peak(resolution=1024, denoise=False) < peak(resolution=1024)
    assert peak(resolution=1024, denoise=False) < peak(resolution=1024, denoise=False, samples=512)
    # A unit square at 100 texels per metre has 10 000 texels. A page of 64 x 64 is estimated to be 80 % full.
    many = peak(resolution=64, density=100, **plain) - peak(resolution=64, **plain)
    one = peak(resolution=128, **plain) - peak(resolution=64, **plain)
    filled = 0.8 * 64**2
    assert many == pytest.approx(one * (10000 - filled) / (3 * filled), rel=1e-3)
    assert peak(resolution=64, density=100, max_pages=1) == small


def test_images_and_triangles_count(tmp_path):
    rng = np.random.default_rng(0)
    from baker.io.png import encode_png

    builder = quad_builder(pbrMetallicRoughness={"baseColorTexture": {"index": 0}})
    builder.image(encode_png(rng.integers(0, 255, (64, 64, 3), np.uint8)))
    plain, textured = write(tmp_path / "a.glb", quad_builder()), write(tmp_path / "b.glb", builder)
    settings = make_settings({"resolution": 64})
    assert estimate_peak(textured, settings) - estimate_peak(plain, settings) == 3.5 * 64 * 64 * 4
