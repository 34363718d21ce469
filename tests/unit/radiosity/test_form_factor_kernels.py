"""Kernels that count, merge, balance and multiply sparse rows are compared with dense matrices."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest
from scipy.sparse import csr_matrix

from baker.radiosity.form_factors import count_targets
from baker.radiosity.kernels.form_factor import merge_reciprocal_estimates, multiply, sinkhorn_balance


def random_rows(n, rng, density=0.2):
    dense = np.where(rng.random((n, n)) < density, rng.random((n, n)), 0).astype(np.float32)
    if n > 3:
        dense[1] = 0
        dense[:, 2] = 0
    rows = csr_matrix(dense)
    rows.sort_indices()
    return dense.astype(float), rows


def parts(rows):
    return rows.indptr.astype(np.int64), rows.indices.astype(np.int32), rows.data.astype(np.float32)


@pytest.mark.parametrize("n_rays", [1, 7, 64])
def test_targets_are_counted(n_rays):
    rng = np.random.default_rng(n_rays)
    target = rng.integers(-1, 12, (40, n_rays)).astype(np.int32)
    target[0], target[1], target[2] = -1, 5, np.arange(n_rays)
    columns, counts, lengths = count_targets(target.copy())
    assert len(columns) == len(counts) == lengths.sum()
    for i, end in enumerate(np.cumsum(lengths)):
        row = slice(end - lengths[i], end)
        truth = Counter(target[i][target[i] >= 0].tolist())
        assert columns[row].tolist() == sorted(truth)
        assert counts[row].tolist() == [truth[c] for c in sorted(truth)]


@pytest.mark.parametrize("n", [0, 1, 4, 60])
def test_products(n):
    rng = np.random.default_rng(n)
    dense, rows = random_rows(n, rng)
    light = rng.normal(size=(n, 3))
    out = np.full((n, 3), np.nan)
    multiply(*parts(rows), light, out)
    np.testing.assert_allclose(out, dense @ light, atol=1e-12)


@pytest.mark.parametrize("n", [0, 1, 4, 50])
def test_the_better_estimate_counts_more(n):
    rng = np.random.default_rng(n)
    dense, rows = random_rows(n, rng)
    other = rows.T.tocsr()
    other.sort_indices()
    area = rng.uniform(0.1, 10, n)
    first = np.full(n + 1, -1, np.int64)
    column, value = np.zeros(2 * rows.nnz, np.int32), np.zeros(2 * rows.nnz, np.float32)
    merge_reciprocal_estimates(*parts(rows), *parts(other), area, first, column, value)
    # The merged A_i F_ij is the weighted mean of A_i F_ij (weight A_j) and A_j F_ji (weight A_i).
    a, b = area[:, None], area[None, :]
    truth = (b * a * dense + a * b * dense.T) / ((a + b) * a) if n else dense
    ours = csr_matrix((value[: first[-1]], column[: first[-1]], first), shape=(n, n))
    np.testing.assert_allclose(ours.toarray(), truth, rtol=1e-6)
    assert all((np.diff(column[first[i] : first[i + 1]]) > 0).all() for i in range(n))
    flux = area[:, None] * ours.toarray()
    np.testing.assert_allclose(flux, flux.T, rtol=1e-5)


def test_rows_are_balanced_and_stay_reciprocal():
    rng = np.random.default_rng(9)
    n = 40
    area = rng.uniform(0.5, 2, n)
    flux = rng.uniform(0.5, 1.5, (n, n))
    flux = (flux + flux.T) / 2
    np.fill_diagonal(flux, 0)
    flux[7] = flux[:, 7] = 0
    dense = np.float32(flux / area[:, None] / flux.sum(axis=1).max())
    goal = rng.uniform(0.6, 1.0, n)
    rows = csr_matrix(dense)
    factor = np.ones(n)
    first, column, value = parts(rows)
    error = sinkhorn_balance(first, column, value, goal, np.zeros(n), factor, 100)
    assert error == pytest.approx(np.abs(dense.sum(axis=1, dtype=float) - goal).max(), rel=1e-6)
    balanced = factor[:, None] * dense * factor
    scaled = csr_matrix((value, column, first), shape=(n, n))
    np.testing.assert_allclose(scaled.toarray(), balanced, rtol=1e-6)
    keep = np.arange(n) != 7
    np.testing.assert_allclose(balanced.sum(axis=1)[keep], goal[keep], rtol=1e-6)
    assert factor[7] == 1
    flux = area[:, None] * balanced
    np.testing.assert_allclose(flux, flux.T, rtol=1e-5)
    # If the row sums equal their goals, all factors are 1.
    again = np.ones(n)
    sinkhorn_balance(*parts(rows), dense.sum(axis=1, dtype=float), np.zeros(n), again, 5)
    # With slack, the sum of row i becomes goal_i + slack_i (1 - factor_i).
    slack, factor = rng.uniform(0, 0.2, n), np.ones(n)
    sinkhorn_balance(*parts(rows), goal, slack, factor, 200)
    reached = (factor[:, None] * dense * factor).sum(axis=1)
    np.testing.assert_allclose(reached[keep], (goal + slack * (1 - factor))[keep], rtol=1e-6)
    np.testing.assert_allclose(again, 1, atol=1e-6)
