"""The radiosity solve is compared with dense linear algebra."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.sparse import csr_matrix

from baker.core.errors import Cancelled
from baker.core.progress import silent
from baker.radiosity import solve
from baker.radiosity.form_factors import FormFactorMatrix
from baker.radiosity.solve import (
    MAX_ALBEDO,
    TOLERANCE,
    apply,
    energy_audit,
    solve_radiosity,
    solve_warnings,
)


def room(n, seed, open_sky=0.0):
    """Return (matrix, dense matrix, area, rng) of n patches with reciprocal form factors.

    Rows sum to at most 1 - open_sky. All form factors from and to the last patch are 0.
    """
    rng = np.random.default_rng(seed)
    area = rng.uniform(0.2, 5, n)
    flux = rng.random((n, n)) ** 3
    flux += flux.T
    np.fill_diagonal(flux, 0)
    goal = area * (1 - open_sky)
    for _ in range(400):
        scale = np.sqrt(goal / flux.sum(axis=1))
        flux = scale[:, None] * flux * scale
    flux[-1] = flux[:, -1] = 0
    dense = flux / area[:, None]
    rows = csr_matrix(dense.astype(np.float32))
    sky = (1 - rows.toarray().sum(axis=1)).astype(np.float32)
    matrix = FormFactorMatrix(
        rows.indptr.astype(np.int64), rows.indices.astype(np.int32), rows.data, sky, 0 * sky, 0.0, 0.0, 0
    )
    return matrix, rows.toarray().astype(float), area, rng


def dense_solution(dense, source, albedo):
    """Return F (I - rho F)^-1 s for each colour, with F = `dense`, rho = `albedo` and s = `source`."""
    eye = np.eye(len(dense))
    return np.stack(
        [dense @ np.linalg.solve(eye - albedo[:, c, None] * dense, source[:, c]) for c in range(3)], axis=1
    )


@pytest.mark.parametrize("open_sky", [0.0, 0.3])
@pytest.mark.parametrize("albedo", [0.0, 0.2, 0.8, 0.95, 0.999, "colours"])
def test_the_answer_is_that_of_a_dense_solve(albedo, open_sky):
    matrix, dense, area, rng = room(50, 1, open_sky)
    if albedo == "colours":
        value = rng.random((50, 3)) * [1.0, 0.5, 0.05]
        value[:5] = 0
    else:
        value = np.full((50, 3), albedo)
    source = rng.random((50, 3)) * np.maximum(value, 1e-3) * [1, 20, 0.01]
    solution = solve_radiosity(matrix, source, value, area, bounces=None, progress=silent)
    truth = dense_solution(dense, source, np.minimum(value, MAX_ALBEDO))
    scale = source.max(axis=0)
    np.testing.assert_allclose(solution.irradiance / scale, truth / scale, rtol=2e-3, atol=2e-4)
    assert solution.residual < 20 * TOLERANCE
    assert 0 <= solution.iterations < 60


def coloured(matrix, rng):
    """Return the matrix with random transmittances to patches and sky, and its dense form (3, n, n)."""
    n = len(matrix.first) - 1
    shared = rng.random((n, n, 3))
    shared = (shared + shared.transpose(1, 0, 2)) / 2
    row = np.repeat(np.arange(n), np.diff(matrix.first))
    transmittance = np.float32(shared[row, matrix.column])
    dense = np.zeros((3, n, n))
    dense[:, row, matrix.column] = (matrix.value[:, None] * transmittance).T
    return replace(
        matrix, transmittance=transmittance, sky_transmittance=np.float32(rng.random((n, 3)))
    ), dense


@pytest.mark.parametrize("bounces", [None, 3])
def test_coloured_light_between_patches_is_a_solve_for_each_colour(bounces):
    matrix, _, area, rng = room(50, 7, 0.2)
    matrix, dense = coloured(matrix, rng)
    albedo, source = rng.random((50, 3)), rng.random((50, 3))
    solution = solve_radiosity(matrix, source, albedo, area, bounces=bounces, progress=silent)
    for c in range(3):
        step = dense[c] * albedo[:, c]
        truth = dense[c] @ source[:, c]
        if bounces is None:
            truth = np.linalg.solve(np.eye(50) - step, truth)
        else:
            truth = truth + step @ truth
        np.testing.assert_allclose(solution.irradiance[:, c], truth, rtol=2e-3, atol=2e-4)
    if bounces is None:
        # Light is absorbed by surfaces or between them, or it escapes to the sky.
        direct = source / albedo
        energy = energy_audit(matrix, area, direct, source, solution.irradiance, albedo)
        leaving = source + albedo * solution.irradiance
        share = matrix.sky[:, None] * matrix.sky_transmittance
        assert energy["escaped"] == pytest.approx((area[:, None] * leaving * share).sum() / 3, rel=1e-5)
        assert energy["absorbed"] + energy["escaped"] == pytest.approx(energy["emitted"], rel=1e-4)


def test_the_reported_residual_is_correct():
    matrix, dense, area, rng = room(40, 2)
    albedo, source = np.full((40, 3), 0.7), rng.random((40, 3))
    solution = solve_radiosity(matrix, source, albedo, area, bounces=None, progress=silent)
    exitance = source + albedo * solution.irradiance
    rest = dense @ exitance - solution.irradiance
    assert np.abs(rest).max() < 1e-4
    np.testing.assert_allclose(apply(matrix, exitance), dense @ exitance, rtol=1e-6)


@pytest.mark.parametrize("bounces", [0, 1, 2, 3, 10, 200])
def test_bounces_are_terms_of_the_neumann_series(bounces):
    matrix, dense, area, rng = room(30, 3, 0.1)
    albedo, source = rng.random((30, 3)) * 0.9, rng.random((30, 3))
    solution = solve_radiosity(matrix, source, albedo, area, bounces=bounces, progress=silent)
    # The final gather adds one bounce, so the solve computes bounces - 1 terms. The first one is F s.
    term, truth = source, np.zeros((30, 3))
    for _ in range(max(bounces - 1, 0)):
        arriving = dense @ term
        truth += arriving
        term = np.clip(albedo, 1e-4, MAX_ALBEDO) * arriving
    np.testing.assert_allclose(solution.irradiance, truth, rtol=1e-5, atol=1e-9)
    assert solution.iterations == max(bounces - 1, 0)
    if bounces == 200:
        whole = solve_radiosity(matrix, source, albedo, area, bounces=None, progress=silent)
        np.testing.assert_allclose(whole.irradiance, truth, rtol=1e-3)


def test_no_light_and_light_of_one_colour():
    matrix, dense, area, rng = room(20, 4)
    albedo = np.full((20, 3), 0.6)
    dark = solve_radiosity(matrix, np.zeros((20, 3)), albedo, area, bounces=None, progress=silent)
    assert (dark.irradiance == 0).all()
    assert (dark.iterations, dark.residual) == (0, 0.0)
    source = np.zeros((20, 3))
    source[:, 1] = rng.random(20)
    green = solve_radiosity(matrix, source, albedo, area, bounces=None, progress=silent)
    assert (green.irradiance[:, [0, 2]] == 0).all()
    np.testing.assert_allclose(green.irradiance, dense_solution(dense, source, albedo), rtol=1e-3, atol=1e-6)
    assert np.isfinite(green.residual)


def test_no_patches():
    none = np.zeros(0, np.float32)
    matrix = FormFactorMatrix(np.zeros(1, np.int64), np.zeros(0, np.int32), none, none, none, 0, 0, 0)
    solution = solve_radiosity(
        matrix, np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0), bounces=None, progress=silent
    )
    assert solution.irradiance.shape == (0, 3)
    assert solution.residual == 0


def test_a_furnace_multiplies_light():
    """In a closed room of albedo rho, all bounces together multiply light by 1 / (1 - rho)."""
    rng = np.random.default_rng(5)
    n, area = 24, rng.uniform(1, 3, 24)
    dense = np.float32(np.tile(area / area.sum(), (n, 1)))
    rows = csr_matrix(dense)
    none = np.zeros(n, np.float32)
    matrix = FormFactorMatrix(rows.indptr.astype(np.int64), rows.indices, rows.data, none, none, 0, 0, 0)
    for rho in (0.1, 0.5, 0.95, 0.99):
        source = np.full((n, 3), rho)
        solution = solve_radiosity(matrix, source, source, area, bounces=None, progress=silent)
        np.testing.assert_allclose(solution.irradiance, rho / (1 - rho), rtol=2e-3)


def test_cancel():
    matrix, _, area, rng = room(20, 6)
    for bounces in (None, 5):
        with pytest.raises(Cancelled):
            solve_radiosity(
                matrix, rng.random((20, 3)), np.full((20, 3), 0.9), area, bounces=bounces,
                progress=lambda stage, fraction, detail="": fraction > 0,
            )  # fmt: skip


def test_light_is_neither_made_nor_lost():
    matrix, _, area, rng = room(40, 7, 0.2)
    albedo, direct = rng.random((40, 3)) * 0.9, rng.random((40, 3))
    reflected = albedo * direct
    solution = solve_radiosity(matrix, reflected, albedo, area, bounces=None, progress=silent)
    audit = energy_audit(matrix, area, direct, reflected, solution.irradiance, albedo)
    assert audit["emitted"] == pytest.approx((area[:, None] * direct).sum() / 3)
    assert audit["emitted"] == pytest.approx(audit["absorbed"] + audit["escaped"], rel=1e-4)
    assert audit["escaped"] > 0.05 * audit["emitted"]


def rooms(count, n, passage, seed):
    """Return (matrix, dense matrix, area) of a chain of closed rooms of n patches each.

    `passage` is A_i F_ij between one patch of a room and one patch of the next room.
    """
    rng = np.random.default_rng(seed)
    size = count * n
    area, flux = rng.uniform(0.5, 2, size), np.zeros((size, size))
    for first in range(0, size, n):
        block = rng.random((n, n)) ** 3
        flux[first : first + n, first : first + n] = block + block.T
    for _ in range(300):
        scale = np.sqrt(area / flux.sum(axis=1))
        flux = scale[:, None] * flux * scale
    for first in range(n, size, n):
        flux[first - 1, first] = flux[first, first - 1] = passage
    rows = csr_matrix((flux / area[:, None]).astype(np.float32))
    none = np.zeros(size, np.float32)
    matrix = FormFactorMatrix(
        rows.indptr.astype(np.int64), rows.indices.astype(np.int32), rows.data, none, none, 0, 0, 0
    )
    return matrix, rows.toarray().astype(float), area


def refined_solution(dense, source, albedo):
    """Return F (I - rho F)^-1 s, iteratively refined so that dim patches are accurate, too."""
    truth = np.zeros_like(source)
    for c in range(3):
        system = np.eye(len(dense)) - albedo[:, c, None] * dense
        for _ in range(8):
            rest = source[:, c] + albedo[:, c] * (dense @ truth[:, c]) - truth[:, c]
            truth[:, c] += np.linalg.solve(system, rest)
    return dense @ truth


@pytest.mark.parametrize("passage", [0.0, 1e-6, 1e-3])
@pytest.mark.parametrize("albedo", [0.5, 0.8, 0.99])
@pytest.mark.parametrize("dim", [1e-3, 1e-6, 1e-11])
def test_every_patch_has_its_light_however_bright_others_are(passage, albedo, dim):
    """Light is accurate in a dim room, separate from a bright room or joined with it, and in a dim colour."""
    matrix, dense, area = rooms(3, 30, passage, 8)
    rho = np.clip(albedo + np.random.default_rng(9).uniform(-0.05, 0.009, (90, 3)), 0, MAX_ALBEDO)
    source = np.zeros((90, 3))
    source[:4], source[-4:] = (1.0, 1e-5, 1.0), (dim, 1e-3 * dim, dim)
    solution = solve_radiosity(matrix, source, rho, area, bounces=None, progress=silent)
    truth = refined_solution(dense, source, rho)
    # The error estimate is a bound only for uniform light. The largest error of 72 random systems was 1.8
    # times the estimate.
    np.testing.assert_allclose(solution.irradiance, truth, rtol=4 * TOLERANCE)
    assert solution.patch_error <= TOLERANCE
    assert solution.iterations < 120
    assert solve_warnings(solution) == []


def test_a_bright_ground_does_not_end_the_solve_of_a_room():
    """A bright patch without visible patches converges at once. A room beside it converges as if alone."""
    matrix, _, area = rooms(1, 40, 0.0, 10)
    albedo, source = np.full((40, 3), 0.8), np.random.default_rng(11).random((40, 3))
    alone = solve_radiosity(matrix, source, albedo, area, bounces=None, progress=silent)
    none = np.zeros(41, np.float32)
    both = FormFactorMatrix(
        np.append(matrix.first, matrix.first[-1]), matrix.column, matrix.value, none, none, 0, 0, 0
    )
    lit, white = np.vstack([source, np.full(3, 1e12)]), np.vstack([albedo, np.full(3, 0.8)])
    beside = solve_radiosity(both, lit, white, np.append(area, 100.0), bounces=None, progress=silent)
    np.testing.assert_allclose(beside.irradiance[:40], alone.irradiance, rtol=2 * TOLERANCE)


def test_a_solve_that_ends_too_early_says_so(monkeypatch):
    matrix, _, area = rooms(2, 30, 1e-3, 12)
    albedo, source = np.full((60, 3), 0.9), np.zeros((60, 3))
    source[:3] = 1.0
    monkeypatch.setattr(solve, "MAX_ITERATIONS", 4)
    solution = solve_radiosity(matrix, source, albedo, area, bounces=None, progress=silent)
    assert solution.iterations == 4
    assert solution.patch_error > TOLERANCE
    (warning,) = solve_warnings(solution)
    assert warning.code == "solve-not-converged"
    assert "4 iterations" in warning.message
