"""FLIP, how far apart two pictures look to a person who flips between them; alone knows its library.

Based on: Andersson et al., FLIP: A difference evaluator for alternating images, 2020; Andersson et al.,
Visualizing errors in rendered high dynamic range images, 2021 (HDR-FLIP).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def flip_error(
    reference: NDArray[np.float32], picture: NDArray[np.float32]
) -> tuple[NDArray[np.float32], float]:
    """Return the error map (H, W), 0 to 1, and its mean.

    Parameters
    ----------
    reference, picture : (H, W, C) float32
        Linear light, C = 3 (Rec.709) or 1; exposures are chosen from the reference.
    """
    import flip_evaluator

    if float(reference.max(initial=0.0)) <= 0.0:
        # There is no exposure at which black can be seen.
        same = bool((picture <= 0).all())
        return np.full(reference.shape[:2], 0.0 if same else 1.0, np.float32), 0.0 if same else 1.0
    first, second = (
        # A copy: the library refuses arrays that it might not write to.
        np.array(np.broadcast_to(np.maximum(image, 0), (*image.shape[:2], 3)), np.float32, order="C")
        for image in (reference, picture)
    )
    error, mean, _ = flip_evaluator.evaluate(first, second, "HDR", applyMagma=False)
    return np.asarray(error, np.float32)[..., 0], float(mean)
