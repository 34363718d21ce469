"""Coloured BLEND surfaces multiply the light that passes through them by one factor for each crossing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from test_alpha import shaded
from tiny_scenes import Quad, grey

from baker.core.scene import Texture
from baker.kernels.transmittance import trace_transmittance, transmittance
from baker.shading.ray_tree import build_ray_tree
from baker.shading.transmittance import build_transmittance_table
from baker.trace.jit import kernel
from baker.trace.packets import (
    DIR_X,
    GEOM_ID,
    NO_HIT,
    ORG_X,
    PACKET_WIDTH,
    TFAR,
    new_packet_buffers,
    trace_lanes,
)

COLOUR = (1.0, 0.5, 0.0)


def pane(z=0.0, colour=COLOUR, alpha=0.5, mode="BLEND", rgba=None, vertex=None):
    """Return a unit square at z that faces +z.

    `rgba` (H, W, 4) is its texture, with linear colours, and `vertex` (4, 4) its vertex colours.
    """
    texture = None if rgba is None else Texture(np.float32(rgba), wrap=("clamp", "clamp"))
    material = replace(grey(), base_colour=(*colour, alpha), base_colour_texture=texture, alpha_mode=mode)
    return Quad((0, 0, z), (1, 0, 0), (0, 1, 0), material, vertex)


def tree(quads):
    return build_ray_tree(*shaded(quads), threads=1)


@kernel
def _cast(buffers, origin, direction, far, any_hit, end, kept):
    """Trace n rays in packets of 16.

    Write the distance at which each ray ends to `end` (n,), and its colour factor to `kept` (n, 3).
    """
    on, rays, words, width = buffers.lane_valid, buffers.lane_floats, buffers.lane_words, buffers.width
    function = buffers.occluded if any_hit else buffers.intersect
    for group in range(0, len(origin), PACKET_WIDTH):
        for lane in range(PACKET_WIDTH):
            i = min(group + lane, len(origin) - 1)
            # Every third ray is not traced.
            on[lane] = -1 if group + lane < len(origin) and i % 3 < 2 else 0
            for a in range(3):
                rays[(ORG_X + a) * PACKET_WIDTH + lane] = origin[i, a]
                rays[(DIR_X + a) * PACKET_WIDTH + lane] = direction[i, a]
            rays[TFAR * PACKET_WIDTH + lane] = far
            words[GEOM_ID * PACKET_WIDTH + lane] = NO_HIT
        trace_lanes(function, buffers.scene, width, buffers.query, on, rays, buffers.valid, buffers.floats)
        # An any-hit query does not write the rows of hits, so they must not be read.
        if any_hit:
            trace_transmittance(
                buffers.blend, buffers.occluded, width, on, rays, None, buffers.valid, buffers.floats
            )
        else:
            trace_transmittance(
                buffers.blend, buffers.occluded, width, on, rays, words, buffers.valid, buffers.floats
            )
        for lane in range(PACKET_WIDTH):
            if on[lane]:
                end[group + lane] = rays[TFAR * PACKET_WIDTH + lane]
                for c in range(3):
                    kept[group + lane, c] = transmittance(buffers.blend, c, lane)


def cast(rays, n=500, far=100.0, any_hit=False):
    """Trace rays down from z = 5.

    Return, for the m rays that were traced, x and y (m, 2), the distance to the end (m,), and the colour
    factor (m, 3).
    """
    rng = np.random.default_rng(0)
    origin = np.float32(np.column_stack([rng.uniform(0.01, 0.99, (n, 2)), np.full(n, 5.0)]))
    end, kept = np.zeros(n, np.float32), np.zeros((n, 3), np.float32)
    down = np.float32(np.tile([0, 0, -1], (n, 1)))
    _cast(new_packet_buffers(rays.tracer), origin, down, np.float32(far), any_hit, end, kept)
    chosen = np.arange(n) % 3 < 2
    return origin[chosen, :2], end[chosen], kept[chosen]


def test_blend_surfaces_are_chosen_and_told_from_white_ones():
    red = np.ones((2, 2, 4)) * [1, 0, 0, 0.5]
    white = np.ones((2, 2, 4)) * [1, 1, 1, 0.5]
    quads = [
        pane(alpha=1.0),
        pane(mode="OPAQUE"),
        pane(mode="MASK", alpha=0.4),
        pane(alpha=0.0),
        pane(colour=(1, 1, 1)),
        pane(colour=(1, 1, 1), rgba=white, vertex=np.ones((4, 4))),
        pane(colour=(1, 1, 1), rgba=red * [1, 1, 1, 0]),
        pane(),
        pane(colour=(1, 1, 1), rgba=red),
        pane(colour=(1, 1, 1), vertex=np.ones((4, 4)) * [0.5, 1, 1, 1]),
    ]
    table = build_transmittance_table(shaded(quads)[1])
    assert (table.slot >= 0).tolist() == [k in (4, 5, 7, 8, 9) for k in range(10) for _ in range(2)]
    for k in (7, 8, 9):
        assert build_transmittance_table(shaded(quads[k : k + 1])[1]).coloured
        assert tree(quads[k : k + 1]).tracer.coloured
    # White panes do not colour light. Without BLEND triangles, kernels do not compute a transmittance.
    white = tree(quads[:7])
    assert white.tracer.blend_scene is not None
    assert not white.tracer.coloured
    assert build_transmittance_table(shaded(quads[:4])[1]) is None
    assert tree(quads[:4]).tracer.blend_scene is None
    assert new_packet_buffers(tree(quads[:3]).tracer).blend is None


@pytest.mark.parametrize("any_hit", [False, True])
def test_each_crossing_on_the_way_multiplies_once(any_hit):
    """Only panes that a ray crosses before its end count, not those below the floor or beyond `far`."""
    floor = [] if any_hit else [Quad((0, 0, -1), (1, 0, 0), (0, 1, 0), grey())]
    quads = [pane(0.0), pane(1.0, (0.2, 0.4, 1.0), 0.25), *floor, pane(-2.0), pane(-50.0)]
    _, end, kept = cast(tree(quads), far=6.5)
    first, second = np.float32([1.0, 0.75, 0.5]), np.float32([0.8, 0.85, 1.0])
    # The surface that stops a ray does not count.
    for length, colour in ((4.0, first * 0 + 1), (5.0, second), (6.0 if floor else 6.5, first * second)):
        there = abs(end - length) < 0.01
        assert there.sum() > 40
        np.testing.assert_allclose(kept[there], np.tile(colour, (there.sum(), 1)), rtol=1e-6)


def test_a_ray_to_any_hit_is_coloured_up_to_its_reach():
    _, end, kept = cast(tree([pane(0.0), pane(-3.0)]), far=6.5, any_hit=True)
    assert (kept[end == 6.5] == np.float32([1.0, 0.75, 0.5])).all()
    assert (end == 6.5).sum() > 100


def test_colour_is_factor_times_texture_times_vertex_colour():
    rgba = np.array([[[0.9, 0.2, 0.4, 0.6]]])
    vertex = np.float32([[1, x, 0.5, 1 - 0.5 * x] for x in (0, 1, 1, 0)])
    where, end, kept = cast(tree([pane(0.0, (0.5, 1.0, 3.0), 0.8, rgba=rgba, vertex=vertex)]))
    x = where[:, :1].astype(float)
    alpha = 0.8 * 0.6 * (1 - 0.5 * x)
    colour = np.minimum([0.5 * 0.9, 0.2, 3.0 * 0.4 * 0.5] * np.column_stack([x * 0 + 1, x, x * 0 + 1]), 1)
    passing = end == 100
    assert passing.sum() > 100
    np.testing.assert_allclose(kept[passing], (1 - alpha * (1 - colour))[passing], rtol=1e-5)
