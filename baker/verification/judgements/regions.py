"""Regions: the texels of a room, and among them those of like light, each judged against its own light."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from baker.metrics.sample_texels import LEVELS, light_level
from baker.verification.judgements.groups import make_groups, worst_figures
from baker.verification.judgements.judgement import Evidence, Judged, Judgement
from baker.verification.judgements.levels import level_light

# Of `level_light`: what single texels of a sound map are off by, as a bias is looked for here, not noise.
_KNOWN = 0.03
_NAMED = 3


def judge(evidence: Evidence) -> Judged:
    """Return the figures of the worst region, and of all."""
    points, compared = evidence.points, evidence.compared
    mine = evidence.texels & evidence.whole
    level = light_level(level_light(compared, _KNOWN))
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
    groups = make_groups(evidence, members)
    # What cannot be seen from anywhere is told, but not held against limits.
    in_rooms = [group for group in groups if keys[group.name][0] >= 0]
    worst, remarks = worst_figures("region", in_rooms, evidence.channel)
    position = points.position + evidence.geometry.origin
    rows = []
    for group in groups:
        room, light = keys[group.name]
        owner, count = np.unique(points.owner[group.member], return_counts=True)
        named = owner[np.argsort(-count, kind="stable")[:_NAMED]]
        rows.append(
            {
                "region": group.name,
                "channel": evidence.channel,
                "room": room,
                "level": light,
                "area": float(points.stands_for[group.member].sum()),
                "position": position[group.member].mean(axis=0).tolist(),
                "objects": [evidence.bake.scene.instances[int(i)].name for i in named],
                **group.found.as_json(),
                "deviation": group.badness,
            }
        )
    return Judged(worst, remarks, rows)


REGIONS = Judgement(
    "regions",
    ("region_bias", "region_colour", "region_noise"),
    {
        "irradiance": "irradiance.region_bias > 0.025, irradiance.region_colour > 0.01,"
        " irradiance.region_noise > 0.1",
        "ao": "ao.region_bias > 0.02, ao.region_noise > 0.06",
    },
    judge,
)
