"""Blocks of eight paths in SIMD lanes agree with single paths, and random numbers of paths are uniform."""

from __future__ import annotations

import numpy as np
import pytest
from inner import compiled
from scipy import stats

from baker.pathtracer.emitters import (
    EMITTER_AREA,
    EMITTER_CHANCE,
    EMITTER_COLUMNS,
    EMITTER_NORMAL,
    EMITTER_RADIANCE,
    EMITTER_TWO_SIDED,
)
from baker.pathtracer.light_table import (
    CONE,
    DELTA_AXIS,
    DELTA_AZIMUTHS,
    DELTA_CHANCE,
    DELTA_COLUMNS,
    DELTA_CONE_SCALE,
    DELTA_COSINES,
    DELTA_FORM,
    DELTA_INTENSITY,
    DELTA_MIN_COSINE,
    DELTA_POSITION,
    DELTA_TANGENT,
    EVEN,
    PARALLEL,
    TABULATED,
    LightTable,
    light_rows,
)
from baker.pathtracer.path_blocks import (
    ALBEDO,
    ALIVE,
    BETA,
    BLOCK,
    BLOCK_WIDTH,
    BLOCKS,
    BOUNCES,
    CHOICE,
    COUNT,
    DENSITY,
    KEY,
    MAX_DISTANCE,
    N_ROWS,
    NORMAL,
    POINT,
    ROULETTE,
    SAMPLE,
    SHADED,
    TANGENT,
    TO_LIGHT,
    U_DIRECTION,
    U_LIGHT,
    VALUE,
    W_DIRECTION,
    W_LIGHT,
    close_gaps,
)
from baker.pathtracer.paths import choose_lights, fetch_lanes
from baker.pathtracer.rng import random_lanes, seed_salt
from baker.pathtracer.scene import ROW_LENGTH
from baker.pathtracer.vertex import BETA as PATH_BETA
from baker.pathtracer.vertex import N_ROWS as PATH_ROWS
from baker.pathtracer.vertex import NORMAL as PATH_NORMAL
from baker.pathtracer.vertex import POSITION, aim, arrive, set_frame
from baker.pathtracer.vertex import SHADED as PATH_SHADED
from baker.pathtracer.vertex_simd import aim_at_lights, arrive_lanes, look_up_falloff, scatter_lanes
from baker.trace.packets import DIR_X, HIT_U, ORG_X, PRIM_ID

ALPHA = 1e-4
aim, arrive, set_frame = compiled(aim, arrive, set_frame)
aim_at_lights, arrive_lanes, scatter_lanes = compiled(aim_at_lights, arrive_lanes, scatter_lanes)
(look_up_falloff,) = compiled(look_up_falloff)
choose_lights, fetch_lanes, random_lanes = compiled(choose_lights, fetch_lanes, random_lanes)
(close_gaps,) = compiled(close_gaps)


def blocks(n=BLOCKS):
    """Return three views of the memory of n blocks: flat float32, flat uint32, float32 (n, N_ROWS, 8)."""
    s = np.zeros(n * BLOCK, np.float32)
    return s, s.view(np.uint32), s.reshape(n, N_ROWS, BLOCK_WIDTH)


def unit(vector):
    return vector / np.linalg.norm(vector, axis=-1, keepdims=True)


def many_numbers(seed=3, number=0):
    """Return (64, 64, 8, 6): the six random numbers that paths use for each point, sample and vertex."""
    _, words, rows = blocks(1)
    bits = words.reshape(N_ROWS, BLOCK_WIDTH)
    found = np.zeros((64, 64, 8, 6))
    for point in range(0, 64, BLOCK_WIDTH):
        for sample in range(64):
            bits[KEY], bits[SAMPLE], bits[COUNT] = np.arange(point, point + BLOCK_WIDTH), sample, 0
            for vertex in range(8):
                random_lanes(words, 0, number, seed_salt(seed))
                uniform = rows[0, [U_LIGHT, W_LIGHT, U_DIRECTION, W_DIRECTION, ROULETTE]] - 1.0
                found[point : point + BLOCK_WIDTH, sample, vertex, :5] = uniform.T
                found[point : point + BLOCK_WIDTH, sample, vertex, 5] = bits[CHOICE] / 2.0**32
    return found


def even(count):
    """Return whether the counts of equally probable cells pass a chi-square test."""
    return stats.chisquare(count.ravel()).pvalue > ALPHA


def test_random_numbers_are_uniform_alone_and_in_pairs():
    number = many_numbers()
    assert number.min() >= 0.0
    assert number.max() < 1.0
    cell = np.minimum((number * 16).astype(int), 15)
    for c in range(6):
        assert even(np.bincount(cell[..., c].ravel(), minlength=16))
        for other in range(c):
            assert even(np.bincount((cell[..., c] * 16 + cell[..., other]).ravel(), minlength=256))
        # Numbers of adjacent points, of adjacent samples and of adjacent vertices are independent.
        for axis in range(3):
            along = np.moveaxis(cell[..., c], axis, 0)
            assert even(np.bincount((along[::2] * 16 + along[1::2]).ravel(), minlength=256))


def test_seeds_and_passes_have_numbers_of_their_own():
    one = many_numbers()
    for other in (many_numbers(seed=4), many_numbers(number=1)):
        assert (one == other).mean() < 1e-3
        cell = (one * 8).astype(int) * 8 + (other * 8).astype(int)
        assert even(np.bincount(cell.ravel(), minlength=64))


def test_directions_follow_the_cosine_whatever_the_normal():
    s, _, rows = blocks(1)
    rng = np.random.default_rng(2)
    tilt = unit(rng.normal(size=(BLOCK_WIDTH, 3)))
    count = np.zeros((BLOCK_WIDTH, 12, 12))
    for k in range(4000):
        rows[0, ALIVE], rows[0, BOUNCES] = 1, 0
        rows[0, BETA : BETA + 3] = 0.5
        rows[0, ALBEDO : ALBEDO + 3] = 0.5
        frame(rows, tilt)
        rows[0, U_DIRECTION], rows[0, W_DIRECTION] = 1 + rng.random((2, BLOCK_WIDTH))
        rows[0, ROULETTE] = 1.5
        scatter_lanes(s, 0)
        way = rows[0, DIR_X : DIR_X + 3].T.astype(float)
        up = (way * tilt).sum(axis=1)
        assert np.allclose(np.linalg.norm(way, axis=1), 1, atol=2e-6)
        assert np.allclose(rows[0, DENSITY], up / np.pi, atol=2e-6)
        assert np.allclose(rows[0, BETA], 0.25)
        a, b = unit(np.cross(tilt, [1, 2, 3])), unit(np.cross(tilt, np.cross(tilt, [1, 2, 3])))
        turn = np.arctan2((way * a).sum(axis=1), (way * b).sum(axis=1)) / (2 * np.pi) % 1
        # For cosine-weighted directions, the squared cosine is uniform.
        count[
            np.arange(BLOCK_WIDTH),
            np.minimum(12 * up**2, 11).astype(int),
            np.minimum(12 * turn, 11).astype(int),
        ] += 1
        assert k > 0 or rows[0, ALIVE].all()
    for lane in range(BLOCK_WIDTH):
        assert even(count[lane])


def frame(rows, normal):
    """Write the normals (8, 3) of the eight lanes and their tangent frames to the rows of block 0."""
    from baker.kernels.sampling import tangent_frame

    rows[0, NORMAL : NORMAL + 3] = rows[0, SHADED : SHADED + 3] = normal.T
    for lane in range(BLOCK_WIDTH):
        rows[0, TANGENT : TANGENT + 6, lane] = tangent_frame(*normal[lane].astype(np.float32))


def test_roulette_is_fair():
    s, _, rows = blocks(1)
    frame(rows, np.tile([0.0, 0.0, 1.0], (BLOCK_WIDTH, 1)))
    left, n = np.zeros(BLOCK_WIDTH), 4000
    for k in range(n):
        rows[0, ALIVE], rows[0, BOUNCES] = 1, [0, 2, 3, 9, 3, 3, 3, 3]
        rows[0, BETA : BETA + 3] = np.array([1, 1, 1, 1, 0.5, 0.25, 0.1, 4])
        rows[0, ALBEDO : ALBEDO + 3] = 0.5
        rows[0, U_DIRECTION], rows[0, W_DIRECTION], rows[0, ROULETTE] = 1.4, 1.7, 1 + (k + 0.5) / n
        scatter_lanes(s, 0)
        left += rows[0, ALIVE] * rows[0, BETA]
    assert np.allclose(left / n, [0.5, 0.5, 0.5, 0.5, 0.25, 0.125, 0.05, 2.0], rtol=1e-3)


@pytest.fixture(scope="module")
def some_lights():
    """Return a light table of 20 emissive triangles, a delta light of each form and the sky.

    Half of the triangles are two-sided. All 25 lights have the same probability.
    """
    rng = np.random.default_rng(5)
    triangle, point = np.zeros((20, EMITTER_COLUMNS)), np.zeros((4, DELTA_COLUMNS))
    triangle[:, :9] = (rng.normal(size=(20, 1, 3)) * 3 + rng.normal(size=(20, 3, 3))).reshape(20, 9)
    corner = triangle[:, :9].reshape(20, 3, 3)
    cross = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    triangle[:, EMITTER_NORMAL : EMITTER_NORMAL + 3] = unit(cross)
    triangle[:, EMITTER_AREA] = 0.5 * np.linalg.norm(cross, axis=1)
    triangle[:, EMITTER_TWO_SIDED], triangle[:, EMITTER_CHANCE] = np.arange(20) % 2, 1 / 25
    triangle[:, EMITTER_RADIANCE : EMITTER_RADIANCE + 3] = rng.random((20, 3))
    point[:, DELTA_FORM] = [EVEN, CONE, PARALLEL, TABULATED]
    point[:, DELTA_POSITION : DELTA_POSITION + 3] = rng.normal(size=(4, 3))
    point[:, DELTA_AXIS : DELTA_AXIS + 3] = unit(rng.normal(size=(4, 3)))
    point[:, DELTA_INTENSITY : DELTA_INTENSITY + 3] = rng.random((4, 3))
    point[:, DELTA_MIN_COSINE], point[:, DELTA_CONE_SCALE] = 0.2, 1 / 0.5
    point[:, DELTA_CHANCE] = 1 / 25
    point[3, DELTA_MIN_COSINE] = -0.6
    point[3, DELTA_TANGENT : DELTA_TANGENT + 3] = unit(
        np.cross(point[3, DELTA_AXIS : DELTA_AXIS + 3], [0, 1, 0])
    )
    point[3, DELTA_COSINES], point[3, DELTA_AZIMUTHS] = 9, 7
    falloff = (0.5 + rng.random(63)).astype(np.float32)
    sky = np.array([0.3, 0.6, 0.9, 1 / 25])
    none = np.zeros(0, np.int32)
    return LightTable(
        triangle, point, none, none, none.reshape(0, 4), np.arange(1, 26) / 25, sky,
        light_rows(triangle, point, sky), falloff, 0,
    )  # fmt: skip


@pytest.mark.parametrize(("mode", "power"), [(0, 0), (1, 0), (2, 0), (2, 1)])
def test_blocks_sample_lights_like_single_paths(some_lights, mode, power):
    sky = some_lights.sky
    s, words, rows = blocks(1)
    bits = words.reshape(N_ROWS, BLOCK_WIDTH)
    rng = np.random.default_rng(7 + mode + power)
    path, row = np.zeros((PATH_ROWS, 16)), np.zeros((5, 16))
    row[4] = -1
    light = np.zeros(BLOCK_WIDTH, np.int64)
    lit = set()
    for _ in range(300):
        normal = unit(rng.normal(size=(BLOCK_WIDTH, 3))).astype(np.float32)
        shaded = unit(normal + 0.2 * rng.normal(size=(BLOCK_WIDTH, 3))).astype(np.float32)
        frame(rows, shaded)
        rows[0, NORMAL : NORMAL + 3], rows[0, ALIVE] = normal.T, 1
        rows[0, ORG_X : ORG_X + 3] = 4 * rng.normal(size=(3, BLOCK_WIDTH))
        rows[0, BETA : BETA + 3], rows[0, ALBEDO : ALBEDO + 3] = rng.random((2, 3, BLOCK_WIDTH))
        rows[0, U_LIGHT], rows[0, W_LIGHT] = 1 + rng.random((2, BLOCK_WIDTH))
        bits[CHOICE] = rng.integers(0, 2**32, BLOCK_WIDTH, dtype=np.uint32)
        choose_lights(s, words, 0, some_lights, light)
        look_up_falloff(s, 0, some_lights, light)
        aim_at_lights(s, 0, mode, power)
        for lane in range(BLOCK_WIDTH):
            path[POSITION : POSITION + 3, lane] = rows[0, ORG_X : ORG_X + 3, lane]
            path[PATH_NORMAL : PATH_NORMAL + 3, lane] = normal[lane]
            path[PATH_BETA : PATH_BETA + 3, lane] = rows[0, BETA : BETA + 3, lane]
            row[:3, lane] = rows[0, ALBEDO : ALBEDO + 3, lane]
            set_frame(path, lane, *shaded[lane])
            path[27, lane] = 1.0
            value, way = np.zeros(3), np.zeros(6)
            numbers = np.array(
                [bits[CHOICE, lane] / 2.0**32, rows[0, U_LIGHT, lane] - 1.0, rows[0, W_LIGHT, lane] - 1.0]
            )
            found = aim(path, row, lane, some_lights, mode, power, *numbers, value, way)
            assert light[lane] == int(numbers[0] * 25)
            own = rows[0, VALUE : VALUE + 3, lane]
            if light[lane] == 24:
                # Single paths map random numbers to other sky directions, so only the light is compared.
                cosine = rows[0, TO_LIGHT : TO_LIGHT + 3, lane] @ shaded[lane]
                if own.max() > 0:
                    weight = {1: 1.0, 2: 1 / (1 + 25.0 ** (1 + power))}[mode]
                    beta = rows[0, BETA : BETA + 3, lane] * rows[0, ALBEDO : ALBEDO + 3, lane]
                    assert np.allclose(own, beta * sky[:3] * 25 * weight, rtol=1e-4)
                    assert cosine > 0
                    lit.add("sky")
                continue
            if found < 0:
                assert own.max() <= 1e-6
                continue
            lit.add(found)
            # At grazing angles, float32 is less accurate.
            assert np.allclose(own, value, rtol=2e-3, atol=1e-6)
            assert np.allclose(rows[0, TO_LIGHT : TO_LIGHT + 3, lane], way[:3], atol=1e-5)
            assert np.isclose(rows[0, MAX_DISTANCE, lane], way[3], rtol=1e-5)
    assert len(lit) == {0: 4}.get(mode, 25)


def test_lights_are_chosen_by_their_cumulative_probability(some_lights):
    s, words, _ = blocks(1)
    bits = words.reshape(N_ROWS, BLOCK_WIDTH)
    rng = np.random.default_rng(3)
    light = np.zeros(BLOCK_WIDTH, np.int64)
    for n in (1, 2, 16, 17, 300):
        chance = rng.random(n) * (rng.random(n) < 0.7)
        chance[-1] = 1
        cumulative = np.cumsum(chance) / chance.sum()
        cumulative[-1] = 1.0
        for _ in range(50):
            bits[CHOICE] = rng.integers(0, 2**32, BLOCK_WIDTH, dtype=np.uint32)
            choice = bits[CHOICE] / 2.0**32
            lights = some_lights._replace(row=np.zeros((n, 20), np.float32), cumulative=cumulative)
            choose_lights(s, words, 0, lights, light)
            assert (light == np.searchsorted(cumulative, choice, side="right")).all()


def test_blocks_shade_hits_like_single_paths():
    rng = np.random.default_rng(11)
    n = 400
    surface = np.zeros((n, ROW_LENGTH), np.float32)
    corner = rng.normal(size=(n, 3, 3))
    face = unit(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]))
    surface[:, :9] = corner.reshape(n, 9)
    # Some vertex normals point to the other side of the face, and some are zero.
    normal = unit(face[:, None] + 0.6 * rng.normal(size=(n, 3, 3)))
    normal[::17] = 0
    surface[:, 9:18], surface[:, 18:21] = normal.reshape(n, 9), face
    surface[:, 21], surface[:, 22] = rng.integers(0, 4, n), rng.random(n) < 0.5
    material = rng.random((4, 8)).astype(np.float32)
    s, words, rows = blocks(1)
    bits = words.reshape(N_ROWS, BLOCK_WIDTH)
    path, row = np.zeros((PATH_ROWS, 16)), np.zeros((5, 16))
    black = 0
    for first in range(0, n, BLOCK_WIDTH):
        way = unit(rng.normal(size=(BLOCK_WIDTH, 3)))
        u = rng.random(BLOCK_WIDTH)
        v = (1 - u) * rng.random(BLOCK_WIDTH)
        rows[0, DIR_X : DIR_X + 3], rows[0, HIT_U], rows[0, HIT_U + 1] = way.T, u, v
        bits[PRIM_ID], rows[0, ALIVE] = np.arange(first, first + BLOCK_WIDTH), 1
        fetch_lanes(s, words, 0, surface, material)
        arrive_lanes(s, 0, np.float32(0.1))
        for lane in range(BLOCK_WIDTH):
            path[3:6, lane] = rows[0, DIR_X : DIR_X + 3, lane]
            barycentric = [float(x) for x in rows[0, HIT_U : HIT_U + 2, lane]]
            alive = arrive(path, row, lane, surface, material, first + lane, *barycentric, 0.1, 1)
            assert bool(rows[0, ALIVE, lane]) == alive
            black += not alive
            if alive:
                assert np.allclose(rows[0, ALBEDO : ALBEDO + 3, lane], row[:3, lane])
                assert np.allclose(
                    rows[0, ORG_X : ORG_X + 3, lane], path[POSITION : POSITION + 3, lane], atol=1e-6
                )
                for own, one in ((NORMAL, PATH_NORMAL), (SHADED, PATH_SHADED)):
                    assert np.allclose(rows[0, own : own + 3, lane], path[one : one + 3, lane], atol=1e-5)
    assert 20 < black < 200


@pytest.mark.parametrize("share", [0.0, 0.02, 0.5, 0.97, 1.0])
def test_gaps_are_closed_and_no_path_is_lost(share):
    rng = np.random.default_rng(int(100 * share))
    s, words, rows = blocks()
    for _ in range(20):
        used = int(rng.integers(1, BLOCKS + 1))
        alive = rng.random((used, BLOCK_WIDTH)) < share
        rows[:] = 0
        rows[:used, ALIVE] = alive
        rows[:used, POINT] = np.arange(used * BLOCK_WIDTH).reshape(used, BLOCK_WIDTH)
        words.reshape(rows.shape)[:used, SAMPLE] = 7 + np.arange(used * BLOCK_WIDTH).reshape(
            used, BLOCK_WIDTH
        )
        before = rows[:used, POINT][alive]
        left = close_gaps(s, used)
        assert left == -(-len(before) // BLOCK_WIDTH)
        flag = rows[:, ALIVE].ravel()
        assert flag[: len(before)].all()
        assert not flag[len(before) :].any()
        after = rows[:left, POINT].ravel()[: len(before)]
        assert (np.sort(after) == np.sort(before)).all()
        assert (words.reshape(rows.shape)[:left, SAMPLE].ravel()[: len(before)] == 7 + after).all()
