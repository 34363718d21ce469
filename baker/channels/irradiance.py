"""Irradiance: all light that arrives at the surface, direct and indirect, in lux.

E = E_direct + E_sky + E_indirect        (without the receiver's own albedo)
"""

from __future__ import annotations

import numpy as np

from baker.channels.channel import CHANNELS, Channel, Layer, Transport


def irradiance_layers(transport: Transport) -> tuple[Layer, ...]:
    """Return sampled lights and gathered light as two layers: sharp shadows apart from soft light."""
    direct, gathered = transport.direct, transport.gathered
    if direct is None or gathered is None:
        raise ValueError("the irradiance channel needs direct and gathered light")
    n_front = len(gathered.indirect)
    return (
        Layer(direct.weighted[:n_front], np.sqrt(direct.variance[:n_front])),
        Layer(gathered.indirect + gathered.direct, np.sqrt(gathered.variance)),
    )


CHANNELS.register("irradiance")(
    Channel(
        unit="lx",
        quantity="irradiance",
        components=3,
        upper=float("inf"),
        needs_light=True,
        needs_open=False,
        layers=irradiance_layers,
    )
)
