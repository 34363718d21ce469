"""`unwrap` handles a requested density, several pages, and more charts than the pages can hold."""

from __future__ import annotations

import numpy as np
import pytest
from uv_scenes import box_mesh, make_scene, place
from uv_truth import check_contract, least_gap, owner_maps

from baker.core.errors import InputError
from baker.core.settings import make_settings
from baker.uv.unwrap import unwrap_scene


def boxes(n: int, size: float = 1.0):
    return make_scene([box_mesh()], [(0, place(3.0 * k, size)) for k in range(n)])


def unwrap(scene, **settings):
    atlas = unwrap_scene(scene, make_settings(settings))
    check_contract(atlas, scene)
    return atlas


def codes(atlas) -> list[str]:
    return [warning.code for warning in atlas.warnings]


def test_density_is_exact_and_overflows_into_pages():
    atlas = unwrap(boxes(40), resolution=256, density=32, padding=2, instances="unique")
    assert codes(atlas) == []
    assert {layout.texels_per_metre for layout in atlas.layouts} == {32.0}
    # 40 boxes with 6 charts of (32 + 1 + 2)^2 texels need at least 4.5 pages of 256^2 texels.
    assert 5 <= atlas.n_pages <= 6
    assert {layout.page for layout in atlas.layouts} == set(range(atlas.n_pages))
    for layout in atlas.layouts:
        side = np.ptp((layout.uv[layout.triangle] * 256).astype(float), axis=1)
        np.testing.assert_allclose(side, 32, atol=1e-3)
    for owner in owner_maps(atlas):
        assert least_gap(owner, 2) == 2


def test_density_that_fits_one_page_takes_one():
    atlas = unwrap(boxes(3), resolution=256, density=20)
    assert (atlas.n_pages, atlas.layouts[0].texels_per_metre, codes(atlas)) == (1, 20.0, [])


@pytest.mark.parametrize("max_pages", [1, 3])
def test_too_few_pages_lower_the_density_of_all(max_pages):
    atlas = unwrap(boxes(40), resolution=256, density=32, padding=2, max_pages=max_pages)
    assert atlas.n_pages == max_pages
    assert codes(atlas) == ["uv.density_lowered"]
    got = {layout.texels_per_metre for layout in atlas.layouts}
    assert len(got) == 1
    # The requested density needs 5 to 6 pages, and density is proportional to the square root of page area.
    # The factor 0.75 allows for imperfect packing.
    assert 32 * np.sqrt(max_pages / 5) * 0.75 < got.pop() < 32


def test_an_object_too_large_for_a_page_alone_is_lowered():
    scene = make_scene([box_mesh()], [(0, place(0)), (0, place(20, 12.0)), (0, place(40))])
    atlas = unwrap(scene, resolution=256, density=16)
    small, large, other = atlas.layouts
    assert small.texels_per_metre == other.texels_per_metre == 16.0
    assert 4 < large.texels_per_metre < 16
    assert [(w.code, w.object) for w in atlas.warnings] == [("uv.density_lowered", "object 1")]


def test_more_charts_than_a_page_holds_go_to_more_pages():
    atlas = unwrap(boxes(60), resolution=64, padding=2)
    assert atlas.n_pages > 1
    assert codes(atlas) == ["uv.more_pages"]


def test_padding_gives_way_before_pages_do():
    atlas = unwrap(boxes(20), resolution=64, padding=12)
    assert atlas.n_pages == 1
    assert codes(atlas) == ["uv.padding_reduced"]
    assert least_gap(owner_maps(atlas)[0], 2) == 2


def test_more_charts_than_all_pages_hold_are_refused():
    with pytest.raises(InputError, match="raise `resolution`"):
        unwrap_scene(boxes(60), make_settings({"resolution": 16, "max_pages": 2}))


def test_the_page_is_filled():
    # The density is nearly the largest possible: with 4 % more, the boxes need two pages.
    atlas = unwrap(boxes(30), resolution=256, padding=2, instances="unique")
    density = atlas.layouts[0].texels_per_metre
    more = unwrap(boxes(30), resolution=256, padding=2, density=density * 1.04, instances="unique")
    assert more.n_pages == 2
    # A row of 254 texels has 14 of the 180 charts, so a chart has 254 // 14 = 18 texels, 2 of them empty. The
    # first and the last of the other 16 texel centres are 15 texels apart.
    assert np.ptp(atlas.layouts[0].uv[:4, 0]) * 256 == pytest.approx(254 // 14 - 3, abs=1e-3)
