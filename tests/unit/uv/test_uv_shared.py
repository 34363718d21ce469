"""Instances that share TEXCOORD_1: which do, how large they are, and the gaps between their charts."""

from __future__ import annotations

import numpy as np
import pytest
from uv_scenes import box_mesh, make_scene, place, torus_mesh
from uv_truth import check_contract, least_gap, owner_maps

import baker
from baker.core.atlas import page_uv


def turned(angle: float, scale=1.0, x: float = 0.0) -> np.ndarray:
    matrix = place(x, scale)
    c, s = np.cos(angle), np.sin(angle)
    matrix[:3, :3] = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]) @ matrix[:3, :3]
    return matrix


def unwrap(scene, **settings):
    return baker.unwrap(scene, threads=1, **settings)


def numbers(atlas) -> list[int | None]:
    return [None if layout.shared is None else layout.shared.number for layout in atlas.layouts]


@pytest.mark.parametrize("padding", [2, 5])
def test_charts_of_instances_of_any_size_keep_the_padding(padding):
    scene = make_scene(
        [torus_mesh(), box_mesh()],
        [(0, place()), (0, place(5, 2.3)), (0, turned(0.4, (-1, 1, 1), 9)), (1, place(12))],
    )
    atlas = unwrap(scene, resolution=128, padding=padding)
    check_contract(atlas, scene)
    assert atlas.warnings == ()
    assert least_gap(owner_maps(atlas)[0], padding) == padding
    assert numbers(atlas) == [0, 0, 0, None]
    for layout in atlas.layouts[:3]:
        shared = layout.shared
        assert shared.uv is atlas.layouts[0].shared.uv
        assert 0 <= shared.uv.min() <= shared.uv.max() == 1
        assert np.array_equal(layout.uv, page_uv(shared.uv, shared.scale, shared.offset))


def test_sizes_of_instances_are_their_scales_in_the_page():
    sizes = [1.0, 1.3, 2.0, 3.0]
    atlas = unwrap(make_scene([box_mesh()], [(0, place(4 * k, s)) for k, s in enumerate(sizes)]))
    scale = np.array([layout.shared.scale[0] for layout in atlas.layouts])
    assert scale / scale[0] == pytest.approx(np.array(sizes), rel=1e-6)
    assert len(set(numbers(atlas))) == 1


def test_an_instance_more_than_four_times_as_large_has_a_layout_of_its_own():
    atlas = unwrap(make_scene([box_mesh()], [(0, place(0)), (0, place(3)), (0, place(9, 5.0))]))
    assert numbers(atlas) == [0, 0, 1]
    small, _, large = atlas.layouts
    assert np.array_equal(small.vertex, large.vertex), "both have the same charts"
    side = [np.ptp(layout.uv[layout.triangle[0]].astype(float), axis=0).max() for layout in (small, large)]
    assert side[1] / side[0] == pytest.approx(5.0, rel=0.05)


def test_slightly_stretched_instances_share_and_others_do_not():
    matrices = [place(), place(3, (1, 1.5, 1)), place(6, (1, 6, 1)), turned(1.0, (1, 6, 1), 9)]
    atlas = unwrap(make_scene([box_mesh()], [(0, matrix) for matrix in matrices]))
    assert numbers(atlas) == [0, 0, 1, 1]
    # The area of the box with edges 1, 1.5 and 1 m is 8 / 6 of that of the cube.
    first, second = (layout.shared.scale[0] for layout in atlas.layouts[:2])
    assert second / first == pytest.approx(np.sqrt(8 / 6), rel=1e-5)


def test_meshes_with_one_instance_and_the_setting_unique_share_nothing():
    single = make_scene([box_mesh(), torus_mesh()], [(0, place()), (1, place(4))])
    assert numbers(unwrap(single)) == [None, None]
    pair = make_scene([box_mesh()], [(0, place()), (0, place(4))])
    assert numbers(unwrap(pair, instances="unique")) == [None, None]
    assert numbers(unwrap(pair)) == [0, 0]
