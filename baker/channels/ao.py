"""Ambient occlusion: the cosine-weighted share of the hemisphere that is open within a distance.

AO = 1/pi integral over the hemisphere of V(w, r) cos(theta) dw        1 = open, 0 = closed
"""

from __future__ import annotations

import numpy as np

from baker.channels.channel import CHANNELS, Channel, Layer, Transport


def ao_layers(transport: Transport) -> tuple[Layer, ...]:
    """Return the open share as one layer."""
    if transport.open is None:
        raise ValueError("the ao channel needs the open share")
    share = transport.open.astype(np.float64)
    # Rays are stratified: the binomial error is an upper bound, 2 to 5 times the real one as measured.
    # One ray more keeps it above zero at 0 and 1.
    n = max(transport.ao_samples, 1)
    bounded = (share * n + 0.5) / (n + 1.0)
    error = np.sqrt(bounded * (1.0 - bounded) / n).astype(np.float32)
    return (Layer(transport.open[:, None], error, bound=True),)


CHANNELS.register("ao")(
    Channel(
        unit="1",
        quantity="ambient occlusion (open share)",
        components=1,
        upper=1.0,
        needs_light=False,
        needs_open=True,
        layers=ao_layers,
    )
)
