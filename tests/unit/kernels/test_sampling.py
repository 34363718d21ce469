"""Sampling functions match their densities (chi-square tests), and Sobol points form (0, m, 2)-nets."""

from __future__ import annotations

import naive
import numpy as np
import pytest
from inner import compiled

from baker.kernels.rays import lane_seeds
from baker.kernels.sampling import (
    cosine_direction,
    hash_combine,
    hash_u32,
    reverse_bits,
    scramble_reversed,
    shared_bits_mask,
    sobol_reversed,
    tangent_frame,
    texel_scramble,
    triangle_barycentric,
)

cosine_direction, tangent_frame = compiled(cosine_direction, tangent_frame)
hash_combine, hash_u32, lane_seeds = compiled(hash_combine, hash_u32, lane_seeds)
reverse_bits, scramble_reversed = compiled(reverse_bits, scramble_reversed)
texel_scramble, triangle_barycentric = compiled(texel_scramble, triangle_barycentric)


def cosine_directions(points):
    """Return the `cosine_direction` (n, 3) float32 of each of n points (n, 2) of the unit square."""
    return np.array([cosine_direction(u, v) for u, v in points], np.float32).reshape(-1, 3)


NO_BITS = np.uint32(0)
EDGES = np.float32([0.0, 2**-24, 0.25, 0.5, 0.5 + 2**-24, 0.75, 1 - 2**-24])


def texel_numbers(net, texel, mask, salt=25):
    """Return (len(texel), n, 2) float32: the n samples of `net`, scrambled for each texel as in kernels."""
    out = np.zeros((len(texel), len(net), 2), np.float32)
    seeds = np.zeros(32, np.uint32)
    for i, number in enumerate(texel):
        lane_seeds(int(number), 1, salt, seeds)
        for a in range(2):
            seed = seeds[16 * a]
            out[i, :, a] = [texel_scramble(x, seed, mask) for x in net[:, a]]
    return out


def uniform_table(u, v, bins):
    return np.histogram2d(np.ravel(u), np.ravel(v), bins=bins, range=[[0, 1], [0, 1]])[0]


def test_bits():
    rng = np.random.default_rng(0)
    for x, seed in rng.integers(0, 2**32, (300, 2), dtype=np.uint32):
        assert int(reverse_bits(x)) == naive.bits_reversed(int(x))
        assert int(scramble_reversed(x, seed)) == naive.owen_hash(int(x), int(seed))
    low = rng.integers(0, 2**32, 50, dtype=np.uint32)
    for k in (1, 5, 16, 31):
        # The scrambling is nested: the lower k bits of the result depend only on the lower k bits of the
        # input.
        flipped = low ^ np.uint32(rng.integers(0, 2 ** (32 - k)) << k)
        for a, b in zip(low, flipped, strict=True):
            seed = np.uint32(12345)
            assert (int(scramble_reversed(a, seed)) ^ int(scramble_reversed(b, seed))) % 2**k == 0
    # The scrambling permutes the lower 10 bits.
    assert sorted(int(scramble_reversed(np.uint32(i), np.uint32(77))) % 1024 for i in range(1024)) == list(
        range(1024)
    )


def test_hashes_spread():
    value = np.array([int(hash_u32(np.uint32(i))) for i in range(16384)])
    pair = np.array([[int(hash_combine(np.uint32(i), np.uint32(j))) for j in range(64)] for i in range(256)])
    tables = [np.bincount(x.ravel() >> s & 255, minlength=256) for x in (value, pair) for s in (0, 8, 16, 24)]
    naive.assert_uniform(tables)
    assert len(np.unique(value)) == value.size
    assert abs(np.corrcoef(pair[:, :-1].ravel(), pair[:, 1:].ravel())[0, 1]) < 4 / np.sqrt(pair.size)


def assert_net(number, m):
    """Assert that each dyadic box of area 2^-m contains exactly one of the 2^m points `number`."""
    number = np.asarray(number, float)
    assert number.shape == (2**m, 2)
    for k in range(m + 1):
        cell = (number * [2**k, 2 ** (m - k)]).astype(int)
        assert len(np.unique(cell[:, 0] * 2 ** (m - k) + cell[:, 1])) == 2**m, (m, k)


@pytest.mark.parametrize("pair", [1, 5, 7])
@pytest.mark.parametrize("seed", [0, 9])
def test_sequences_are_nets_for_every_texel(seed, pair):
    sequence = sobol_reversed(512, seed, pair)
    for m in range(10):
        mask = shared_bits_mask(2**m)
        for chosen in (NO_BITS, mask):
            for numbers in texel_numbers(sequence[: 2**m], [0, 1, 70000], chosen):
                assert_net(numbers, m)
    # Each aligned block of 2^m points of a sequence is a net, too.
    for m in (4, 6):
        numbers = texel_numbers(sequence, [3], shared_bits_mask(2**m))[0]
        for start in range(0, 512, 2**m):
            assert_net(numbers[start : start + 2**m], m)


def test_sequences_differ_by_seed_and_stage():
    """Two single sequences may be correlated by chance. The mean correlation over 400 seeds is zero."""
    np.testing.assert_array_equal(sobol_reversed(64, 3, 5), sobol_reversed(64, 3, 5))
    numbers = np.array([[sobol_reversed(64, seed, pair) for pair in (5, 6)] for seed in range(400)])
    assert len(np.unique(numbers.reshape(-1, 128), axis=0)) == 800
    number = np.vectorize(lambda x: int(f"{x:032b}"[::-1], 2) / 2**32 - 0.5)(numbers)
    for other in (number[:, 1], np.roll(number[:, 0], 1, axis=0)):
        product = (number[:, 0] * other).mean(axis=1) * 12
        assert (np.abs(product.mean(axis=0)) < 4 * product.std(axis=0) / 20).all()


def test_shared_bits():
    assert [int(shared_bits_mask(n)) for n in (1, 3, 4, 15, 16, 64, 255, 256, 4096)] == [
        0,
        0,
        1,
        1,
        3,
        7,
        7,
        15,
        15,
    ]
    net = sobol_reversed(64, 0, 6)
    numbers = texel_numbers(net, np.arange(40), shared_bits_mask(64))
    cell = (numbers * 8).astype(int)
    assert (cell == cell[0]).all()
    assert len(np.unique(cell[0] @ [8, 1])) == 64


@pytest.mark.parametrize("shared", [False, True])
def test_a_sample_is_uniform_over_texels(shared):
    n = 64
    net = sobol_reversed(n, 0, 6)[::5]
    mask = shared_bits_mask(n) if shared else NO_BITS
    numbers = texel_numbers(net, np.arange(2600), mask).astype(float)
    if shared:
        # Position within the cell of the 8 x 8 grid that all texels share.
        numbers = numbers * 8 % 1
    tables = [uniform_table(*numbers[:, s].T, 8) for s in range(len(net))]
    # Samples of different texels are independent.
    for step in (1, 2, 16):
        for s in (0, 7):
            for a in range(2):
                before, after = numbers[:-step, s, a], numbers[step:, s, a]
                tables.append(uniform_table(before, after, 8))
                assert abs(np.corrcoef(before, after)[0, 1]) < 4 / np.sqrt(len(before))
    naive.assert_uniform(tables)


def test_numbers_stay_below_one():
    highest = np.uint32(0xFFFFFFFF)
    seed = next(
        np.uint32(s) for s in range(1 << 20) if int(scramble_reversed(highest, np.uint32(s))) % 2**10 == 1023
    )
    assert texel_scramble(highest, seed, highest) == np.float32(1 - 2**-24)
    assert texel_scramble(np.uint32(0), np.uint32(0), highest) == 0.0


def test_cosine_directions_are_cosine_weighted():
    point = np.random.default_rng(1).random((100_000, 2), np.float32)
    direction = cosine_directions(point).astype(float)
    # The projection to the disc is uniform, so squared radius and angle are uniform and independent.
    square = 1 - direction[:, 2] ** 2
    angle = np.arctan2(direction[:, 1], direction[:, 0]) / (2 * np.pi) % 1
    naive.assert_uniform([uniform_table(square, angle, 16), uniform_table(square, angle, (2, 64))])
    # z has the mean 2/3 and the variance 1/2 - 4/9 = 1/18. x and y have the mean 0 and the variance 1/4.
    n = len(point)
    assert abs(direction[:, 2].mean() - 2 / 3) < 4 * np.sqrt(1 / 18 / n)
    assert np.abs(direction[:, :2].mean(axis=0)).max() < 4 * np.sqrt(1 / 4 / n)
    np.testing.assert_allclose(np.linalg.norm(direction, axis=1), 1, atol=5e-7)


def test_cosine_direction_is_the_concentric_map():
    rng = np.random.default_rng(2)
    corner = np.array(np.meshgrid(EDGES, EDGES)).reshape(2, -1).T
    point = np.concatenate([rng.random((2000, 2), np.float32), corner])
    direction = cosine_directions(point)
    truth = np.array([naive.cosine_direction(float(u), float(v)) for u, v in point])
    np.testing.assert_allclose(direction[:, :2], truth[:, :2], atol=5e-7)
    # z is the square root of a rounded difference. Near the horizon z is inaccurate, but z squared is not.
    np.testing.assert_allclose(direction[:, 2] ** 2, truth[:, 2] ** 2, atol=5e-7)
    assert (direction[:, 2] >= 0).all()
    np.testing.assert_allclose(np.linalg.norm(direction.astype(float), axis=1), 1, atol=5e-7)
    np.testing.assert_array_equal(cosine_directions(np.float32([[0.5, 0.5]])), [[0, 0, 1]])
    assert cosine_directions(np.zeros((0, 2), np.float32)).shape == (0, 3)


def test_barycentrics_are_uniform():
    point = np.random.default_rng(4).random((60_000, 2), np.float32)
    b1, b2 = np.array([triangle_barycentric(u, v) for u, v in point], float).T
    # P(b1 + b2 < s) = s^2, so (b1 + b2)^2 is uniform. b1 / (b1 + b2) is uniform and independent of it.
    total = b1 + b2
    naive.assert_uniform([uniform_table(total**2, b1 / total, 16)])
    assert min(b1.min(), b2.min()) >= 0
    assert total.max() <= 1
    for u in EDGES:
        for v in EDGES:
            c1, c2 = triangle_barycentric(u, v)
            assert min(c1, c2) >= 0
            assert float(c1) + float(c2) <= 1


def test_frames_are_right_handed():
    rng = np.random.default_rng(6)
    normal = rng.normal(size=(500, 3))
    normal[:8] = [
        [0, 0, 1],
        [0, 0, -1],
        [1, 0, 0],
        [0, -1, 0],
        [1e-7, 0, -1],
        [0, 1e-4, -1],
        [1, 0, -1e-9],
        [1, 1, 0],
    ]
    normal = np.float32(normal / np.linalg.norm(normal, axis=1, keepdims=True))
    for n in normal:
        axes = np.array(tangent_frame(*n), float).reshape(2, 3)
        whole = np.array([*axes, n], float)
        np.testing.assert_allclose(whole @ whole.T, np.eye(3), atol=2e-6)
        assert np.linalg.det(whole) == pytest.approx(1, abs=2e-6)
        np.testing.assert_allclose(whole.T, naive.frame(n), atol=1e-6)
