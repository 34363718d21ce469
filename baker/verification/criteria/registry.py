"""Lists all criteria in the order of reports, with their default limits."""

from __future__ import annotations

from collections.abc import Iterable

from baker.verification.criteria.criterion import Criterion
from baker.verification.criteria.distortion import DISTORTION
from baker.verification.criteria.edges import EDGES
from baker.verification.criteria.levels import LIGHT_LEVELS
from baker.verification.criteria.objects import CHARTS, OBJECTS
from baker.verification.criteria.outliers import OUTLIERS
from baker.verification.criteria.overall import OVERALL
from baker.verification.criteria.regions import REGIONS
from baker.verification.criteria.unverified_area import UNVERIFIED_AREA

CRITERIA: tuple[Criterion, ...] = (
    OVERALL, LIGHT_LEVELS, REGIONS, OBJECTS, CHARTS, EDGES, OUTLIERS, DISTORTION, UNVERIFIED_AREA,
)  # fmt: skip
METRIC_NAMES = tuple(name for criterion in CRITERIA for name in criterion.metrics)


def default_limits(channels: Iterable[str]) -> str:
    """Return the default limits of channels as one text, in the format of the setting `fail_if`."""
    texts = [criterion.limits.get(name, "") for name in channels for criterion in CRITERIA]
    return ", ".join(text for text in texts if text)
