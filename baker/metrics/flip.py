"""Computes the FLIP error: the perceived difference between two pictures that are shown in alternation.

Based on: Andersson et al., FLIP: A difference evaluator for alternating images, 2020; Andersson et al.,
Visualizing errors in rendered high dynamic range images, 2021 (HDR-FLIP).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def flip_error(
    reference: NDArray[np.float32], picture: NDArray[np.float32]
) -> tuple[NDArray[np.float32], float]:
    """Compute the HDR-FLIP error of a picture.

    Parameters
    ----------
    reference : (H, W, C) float32, linear
        The reference picture, from which the exposures are derived. C is 3 (Rec.709) or 1.
    picture : (H, W, C) float32, linear
        The picture to compare, with the same C.

    Returns
    -------
    error : (H, W) float32, 0 to 1
        Error map.
    mean : float, 0 to 1
        Mean of the error map.
    """
    import flip_evaluator

    if float(reference.max(initial=0.0)) <= 0.0:
        # HDR-FLIP cannot choose an exposure for a black reference. Return 0 if `picture` is black, else 1.
        same = bool((picture <= 0).all())
        return np.full(reference.shape[:2], 0.0 if same else 1.0, np.float32), 0.0 if same else 1.0
    first, second = (
        # Copy the arrays, because the library refuses read-only arrays.
        np.array(np.broadcast_to(np.maximum(image, 0), (*image.shape[:2], 3)), np.float32, order="C")
        for image in (reference, picture)
    )
    error, mean, _ = flip_evaluator.evaluate(first, second, "HDR", applyMagma=False)
    return np.asarray(error, np.float32)[..., 0], float(mean)
