"""All judgements, in the order of reports, and the limits that they bring."""

from __future__ import annotations

from collections.abc import Iterable

from baker.verification.judgements.distortion import DISTORTION
from baker.verification.judgements.edges import EDGES
from baker.verification.judgements.judgement import Judgement
from baker.verification.judgements.levels import LIGHT_LEVELS
from baker.verification.judgements.objects import CHARTS, OBJECTS
from baker.verification.judgements.overall import OVERALL
from baker.verification.judgements.regions import REGIONS
from baker.verification.judgements.suspects import SUSPECTS
from baker.verification.judgements.unjudged import UNJUDGED

JUDGEMENTS: tuple[Judgement, ...] = (
    OVERALL, LIGHT_LEVELS, REGIONS, OBJECTS, CHARTS, EDGES, SUSPECTS, DISTORTION, UNJUDGED,
)  # fmt: skip
FIGURE_NAMES = tuple(name for judgement in JUDGEMENTS for name in judgement.figures)


def default_limits(channels: Iterable[str]) -> str:
    """Return the limits that a bake is held against unless others are given, as `fail_if` takes them."""
    texts = [judgement.limits.get(name, "") for name in channels for judgement in JUDGEMENTS]
    return ", ".join(text for text in texts if text)
