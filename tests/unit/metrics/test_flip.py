"""The FLIP error of simple images has the known values."""

from __future__ import annotations

import numpy as np

from baker.metrics.flip import flip_error


def test_flip_of_equal_pictures_is_nothing_and_grows():
    image = np.random.default_rng(0).random((24, 24, 3)).astype(np.float32)
    means = [flip_error(image, image * factor)[1] for factor in (1.0, 1.1, 2.0)]
    assert means[0] == 0
    assert 0 < means[1] < means[2] < 1
    error, mean = flip_error(image[..., :1], image[..., :1])
    assert error.shape == (24, 24)
    assert mean == 0


def test_flip_of_black():
    black, grey = np.zeros((8, 8, 3), np.float32), np.full((8, 8, 3), 0.5, np.float32)
    assert flip_error(black, black)[1] == 0
    assert flip_error(black, grey)[1] == 1
