"""A bake warns of closed rooms of high albedo rho, where bounces multiply light by 1 / (1 - rho)."""

from __future__ import annotations

import re

import numpy as np
import pytest
from scipy.sparse import csr_matrix

from baker.radiosity.form_factors import FormFactorMatrix
from baker.radiosity.trapped_light import trapped_light


def rooms(*open_sky, patches=8):
    """Return the form factors of separate rooms, one for each sky share in `open_sky`.

    All form factors within a room are equal.
    """
    n = patches * len(open_sky)
    dense = np.zeros((n, n))
    for k, share in enumerate(open_sky):
        own = slice(k * patches, (k + 1) * patches)
        dense[own, own] = (1 - share) / patches
    rows = csr_matrix(dense.astype(np.float32))
    sky = (1 - dense.sum(axis=1)).astype(np.float32)
    return FormFactorMatrix(
        rows.indptr.astype(np.int64), rows.indices.astype(np.int32), rows.data, sky, 0 * sky, 0.0, 0.0, 0
    )


def told(matrix, albedo, bounces=None, area=None):
    n = len(matrix.first) - 1
    value = np.broadcast_to(np.asarray(albedo, float).reshape(-1, 1), (n, 3)).copy()
    return trapped_light(matrix, value, np.ones(n) if area is None else area, bounces)


def gain(warnings):
    assert [w.code for w in warnings] == ["albedo"]
    return float(re.search(r"by about ([\d.e+]+)", warnings[0].message).group(1))


@pytest.mark.parametrize(
    ("albedo", "expected"), [(0.985, 1 / 0.015), (0.99, 100), (0.999, 1000), (1.0, 1000)]
)
def test_a_closed_room_multiplies_light_by_one_over_what_it_absorbs(albedo, expected):
    found = told(rooms(0.0), albedo)
    # Form factors are float32, so row sums have errors of about 1e-7. The smallest 1 - rho here is 1e-3.
    assert gain(found) == pytest.approx(expected, rel=0.005)
    assert ("without bound" in found[0].message) == (albedo >= 0.999)
    assert "100 % of the surface" in found[0].message


def test_a_small_opening_counts_as_what_it_lets_out():
    assert gain(told(rooms(0.02), 1.0)) == pytest.approx(1 / (1 - 0.999 * 0.98), rel=0.005)


@pytest.mark.parametrize(
    ("open_sky", "albedo", "bounces"), [(0.0, 0.97, None), (0.1, 1.0, None), (0.0, 1.0, 5), (1.0, 1.0, None)]
)
def test_ordinary_rooms_say_nothing(open_sky, albedo, bounces):
    assert told(rooms(open_sky), albedo, bounces) == []


def test_a_white_room_beside_a_large_grey_one_is_found():
    albedo = np.repeat([0.99, 0.5], 8)
    found = told(rooms(0.0, 0.0), albedo, area=np.repeat([1.0, 99.0], 8))
    assert gain(found) == pytest.approx(100, rel=0.005)
    assert "(1 % of the surface)" in found[0].message


def test_one_colour_is_enough():
    matrix, albedo = rooms(0.0), np.tile([0.1, 0.2, 0.99], (8, 1))
    assert gain(trapped_light(matrix, albedo, np.ones(8), None)) == pytest.approx(100, rel=0.005)
