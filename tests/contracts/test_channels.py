"""Contract of every channel: the shapes of its layers, and its unit, quantity and definition."""

from __future__ import annotations

import runpy
from dataclasses import replace
from pathlib import Path

import jsonschema
import numpy as np
import pytest

from baker.channels.channel import CHANNELS, Transport
from baker.core.errors import SettingsError
from baker.core.lightmap import ChannelDescription, TexelStatus
from baker.core.settings import make_settings
from baker.encodings.exr import MAX_COMPONENTS, decode_exr
from baker.finish.finish import ComponentRules, PageLayer, PagePlan, finish_page, open_finisher
from baker.io.bake.manifest import manifest_schema
from baker.io.bake.read_bake import read_bake
from baker.io.bake.write_bake import check_encodings
from baker.io.inspect import inspect_path
from baker.pipeline.bake import bake
from baker.radiosity.direct import DirectLight
from baker.radiosity.final_gather import Gathered

ROOT = Path(__file__).parents[2]
N_FRONT, N = 50, 64


@pytest.fixture
def transport():
    rng = np.random.default_rng(0)
    opened = rng.random(N_FRONT, np.float32)
    opened[:2] = [0, 1]
    return Transport(
        direct=DirectLight(
            rng.random((N, 3), np.float32),
            rng.random((N, 3), np.float32),
            rng.random(N, np.float32),
            np.zeros(N, np.uint8),
            1,
        ),
        gathered=Gathered(
            rng.random((N_FRONT, 3), np.float32),
            rng.random((N_FRONT, 3), np.float32),
            opened,
            rng.random(N_FRONT, np.float32),
            1,
        ),
        ambient_occlusion=opened,
        ao_samples=64,
    )


def needed(channel, transport):
    """Return the `Transport` with only those results that the channel declares as needed."""
    return Transport(
        direct=transport.direct if channel.needs_light else None,
        gathered=transport.gathered if channel.needs_light else None,
        ambient_occlusion=transport.ambient_occlusion if channel.needs_ambient_occlusion else None,
        ao_samples=transport.ao_samples if channel.needs_ambient_occlusion else 0,
    )


def test_the_channels_of_the_contract_are_there():
    assert {"irradiance", "ao"} <= set(CHANNELS.names())


@pytest.mark.parametrize("name", CHANNELS.names())
def test_layers_fit_the_channel(name, transport):
    channel = CHANNELS.get(name)
    assert channel.needs_light or channel.needs_ambient_occlusion
    n = len(channel.components)
    assert 1 <= n <= MAX_COMPONENTS
    assert len(set(channel.components)) == n
    assert channel.lower < channel.upper
    assert channel.unit
    assert channel.quantity
    assert channel.definition
    assert channel.upper > 0
    layers = channel.layers(needed(channel, transport))
    assert layers
    for layer in layers:
        assert layer.value.shape == (N_FRONT, n)
        assert layer.value.dtype == np.float32
        assert layer.error.shape in ((N_FRONT,), (N_FRONT, len(channel.groups)))
        assert layer.error.dtype == np.float32
        assert (layer.error >= 0).all()
        assert np.isfinite(layer.error).all()
        assert (layer.value <= channel.upper).all()
        assert (layer.value >= channel.lower).all()


@pytest.mark.parametrize("name", CHANNELS.names())
def test_what_is_missing_is_said(name):
    with pytest.raises(ValueError, match=f"the {name} channel needs"):
        CHANNELS.get(name).layers(Transport())


def test_irradiance_is_the_sum_of_all_light(transport):
    layers = CHANNELS.get("irradiance").layers(transport)
    total = sum(layer.value for layer in layers)
    direct, gathered = transport.direct, transport.gathered
    np.testing.assert_allclose(
        total, direct.weighted[:N_FRONT] + gathered.indirect + gathered.direct, rtol=1e-6
    )
    error = np.sqrt(sum(layer.error**2 for layer in layers))
    np.testing.assert_allclose(error, np.sqrt(direct.variance[:N_FRONT] + gathered.variance), rtol=1e-5)


def test_ao_is_the_unoccluded_share_with_a_binomial_error(transport):
    (layer,) = CHANNELS.get("ao").layers(transport)
    np.testing.assert_array_equal(layer.value[:, 0], transport.ambient_occlusion)
    binomial = np.sqrt(transport.ambient_occlusion * (1 - transport.ambient_occlusion) / 64)
    # If the binomial standard error is above 0.05, the standard error of the layer equals it within 5 %. For
    # an AO of 0 or 1, the binomial error is 0, but the error of the layer is above 0.
    large = binomial > 0.05
    assert large.sum() > 10
    np.testing.assert_allclose(layer.error[large], binomial[large], rtol=0.05)
    assert (layer.error > 0).all()
    assert (layer.error[:2] < 0.02).all()


TOY = '''
"""A channel of four signed components, two of them the negative of others."""

import numpy as np

from baker.channels.channel import CHANNELS, Channel, Layer


def toy_layers(transport):
    ao, light = transport.ambient_occlusion, transport.gathered.indirect
    value = np.stack([ao - 0.5, 0.5 - ao, light[:, 0] - light[:, 1], light[:, 1] - light[:, 0]], axis=1)
    error = np.repeat(np.float32([[0.1, 0.1, 0.02, 0.02]]), len(value), axis=0)
    return (Layer(value.astype(np.float32), error),)


CHANNELS.register("toy")(
    Channel(
        unit="1",
        quantity="differences",
        definition="AO - 1/2, 1/2 - AO, E_R - E_G, E_G - E_R",
        components=("open", "closed", "colour.red", "colour.green"),
        signed=True,
        lower=-float("inf"),
        needs_light=True,
        needs_ambient_occlusion=True,
        layers=toy_layers,
    )
)
'''


@pytest.fixture
def toy(tmp_path, monkeypatch):
    """Register the channel `toy` from one file, for one test."""
    CHANNELS.names()
    monkeypatch.setattr(CHANNELS, "_plugins", dict(CHANNELS._plugins))
    (tmp_path / "toy.py").write_text(TOY)
    runpy.run_path(str(tmp_path / "toy.py"))
    return CHANNELS.get("toy")


@pytest.mark.parametrize("denoise", [True, False])
def test_a_signed_channel_of_four_components_is_one_file(toy, denoise, tmp_path):
    settings = {"channels": "irradiance,toy", "resolution": 48, "samples": 16, "denoise": denoise}
    out = tmp_path / "out"
    result = bake(ROOT / "assets" / "cornell.glb", settings=make_settings(settings), out=out)
    value = result.lightmaps["toy"].value
    covered = np.isin(result.status, (TexelStatus.COVERED, TexelStatus.UNCONVERGED))
    assert value.shape == (1, 48, 48, 4)
    # Values of both signs are stored. Components 1 and 3 are the negatives of components 0 and 2, except at
    # chart borders. There, the extrapolation to texel centres keeps positive values positive, but not
    # negative values negative.
    assert value[covered].min() < -0.2
    assert value[covered].max() > 0.2
    for one, other in ((0, 1), (2, 3)):
        size = np.abs(value[..., one]).max()
        assert np.abs(value[covered][:, one] + value[covered][:, other]).mean() < 0.03 * size
        assert np.corrcoef(value[covered][:, one], value[covered][:, other])[0, 1] < -0.98

    stored = read_bake(out)
    tolerance = np.maximum(np.abs(value) * 2.0**-11, 2.0**-25)
    assert (np.abs(stored.maps["toy"] - value) <= tolerance).all()
    assert stored.manifest["channels"]["toy"] == {
        "unit": "1",
        "quantity": "differences",
        "components": ["open", "closed", "colour.red", "colour.green"],
        "signed": True,
        "definition": "AO - 1/2, 1/2 - AO, E_R - E_G, E_G - E_R",
    }
    jsonschema.validate(stored.manifest, manifest_schema())
    assert stored.manifest["statistics"]["toy"]["min"] < 0
    assert set(decode_exr(out / "toy_0.exr").channels) == set(toy.components)

    assert inspect_path(out)["channels"]["toy"]["components"] == list(toy.components)
    planes = {row["channel"]: row for row in inspect_path(out / "toy_0.exr")["channels"]}
    assert planes["open"]["min"] < 0 < planes["open"]["max"]


def test_denoising_a_signed_channel_lowers_its_noise(toy):
    truth = np.sin(np.linspace(0.0, 6.0, 96))[:, None] * np.cos(np.linspace(0.0, 4.0, 96))[None, :]
    truth = np.stack([truth, -truth], axis=2)
    noisy = (truth + np.random.default_rng(3).normal(0.0, 0.15, truth.shape)).astype(np.float32)
    error = np.full(truth.shape, 0.15, np.float32)
    chart = np.zeros(truth.shape[:2], np.int32)
    plan = PagePlan(chart, chart >= 0, np.zeros(truth.shape, np.float32))
    rules = ComponentRules(-np.inf, np.inf, (slice(0, 1), slice(1, 2)))
    with open_finisher(threads=1, dilation=0, denoise=True) as finisher:
        clean, _ = finish_page(plan, [PageLayer(noisy, error)], rules, finisher)
    assert np.sqrt(np.mean((clean - truth) ** 2)) < 0.35 * np.sqrt(np.mean((noisy - truth) ** 2))
    assert np.abs(np.mean(clean - truth, axis=(0, 1))).max() < 0.02


def test_an_encoding_refuses_a_channel_that_it_cannot_hold(toy):
    settings = make_settings({"channels": "toy", "encode": "rgbm"})
    with pytest.raises(SettingsError) as caught:
        bake(ROOT / "assets" / "cornell.glb", settings=settings, out="unused")
    assert caught.value.message == (
        "'rgbm' can hold none of the channels that are baked "
        "(toy: holds maps of three component(s), not of 4); use the EXR"
    )
    signed = {"normal": replace(CHANNELS.get("irradiance"), signed=True, lower=-1.0)}
    with pytest.raises(SettingsError, match="normal: holds no negative numbers"):
        check_encodings(("rgbm",), signed)


def test_components_of_one_colour_are_denoised_together():
    def groups(*names, signed=False):
        return [
            (part.start, part.stop) for part in ChannelDescription("1", "q", "d", names, signed=signed).groups
        ]

    assert groups("Y") == [(0, 1)]
    assert groups("R", "G", "B") == [(0, 3)]
    assert groups("R", "G", "B", signed=True) == [(0, 1), (1, 2), (2, 3)]
    assert groups("L0.R", "L0.G", "L0.B", "W") == [(0, 3), (3, 4)]
    assert groups("L0.R", "L1.G", "L0.B", "R", "G") == [(k, k + 1) for k in range(5)]
