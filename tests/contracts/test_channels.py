"""What every channel promises: its layers, their shapes, its words."""

from __future__ import annotations

import numpy as np
import pytest

from baker.channels.channel import CHANNELS, Transport
from baker.radiosity.direct import DirectLight
from baker.radiosity.final_gather import Gathered

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
        open=opened,
        ao_samples=64,
    )


def needed(channel, transport):
    """Leave out what the channel does not ask for: it must not be read."""
    return Transport(
        direct=transport.direct if channel.needs_light else None,
        gathered=transport.gathered if channel.needs_light else None,
        open=transport.open if channel.needs_open else None,
        ao_samples=transport.ao_samples if channel.needs_open else 0,
    )


def test_the_channels_of_the_contract_are_there():
    assert {"irradiance", "ao"} <= set(CHANNELS.names())


@pytest.mark.parametrize("name", CHANNELS.names())
def test_layers_fit_the_channel(name, transport):
    channel = CHANNELS.get(name)
    assert channel.needs_light or channel.needs_open
    assert channel.components in (1, 3)
    assert channel.unit
    assert channel.quantity
    assert channel.upper > 0
    layers = channel.layers(needed(channel, transport))
    assert layers
    for layer in layers:
        assert layer.value.shape == (N_FRONT, channel.components)
        assert layer.value.dtype == np.float32
        assert layer.error.shape == (N_FRONT,)
        assert layer.error.dtype == np.float32
        assert (layer.error >= 0).all()
        assert np.isfinite(layer.error).all()
        assert (layer.value <= channel.upper).all()


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
    np.testing.assert_array_equal(layer.value[:, 0], transport.open)
    binomial = np.sqrt(transport.open * (1 - transport.open) / 64)
    # Near the binomial error where that is large, and never nothing.
    large = binomial > 0.05
    assert large.sum() > 10
    np.testing.assert_allclose(layer.error[large], binomial[large], rtol=0.05)
    assert (layer.error > 0).all()
    assert (layer.error[:2] < 0.02).all()
