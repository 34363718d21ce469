# mypy: disable-error-code="no-untyped-def"
"""Kernels that restore the light that the denoiser removed from a page, by sums over blocks of texels.

The page is divided into blocks. A group is the set of chosen texels of one chart in one block. The window of
a group consists of the groups of the same chart in the surrounding 5 x 5 blocks.
"""

from __future__ import annotations

from baker.trace.jit import inner, kernel, larger, smaller

# BLOCK: side of a block, texels. REACH: half side of a window, blocks. The weight of a block in a window
# falls linearly with its distance from the window's centre.
BLOCK, REACH = 8, 2
# Weighted number of texels in a window. With this number, half of the missing light is restored.
HALF = 30.0
# Smallest and largest relative change of a texel.
LEAST, MOST = -0.5, 1.0


@kernel
def group_blocks(chart, chosen, label, first, owner):
    """Number the groups in the order of their blocks; return the number of groups.

    chart : (H, W) int32; chosen : (H, W) bool
    label : (H, W) int32, receives the group of each texel, -1 for none
    first : (blocks + 1,) int64, receives the first group of each block
    owner : (n,) int32 for n chosen texels, receives the chart of each group in its first entries
    """
    height, width = chart.shape
    across, n = (width + BLOCK - 1) // BLOCK, 0
    for block in range(len(first) - 1):
        first[block] = n
        top, left = block // across * BLOCK, block % across * BLOCK
        for r in range(top, smaller(top + BLOCK, height)):
            for c in range(left, smaller(left + BLOCK, width)):
                label[r, c] = -1
                if not chosen[r, c]:
                    continue
                group = _group_of(first[block], n, owner, chart[r, c])
                if group < 0:
                    group = n
                    owner[n] = chart[r, c]
                    n += 1
                label[r, c] = group
    first[len(first) - 1] = n
    return n


@inner
def _group_of(begin, end, owner, chart):
    """Return the group of `chart` among the groups `begin` to `end - 1`, or -1.

    owner : (n,) int32, chart of each group
    """
    for group in range(begin, end):
        if owner[group] == chart:
            return group
    return -1


@kernel
def sum_groups(noisy, filtered, label, light, sums):
    """For each group, sum the light that the denoiser removed and kept, divided by the mean light.

    noisy, filtered : (H, W, C) float32; label : (H, W) int32, group of each texel or -1
    light : (G, 2) float64 zeros, receives for each group the sum of `filtered` over texels and channels, and
        the number of texels; the quotient of both is the mean light
    sums : (G, 2 C + 1) float64 zeros, receives for each group the C sums of (noisy - filtered) / mean light,
        the C sums of filtered / mean light, and the number of texels
    """
    height, width, channels = noisy.shape
    for r in range(height):
        for c in range(width):
            group = label[r, c]
            if group >= 0:
                light[group, 1] += 1.0
                for j in range(channels):
                    light[group, 0] += filtered[r, c, j]
    for r in range(height):
        for c in range(width):
            group = label[r, c]
            if group < 0 or light[group, 0] <= 0.0:
                continue
            weight = light[group, 1] / light[group, 0]
            for j in range(channels):
                sums[group, j] += weight * (float(noisy[r, c, j]) - float(filtered[r, c, j]))
                sums[group, channels + j] += weight * float(filtered[r, c, j])
            sums[group, 2 * channels] += 1.0


@kernel
def missing_shares(first, owner, across, sums, share):
    """Write the relative change of each group, which restores the light removed in the group's window.

    The change is (removed / kept) * n / (n + HALF), where `removed` and `kept` are weighted sums of light
    over the window, and n is its weighted number of texels. The factor n / (n + HALF) reduces the change if
    the window has few texels, because the sums over such windows are noisy.

    share : (G, C) float64 output, relative change, limited to LEAST and MOST
    first : (blocks + 1,) int64, first group of each block; owner : (n,) int32, chart of each group
    across : int, number of blocks in a row of blocks
    sums : (G, 2 C + 1) float64, from `sum_groups`
    """
    channels = share.shape[1]
    blocks = len(first) - 1
    for block in range(blocks):
        row, column = block // across, block % across
        for group in range(first[block], first[block + 1]):
            for j in range(channels):
                taken = left = n = 0.0
                for y in range(larger(row - REACH, 0), smaller(row + REACH + 1, blocks // across)):
                    for x in range(larger(column - REACH, 0), smaller(column + REACH + 1, across)):
                        b = y * across + x
                        other = _group_of(first[b], first[b + 1], owner, owner[group])
                        if other < 0:
                            continue
                        w = (REACH + 1.0 - abs(y - row)) * (REACH + 1.0 - abs(x - column))
                        w /= (REACH + 1.0) * (REACH + 1.0)
                        taken += w * sums[other, j]
                        left += w * sums[other, channels + j]
                        n += w * sums[other, 2 * channels]
                if left > 0.0:
                    share[group, j] = smaller(larger(taken / left * n / (n + HALF), LEAST), MOST)


@kernel
def add_shares(label, first, owner, across, share, page):
    """Multiply each texel of a page by 1 + share, with shares interpolated bilinearly between block centres.

    If a neighbouring block has no group of the same chart, the share of the texel's own group is used
    instead.

    label : (H, W) int32, first : (blocks + 1,) int64, owner : (n,) int32, from `group_blocks`
    across : int, number of blocks in a row of blocks
    share : (G, C) float64, from `missing_shares`
    page : (H, W, C) float32, changed in place
    """
    height, width, channels = page.shape
    down = (len(first) - 1) // across
    for r in range(height):
        for c in range(width):
            group = label[r, c]
            if group < 0:
                continue
            row, column = r // BLOCK, c // BLOCK
            v, u = (r % BLOCK + 0.5) / BLOCK - 0.5, (c % BLOCK + 0.5) / BLOCK - 0.5
            y = smaller(larger(row + (1 if v > 0.0 else -1), 0), down - 1)
            x = smaller(larger(column + (1 if u > 0.0 else -1), 0), across - 1)
            v, u = abs(v), abs(u)
            chart = owner[group]
            beside = _group_or(row * across + x, first, owner, chart, group)
            below = _group_or(y * across + column, first, owner, chart, group)
            corner = _group_or(y * across + x, first, owner, chart, group)
            for j in range(channels):
                own = (1.0 - v) * ((1.0 - u) * share[group, j] + u * share[beside, j])
                page[r, c, j] *= 1.0 + own + v * ((1.0 - u) * share[below, j] + u * share[corner, j])


@inner
def _group_or(block, first, owner, chart, otherwise):
    """Return the group of `chart` in `block`, or `otherwise` if there is none.

    first : (blocks + 1,) int64, owner : (n,) int32, from `group_blocks`
    """
    group = _group_of(first[block], first[block + 1], owner, chart)
    return group if group >= 0 else otherwise
