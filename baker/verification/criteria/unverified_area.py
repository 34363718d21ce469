"""Computes the area of the surface that is not compared, too noisy, in narrow gaps, or tilted."""

from __future__ import annotations

import numpy as np

from baker.verification.criteria.criterion import ChannelData, Criterion, CriterionResult

# Standard error of the reference above which a texel counts as unresolved: relative to its light for
# irradiance (where a larger setting `target_se` replaces it), absolute for AO.
NOISY = 0.1


def evaluate(data: ChannelData) -> CriterionResult:
    """Compute areas in m2, and their shares of the whole or of the compared surface."""
    points, area = data.points, data.unverified
    mine = data.texels
    total = max(area.total, 1e-30)
    texel_area = points.texel_area[mine]
    compared = float(texel_area.sum())
    noisy = float(texel_area[data.noisy[mine]].sum())
    gap = float(texel_area[points.gap[mine]].sum())
    tilted = float(texel_area[data.tilted[mine]].sum())
    metrics = {
        "area": total,
        "invalid_area": area.invalid,
        "invalid_share": area.invalid / total,
        "visible_invalid_share": area.visible / total,
        "uncovered_area": area.uncovered,
        "uncovered_share": area.uncovered / total,
        "unresolved_area": noisy,
        "unresolved_share": noisy / max(compared, 1e-30),
        "gap_area": gap,
        "gap_share": gap / max(compared, 1e-30),
        "tilted_area": tilted,
        "tilted_share": tilted / max(compared, 1e-30),
    }
    remarks = {
        "gap_share": f"{gap:.3g} m2 of {compared:.3g} lie in gaps of two texels, or inside of solids",
        "invalid_share": f"{area.invalid:.3g} m2 of {total:.3g} hold no light of their own (invalid texels)",
        "visible_invalid_share": f"{area.visible:.3g} m2 of invalid texels can be seen",
        "uncovered_share": f"{area.uncovered:.3g} m2 of {total:.3g} lie on texels without a measured value",
        "unresolved_share": (
            f"the reference of {data.channel} stayed too noisy to compare {noisy:.3g} m2 of {compared:.3g};"
            " raise `time_limit`"
        ),
    }
    return CriterionResult(
        metrics, {name: text for name, text in remarks.items() if np.isfinite(metrics[name])}
    )


UNVERIFIED_AREA = Criterion(
    "unverified area",
    (
        "area", "invalid_area", "invalid_share", "visible_invalid_share", "uncovered_area", "uncovered_share",
        "unresolved_area", "unresolved_share", "gap_area", "gap_share",
        "tilted_area", "tilted_share",
    ),
    {
        "irradiance": "irradiance.invalid_share > 0.25, irradiance.visible_invalid_share > 0.01,"
        " irradiance.uncovered_share > 0.02, irradiance.unresolved_share > 0.6, irradiance.gap_share > 0.3",
        "ao": "ao.unresolved_share > 0.2",
    },
    evaluate,
)  # fmt: skip
