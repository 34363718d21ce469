"""Khronos' validator finds no new error in GLB files. OpenImageIO and exrheader read the images correctly."""

from __future__ import annotations

import json
import math
import subprocess
from pathlib import Path

import numpy as np
import pytest
from browser import need_modules, need_program
from engine_scenes import SIZE, probe_page, write_probe

import baker
from baker.core.export import EXPORTS

pytestmark = pytest.mark.engines
ASSETS = Path(__file__).parents[2] / "assets"
# Warnings about the Radiance pictures of lightmaps.glb, which only the extension MOZ_texture_rgbe allows.
FOREIGN = {(1, "IMAGE_UNRECOGNIZED_FORMAT"), (1, "VALUE_NOT_IN_LIST")}


def validate(path):
    """Return the sorted (severity, code) pairs of the validator's errors and warnings for a file."""
    script = Path(__file__).with_name("validate.mjs")
    done = subprocess.run(
        [need_program("node", "nodejs"), str(script), str(need_modules()), str(path)],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    report = json.loads(done.stdout)
    # Severity 0 is an error and 1 a warning; infos and hints are ignored.
    return sorted((m["severity"], m["code"]) for m in report["messages"] if m["severity"] <= 1)


@pytest.mark.parametrize("name", ["cornell.glb", "interior.glb"])
def test_baking_brings_no_new_error_into_a_glb(tmp_path, name):
    source = ASSETS / name
    out = tmp_path / "out"
    baker.bake(
        source, out=out, resolution=128, samples=1, export="gltf,unlit" if EXPORTS.get("unlit") else "gltf"
    )
    before = validate(source)
    for path in sorted(out.rglob("*.glb")):
        new = set(validate(path)) - set(before) - (FOREIGN if path.name == "lightmaps.glb" else set())
        assert not new, (path, new)


def test_every_glb_of_an_export_is_valid(probe):
    paths = sorted(probe.rglob("*.glb"))
    assert len(paths) > 2
    for path in paths:
        found = set(validate(path))
        assert found == (FOREIGN if path.name == "lightmaps.glb" else set()), path


def test_the_validator_finds_what_is_wrong(probe, tmp_path):
    data = (probe / "scene.glb").read_bytes()
    assert data.count(b'"TEXCOORD_1"') > 0
    # The new name has the same length, so that nothing else in the file becomes invalid.
    (tmp_path / "bad.glb").write_bytes(data.replace(b'"TEXCOORD_1"', b'"TEXCOORD_9"'))
    assert validate(tmp_path / "bad.glb")


ENCODED = "hdr,rgbm,png8,png16"


@pytest.fixture(scope="module", params=["half-zip", "half-piz", "float-zip", "float-piz"])
def encoded(request, tmp_path_factory):
    dtype, compression = request.param.split("-")
    folder = tmp_path_factory.mktemp("encoded")
    out = write_probe(folder, "gltf", dtype=dtype, exr_compression=compression, encode=ENCODED)
    return out, dtype, compression


def read(path):
    import OpenImageIO

    image = OpenImageIO.ImageInput.open(str(path))
    assert image, OpenImageIO.geterror()
    try:
        return image.read_image("float"), image.spec()
    finally:
        image.close()


def test_openimageio_reads_the_same_numbers(encoded):
    out, dtype, compression = encoded
    pixels, spec = read(out / "irradiance_0.exr")
    assert (spec.width, spec.height, list(spec.channelnames)) == (SIZE, SIZE, ["R", "G", "B"])
    assert str(spec.format) == dtype
    assert spec["compression"] == compression
    assert spec["unit"] == "lx"
    expected = probe_page().astype(np.float16 if dtype == "half" else np.float32)
    assert np.array_equal(pixels, expected.astype(np.float32))
    assert pixels[0, 0, 0] == pytest.approx(math.pi, rel=1e-3), "row 0 is v = 0"
    pixels, spec = read(out / "irradiance_0.hdr")
    assert (spec.width, spec.height, spec.nchannels) == (SIZE, SIZE, 3)
    assert pixels == pytest.approx(probe_page(), rel=1 / 256)


def test_openimageio_reads_the_png_files(encoded):
    out, _, _ = encoded
    code, spec = read(out / "irradiance_0.rgbm.png")
    assert (spec.nchannels, str(spec.format)) == (4, "uint8")
    top = float(spec["top"])
    # OpenImageIO returns the product of colour and alpha. The formula of RGBM contains this product.
    value = top * code[:, :, :3].astype(np.float64) ** 2.2
    assert value == pytest.approx(probe_page(), rel=0.02)
    for bits in (8, 16):
        share, spec = read(out / f"ao_0.{bits}bit.png")
        assert (spec.nchannels, str(spec.format)) == (1, f"uint{bits}")
        assert share == pytest.approx(0.5, abs=0.51 / (2**bits - 1))


def test_exrheader_says_what_the_file_is(encoded):
    out, dtype, compression = encoded
    program = need_program("exrheader", "openexr")
    text = subprocess.run(
        [program, str(out / "irradiance_0.exr")], capture_output=True, text=True, check=True
    ).stdout
    kind = {"half": "16-bit floating-point", "float": "32-bit floating-point"}[dtype]
    for channel in "RGB":
        assert f"{channel}, {kind}" in text, text
    assert f"compression (type compression): {compression}" in text, text
    assert 'type (type string): "scanlineimage"' in text
    assert "chromaticities" in text
    assert "increasing y" in text
