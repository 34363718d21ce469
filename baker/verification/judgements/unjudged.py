"""How much of the surface was not judged, or hardly, by area."""

from __future__ import annotations

import numpy as np

from baker.verification.judgements.judgement import Evidence, Judged, Judgement

# A texel whose reference is noisier than this, or than asked for, was hardly judged.
NOISY = 0.1


def judge(evidence: Evidence) -> Judged:
    """Return areas and their shares."""
    points, area = evidence.points, evidence.unjudged
    mine = evidence.texels
    total = max(area.total, 1e-30)
    stands_for = points.stands_for[mine]
    judged = float(stands_for.sum())
    noisy = float(stands_for[evidence.noisy[mine]].sum())
    gap = float(stands_for[points.gap[mine]].sum())
    tilted = float(stands_for[evidence.tilted[mine]].sum())
    figures = {
        "area": total,
        "invalid_area": area.invalid,
        "invalid_share": area.invalid / total,
        "visible_invalid_share": area.visible / total,
        "uncovered_area": area.uncovered,
        "uncovered_share": area.uncovered / total,
        "unresolved_area": noisy,
        "unresolved_share": noisy / max(judged, 1e-30),
        "gap_area": gap,
        "gap_share": gap / max(judged, 1e-30),
        "tilted_area": tilted,
        "tilted_share": tilted / max(judged, 1e-30),
    }
    remarks = {
        "gap_share": f"{gap:.3g} m2 of {judged:.3g} lie in gaps of two texels, or inside of solids",
        "invalid_share": f"{area.invalid:.3g} m2 of {total:.3g} hold no light of their own (invalid texels)",
        "visible_invalid_share": f"{area.visible:.3g} m2 of invalid texels can be seen",
        "uncovered_share": f"{area.uncovered:.3g} m2 of {total:.3g} lie on texels without a measured value",
        "unresolved_share": (
            f"the reference of {evidence.channel} stayed too noisy to judge {noisy:.3g} m2 of {judged:.3g};"
            " raise `time_limit`"
        ),
    }
    return Judged(figures, {name: text for name, text in remarks.items() if np.isfinite(figures[name])})


UNJUDGED = Judgement(
    "unjudged",
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
    judge,
)  # fmt: skip
