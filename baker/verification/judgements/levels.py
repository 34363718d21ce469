"""Light levels of the whole scene: how far values are spread about the truth, in the dark as in the light.

Texels of all rooms are taken by half powers of ten of their light; and the darkest of them once more, by
share: what is wrong in the darkest tenth of a scene alone must not hide among texels that are brighter.
Narrower levels than that would be no use: whoever is sorted by values that are wrong is found among those
that are wrong alike.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from baker.metrics.groups import Compared
from baker.metrics.sample_texels import light_level
from baker.verification.judgements.groups import make_groups, worst_figures
from baker.verification.judgements.judgement import Evidence, Judged, Judgement

_DARKEST = (0.05, 0.1, 0.2)
# A reference with this relative standard error tells a texel's level as well as a map that is to be caught.
KNOWN = 0.15


def level_light(compared: Compared, known: float) -> NDArray[np.float64]:
    """Return by what light (n,) places are ordered.

    That of the reference where it is known well, of the map where it is not: whichever is taken, places that
    its error brings over the end of a level gather at one side of the truth. Both count alike where the
    relative standard error of the reference is `known`, about what the map may be wrong by.
    """
    value, reference = compared.value.mean(axis=1), compared.reference.mean(axis=1)
    noise = np.where(np.isfinite(compared.spread), compared.spread, 0.0).mean(axis=1)
    variance = (noise / np.maximum(reference, 1e-30)) ** 2
    weight = variance / (variance + known**2)
    return np.asarray(weight * value + (1.0 - weight) * reference, np.float64)


def _span(light: NDArray[np.float64]) -> str:
    return f"light {light.min():.4g} to {light.max():.4g} in all rooms"


def judge(evidence: Evidence) -> Judged:
    """Return the own error of the worst level, and of all, brightest last."""
    points = evidence.points
    mine = np.flatnonzero((evidence.texels | evidence.scarce) & evidence.whole & (points.room >= 0))
    light = level_light(evidence.compared.of(mine), KNOWN)
    order = np.argsort(light, kind="stable")
    level = light_level(light)[order]
    members: list[tuple[str, NDArray[np.int64]]] = []
    for number in np.unique(level):
        same = order[level == number]
        members.append((_span(light[same]), mine[same]))
    for share in _DARKEST:
        darkest = order[: int(share * len(order))]
        if len(darkest):
            members.append((f"the darkest {share:.0%}, {_span(light[darkest])}", mine[darkest]))
    groups = make_groups(evidence, members)
    worst, remarks = worst_figures("level", groups, evidence.channel)
    rows: list[dict[str, Any]] = [
        {"level": group.name, "channel": evidence.channel, **group.found.as_json()}
        for group in sorted(groups, key=lambda group: group.found.light)
    ]
    return Judged({"level_noise": worst["level_noise"]}, remarks, rows)


LIGHT_LEVELS = Judgement(
    "levels",
    ("level_noise",),
    {"irradiance": "irradiance.level_noise > 0.07", "ao": "ao.level_noise > 0.06"},
    judge,
)
