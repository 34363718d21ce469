"""Computes bias, colour shift and own error of each region, as `baker.metrics.groups` defines them.

A region is a room, or the texels of a room in one light level. The texels of no room form one more room.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from baker.metrics.sample_texels import LEVELS, light_level
from baker.verification.criteria.criterion import ChannelData, Criterion, CriterionResult
from baker.verification.criteria.groups import make_groups, worst_metrics
from baker.verification.criteria.levels import level_light

# Relative standard error of the reference at which `level_light` gives reference and map the same weight. It
# is about the relative error of single texels in a correct map.
_EQUAL_WEIGHT = 0.03
# Largest number of objects that are listed for a region.
_LISTED = 3


def evaluate(data: ChannelData) -> CriterionResult:
    """Compute the largest bias, colour shift and own error of regions in rooms, and a table of regions."""
    points, compared = data.points, data.compared
    mine = data.texels & data.interior
    level = light_level(level_light(compared, _EQUAL_WEIGHT))
    members: list[tuple[str, NDArray[np.int64]]] = []
    keys: dict[str, tuple[int, list[float] | None]] = {}
    for room in np.unique(points.room[mine]):
        inside = mine & (points.room == room)
        whole = f"room {room}" if room >= 0 else "hidden places"
        members.append((whole, np.flatnonzero(inside)))
        keys[whole] = int(room), None
        levels = np.unique(level[inside])
        for number in levels if len(levels) > 1 else ():
            low, high = (float(10.0 ** ((number + end) / LEVELS)) for end in (0, 1))
            name = f"{whole}, light {low:.3g} to {high:.3g}"
            members.append((name, np.flatnonzero(inside & (level == number))))
            keys[name] = int(room), [low, high]
    groups = make_groups(data, members)
    # Leave the texels of no room (room -1) out of the metrics. The table includes them.
    in_rooms = [group for group in groups if keys[group.name][0] >= 0]
    worst, remarks = worst_metrics("region", in_rooms, data.channel)
    position = points.position + data.geometry.origin
    rows = []
    for group in groups:
        room, light = keys[group.name]
        owner, count = np.unique(points.owner[group.member], return_counts=True)
        listed = owner[np.argsort(-count, kind="stable")[:_LISTED]]
        rows.append(
            {
                "region": group.name,
                "channel": data.channel,
                "room": room,
                "level": light,
                "area": float(points.texel_area[group.member].sum()),
                "position": position[group.member].mean(axis=0).tolist(),
                "objects": [data.bake.scene.instances[int(i)].name for i in listed],
                **group.found.as_json(),
                "deviation": group.badness,
            }
        )
    return CriterionResult(worst, remarks, rows)


REGIONS = Criterion(
    "regions",
    ("region_bias", "region_colour", "region_noise"),
    {
        "irradiance": "irradiance.region_bias > 0.025, irradiance.region_colour > 0.01,"
        " irradiance.region_noise > 0.1",
        "ao": "ao.region_bias > 0.02, ao.region_noise > 0.06",
    },
    evaluate,
)
