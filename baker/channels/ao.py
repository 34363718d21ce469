"""Ambient occlusion: the cosine-weighted share of the hemisphere without a hit within a distance.

AO = 1/pi integral over the hemisphere of V(w, r) cos(theta) dw        1 = open, 0 = closed
"""

from __future__ import annotations

import numpy as np

from baker.channels.channel import CHANNELS, Channel, Layer, Transport


def ao_layers(transport: Transport) -> tuple[Layer, ...]:
    """Return ambient occlusion as one layer with a binomial error."""
    share = transport.ambient_occlusion
    if share is None:
        raise ValueError("the ao channel needs ambient occlusion")
    # Rays are stratified: the binomial error is an upper bound, measured as 2 to 5 times the real one. Half a
    # ray is added to hits and misses, so that it stays above 0 at 0 and 1.
    n = max(transport.ao_samples, 1)
    bounded = (share.astype(np.float64) * n + 0.5) / (n + 1.0)
    error = np.sqrt(bounded * (1.0 - bounded) / n).astype(np.float32)
    return (Layer(share[:, None], error, bound=True),)


CHANNELS.register("ao")(
    Channel(
        unit="1",
        quantity="ambient occlusion: cosine-weighted open share of the hemisphere, 1 = open",
        definition="AO = 1/pi integral over the hemisphere of V(w, r) cos(theta) dw",
        components=("Y",),
        upper=1.0,
        needs_ambient_occlusion=True,
        layers=ao_layers,
    )
)
