"""Single steps of the unwrap are tested: overlap counts, outlines, packing, planar charts, parts, workers."""

from __future__ import annotations

import os
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from uv_scenes import ball_mesh, box_mesh, job_of, torus_mesh, welded
from uv_truth import covered_texels

import baker.uv.pool as pool
from baker.core.errors import Cancelled
from baker.core.progress import silent
from baker.topology.weld import connected_faces, connected_vertices, number_by_first, weld
from baker.uv.check import chart_overlap, page_overlap
from baker.uv.kernels.uv_overlap import count_close, mark_charts
from baker.uv.pack import Shapes, fit_page, pack
from baker.uv.parts import cut_parts
from baker.uv.planar import lay_flat, planar_charts
from baker.uv.xatlas_charts import cut_charts


def strictly_inside(triangle: np.ndarray, point: np.ndarray, slack: float) -> bool:
    a, b, c = triangle
    turn = (b - a)[0] * (c - a)[1] - (b - a)[1] * (c - a)[0]
    corners = (a, b, c) if turn > 0 else (a, c, b)
    for k in range(3):
        p, q = corners[k], corners[(k + 1) % 3]
        e = q - p
        if e[0] * (point - p)[1] - e[1] * (point - p)[0] <= slack * np.hypot(*e):
            return False
    return True


def test_overlap_count_matches_a_loop_over_samples():
    random = np.random.default_rng(5)
    uv = random.random((12, 3, 2))
    group = np.repeat(np.arange(4), 3)
    covered, doubled = np.zeros(4, int), np.zeros(4, int)
    taken: set[tuple[int, int]] = set()
    for t in range(12):
        for r in range(32):
            for c in range(32):
                if strictly_inside(uv[t] * 32, np.array([c + 0.5, r + 0.5]), 0.05):
                    covered[group[t]] += 1
                    doubled[group[t]] += (r, c) in taken
                    taken.add((r, c))
    found = page_overlap(uv, group, 16)
    np.testing.assert_array_equal(found.covered, covered)
    np.testing.assert_array_equal(found.doubled, doubled)
    assert doubled.sum() > 100


def test_chart_overlap_sees_a_fold_and_no_shared_edge():
    flat = np.array([[[0, 0], [1, 0], [0, 1]], [[1, 0], [1, 1], [0, 1]]], float)
    fold = np.array([[[0, 0], [1, 0], [0, 1]], [[1, 0], [0.2, 0.2], [0, 1]]], float)
    point = np.zeros((1, 3, 2))
    uv = np.concatenate([flat, 1e-5 * fold + 7, point])
    found = chart_overlap(uv, np.array([0, 0, 1, 1, 2], np.int32))
    assert found.overlaps(0.01).tolist() == [False, True, False]


def test_marked_texels_match_separating_axes():
    random = np.random.default_rng(6)
    for corner in random.random((40, 3, 2)) * random.choice([0.05, 0.9], 40)[:, None, None]:
        owner = np.zeros((24, 24), np.int32)
        mark_charts(corner[None] * 24, np.array([6], np.int32), owner)
        assert set(zip(*(a.tolist() for a in np.nonzero(owner)), strict=True)) == covered_texels(corner, 24)
        assert set(owner[owner != 0].tolist()) <= {7}


def test_close_texels_are_counted_by_rows_and_columns():
    owner = np.zeros((9, 9), np.int32)
    owner[2, 2], owner[5, 4], owner[8, 8] = 1, 2, 3
    assert [count_close(owner, gap) for gap in (1, 2, 3, 4)] == [0, 0, 2, 3]


def rectangles(extent: np.ndarray) -> Shapes:
    w, h = extent.T
    zero = 0 * w
    corner = np.stack([zero, zero, w, zero, w, h, zero, zero, w, h, zero, h], axis=1).reshape(-1, 3, 2)
    n = len(extent)
    return Shapes(corner, np.arange(0, 2 * n + 1, 2), extent, w * h, np.zeros(n, bool))


def test_packed_outlines_keep_their_gap():
    random = np.random.default_rng(7)
    extent = random.uniform(0.5, 12.0, (60, 2))
    shapes, item = rectangles(extent), np.arange(60)
    result = pack(shapes, item, np.ones(60), (128, 3), silent, 0.0)
    assert result.placed == 60
    size = np.maximum(np.round(extent), 1).astype(int) + 1
    page = np.zeros((128, 128), int)
    for k in range(60):
        (x, y), (w, h) = result.position[k], size[k]
        assert min(x, y) >= 2
        assert max(x + w, y + h) <= 126
        # No other chart lies within three texels.
        assert page[max(0, y - 3) : y + h + 3, max(0, x - 3) : x + w + 3].max() == 0
        page[y : y + h, x : x + w] = k + 1


def test_nothing_is_placed_on_a_ring():
    outer, inner = (
        np.array([[0, 0], [40, 0], [40, 40], [0, 40]]),
        np.array([[4, 4], [36, 4], [36, 36], [4, 36]]),
    )
    ring = []
    for k in range(4):
        m = (k + 1) % 4
        ring += [[outer[k], outer[m], inner[m]], [outer[k], inner[m], inner[k]]]
    square = [[[0, 0], [10, 0], [10, 10]], [[0, 0], [10, 10], [0, 10]]]
    corner = np.array(ring + square, float)
    shapes = Shapes(
        corner, np.array([0, 8, 10]), np.array([[40, 40], [10, 10.0]]), np.ones(2), np.zeros(2, bool)
    )
    # An outline has one span per row, so the outline of the ring includes its hole. The squares are placed
    # beside the ring.
    result = pack(shapes, np.array([0, 1, 1]), np.ones(2), (64, 2), silent, 0.0)
    assert result.placed == 3
    for x, y in result.position[1:]:
        ring_x, ring_y = result.position[0]
        assert x >= ring_x + 41 + 2 or y >= ring_y + 41 + 2


def test_fit_page_finds_the_density_of_a_single_square():
    shapes = rectangles(np.array([[2.0, 2.0]]))
    found = fit_page(shapes, np.array([0]), (100, 2), silent, (0, 1))
    assert found is not None
    # Without the border of 1 texel on each side, 98 texels are left. The first and the last of their centres
    # are 97 texels apart.
    assert found[0] == pytest.approx(97 / 2, rel=0.006)
    assert found[1].scale[0, 0] == pytest.approx(97 / 2)


def test_fit_page_gives_up_when_there_are_more_items_than_room():
    shapes = rectangles(np.array([[1.0, 1.0]]))
    assert fit_page(shapes, np.zeros(400, int), (32, 2), silent, (0, 1)) is None


def test_triangles_are_laid_flat_true_to_size():
    random = np.random.default_rng(8)
    corner = random.normal(size=(30, 3, 3))
    corner[0, 1] = corner[0, 0]
    corner[1] = corner[1, 0]
    uv = lay_flat(corner)
    for k in range(3):
        m = (k + 1) % 3
        real = np.linalg.norm(corner[:, k] - corner[:, m], axis=1)
        np.testing.assert_allclose(np.linalg.norm(uv[:, k] - uv[:, m], axis=1), real, atol=1e-12)


def test_planar_charts_cover_a_torus_without_overlap():
    mesh = torus_mesh(24, 12)
    uv, chart = planar_charts(mesh.position.astype(float), mesh.triangle)
    assert chart.min() == 0
    assert not chart_overlap(uv, chart).overlaps(0.01).any()
    corner = mesh.position[mesh.triangle].astype(float)
    real = 0.5 * np.linalg.norm(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1)
    e1, e2 = uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]
    flat = 0.5 * np.abs(e1[:, 0] * e2[:, 1] - e1[:, 1] * e2[:, 0])
    # A projection multiplies area by the cosine of the angle to the plane, which is at most 75 degrees.
    assert (flat > 0.24 * real).all()
    assert (flat <= real * (1 + 1e-9)).all()


def test_topology_on_known_cases():
    # Two triangles that share an edge, one that shares a vertex with them, and a separate one.
    triangle = np.array([[0, 1, 2], [1, 3, 2], [3, 4, 5], [6, 7, 8]])
    assert connected_vertices(triangle, 9).tolist() == [0, 0, 0, 1]
    assert connected_faces(triangle, np.zeros(4, int)).tolist() == [0, 0, 1, 2]
    assert connected_faces(triangle, np.array([0, 1, 0, 0])).tolist() == [0, 1, 2, 3]
    assert number_by_first(np.array([7, -3, 2, 7, 5, 2])).tolist() == [0, -1, 1, 0, 2, 1]
    assert weld(np.array([[1.0, 0.0], [0.0, 2.0], [1.0, -0.0], [0.0, 3.0]])).tolist() == [0, 1, 0, 2]


def test_a_fine_ball_is_cut_into_parts_within_a_cone_and_a_box_is_not():
    mesh = ball_mesh(5)
    part = cut_parts(mesh.position.astype(float), mesh.triangle)
    corner = mesh.position[mesh.triangle].astype(float)
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    assert 8 <= part.max() + 1 <= 100
    for k in range(part.max() + 1):
        mean = normal[part == k].sum(axis=0)
        assert (normal[part == k] @ mean).min() > 0.7 * np.linalg.norm(mean)
    box = box_mesh()
    assert cut_parts(*welded(box)).max() == 0


def test_workers_answer_as_this_process_does():
    jobs = [job_of(ball_mesh(3)), job_of(box_mesh()), job_of(torus_mesh())]
    assert sum(len(job.triangle) for job in jobs) > pool.IN_PROCESS_TRIANGLES
    answers = pool.run_jobs(jobs, 2, silent, 1.0)
    for job, answer in zip(jobs, answers, strict=True):
        here = cut_charts(job)
        assert answer.uv.tobytes() == here.uv.tobytes()
        assert answer.chart.tobytes() == here.chart.tobytes()


@pytest.mark.timed
@pytest.mark.parametrize("error", [None, KeyboardInterrupt])
def test_cancel_kills_the_workers_within_a_second(error):
    # xatlas needs several seconds for a curved part of this size.
    job = job_of(ball_mesh(6))
    started = threading.Event()
    when = []

    def progress(stage: str, fraction: float, detail: str = "") -> bool:
        if pids() - before:
            started.set()
            if not when:
                when.append(time.monotonic())
            if error is not None:
                raise error
            return True
        return False

    before = pids()
    with pytest.raises(error or Cancelled):
        pool.run_jobs([job, job], 2, progress, 1.0)
    assert started.is_set()
    assert time.monotonic() - when[0] < 1.0
    assert pids() - before == set()


def pids() -> set[int]:
    """Return the process ids of the running children of this process."""
    found = set()
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                fields = (entry / "stat").read_text().rpartition(")")[2].split()
            except OSError:
                continue
            if int(fields[1]) == os.getpid() and fields[0] != "Z":
                found.add(int(entry.name))
    return found
