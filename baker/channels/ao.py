"""The channel `ao`: the cosine-weighted share of the hemisphere without a hit within a distance r.

    AO = 1/pi integral over the hemisphere of V(w, r) cos(theta) dw

V(w, r) is 1 if nothing is hit in direction w within r, else 0. AO is 1 if unoccluded, 0 if fully occluded.
"""

from __future__ import annotations

import numpy as np

from baker.channels.channel import CHANNELS, Channel, Layer, Transport


def ao_layers(transport: Transport) -> tuple[Layer, ...]:
    """Return ambient occlusion as a single layer, with the standard error of a binomial distribution."""
    share = transport.ambient_occlusion
    if share is None:
        raise ValueError("the ao channel needs ambient occlusion")
    # Compute the binomial standard error. Because rays are stratified, it is an upper bound, measured as 2 to
    # 5 times the true error. Half a ray is added to the hits and to the misses, so that the error is never 0.
    n = np.maximum(transport.ao_samples, 1)
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
