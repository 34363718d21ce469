"""Fast code for small meshes gives the results of the code for large ones."""

from __future__ import annotations

import numpy as np
import pytest

from baker.checks.mesh_facts import MeshFacts
from baker.checks.rules import overlaps
from baker.core.origin import column_medians
from baker.core.scene import Material
from baker.core.source_mesh import SourceMesh, SourcePrimitive
from baker.topology import triangle_check, unique_rows, weld


@pytest.fixture
def large(monkeypatch):
    """Return a function that calls its first argument while `FEW` selects the code for large meshes."""

    def call(function, *arguments):
        with monkeypatch.context() as patch:
            for module in (unique_rows, weld, triangle_check):
                patch.setattr(module, "FEW", -1)
            return function(*arguments)

    return call


@pytest.mark.parametrize("seed", range(20))
def test_code_for_small_and_large_meshes_agrees(seed, large):
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, unique_rows.FEW + 1))
    position = rng.choice(np.float32([-1, -0.0, 0, 1, np.nan]), (n, 3)).astype(np.float32)
    material, label = rng.integers(0, 3, n).astype(np.int32), rng.integers(-2, 5, n)
    for columns in ([position], [position, material], []):
        for few, many in zip(
            unique_rows.unique_rows(columns, n), large(unique_rows.unique_rows, columns, n), strict=True
        ):
            np.testing.assert_array_equal(few, many)
    np.testing.assert_array_equal(weld.number_by_first(label), large(weld.number_by_first, label))
    corner = np.nan_to_num(position)
    triangle = rng.integers(0, n, (n, 3))
    double = rng.random(n) < 0.5
    few = triangle_check.duplicates(corner, triangle, material, double)
    np.testing.assert_array_equal(few, large(triangle_check.duplicates, corner, triangle, material, double))


@pytest.mark.parametrize("n", [1, 2, 3, 8, 9])
def test_medians_are_those_of_numpy(n):
    rows = np.random.default_rng(n).normal(size=(n, 4)) * 1e8
    rows[0, 2], rows[0, 3] = np.nan, np.inf
    with np.errstate(invalid="ignore"):
        np.testing.assert_array_equal(column_medians(rows), np.median(rows, axis=0))


@pytest.mark.parametrize("seed", range(30))
def test_no_crossing_of_a_small_mesh_is_missed(seed, monkeypatch):
    """Edges pierce the same faces, whether or not boxes of faces are compared before rays are cast."""
    rng = np.random.default_rng(seed)
    n, size = int(rng.integers(2, 6)), float(rng.choice([0.1, 0.4, 1.0]))
    position = (rng.random((n, 1, 3)) + size * rng.random((n, 3, 3))).reshape(-1, 3).astype(np.float32)
    triangle = np.arange(3 * n).reshape(-1, 3)
    # Some corners are shared.
    triangle[rng.random(triangle.shape) < 0.2] = 0
    facts = MeshFacts(SourceMesh("a", (SourcePrimitive(0, 0, position, triangle),)), (Material(),))
    pairs, count = overlaps._crossings(facts, 1)
    monkeypatch.setattr(overlaps, "_FEW_FACES", -1)
    expected, number = overlaps._crossings(facts, 1)
    assert count == number
    np.testing.assert_array_equal(pairs, expected)
