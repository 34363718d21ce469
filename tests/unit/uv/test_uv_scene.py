"""Atlases of whole scenes keep the guarantees of `Atlas` for density, padding, stretch and determinism."""

from __future__ import annotations

import hashlib
from dataclasses import replace

import numpy as np
import pytest
from uv_scenes import (
    ball_mesh,
    bent_mesh,
    box_mesh,
    make_mesh,
    make_scene,
    place,
    torus_mesh,
)
from uv_truth import check_contract, least_gap, owner_maps, stretch

from baker.core.atlas import Atlas
from baker.core.errors import InputError
from baker.core.scene import Material
from baker.core.settings import make_settings
from baker.uv.unwrap import unwrap_scene


def unwrap(scene, **settings) -> Atlas:
    atlas = unwrap_scene(scene, make_settings(settings))
    check_contract(atlas, scene)
    return atlas


def digest(atlas: Atlas) -> str:
    h = hashlib.sha256()
    for layout in atlas.layouts:
        for array in (layout.vertex, layout.uv, layout.triangle, layout.chart):
            h.update(array.tobytes())
        h.update(repr((layout.page, layout.texels_per_metre)).encode())
    return h.hexdigest()


def test_a_box_is_six_undistorted_charts():
    mesh = box_mesh((1.0, 2.0, 3.0))
    scene = make_scene([mesh], [(0, place())])
    atlas = unwrap(scene, resolution=256)
    assert atlas.n_charts == 6
    # Charts are scaled to whole texels, which changes the shortest side, of 1 m, by at most half a texel.
    shortest = atlas.layouts[0].texels_per_metre
    assert np.abs(stretch(atlas.layouts[0], mesh, scene) - 1).max() < 0.6 / shortest + 1e-3


@pytest.mark.parametrize(
    ("mesh", "most_charts", "least", "most"),
    [(ball_mesh(3), 10, 0.8, 1.25), (torus_mesh(), 20, 0.7, 1.35), (bent_mesh(), 4, 0.93, 1.07)],
    ids=["ball", "torus", "strip"],
)
def test_curved_meshes_have_few_charts_and_little_stretch(mesh, most_charts, least, most):
    scene = make_scene([mesh], [(0, place())])
    atlas = unwrap(scene, resolution=512)
    values = stretch(atlas.layouts[0], mesh, scene)
    assert atlas.n_charts <= most_charts
    # At the rims of charts, up to 1 % of the triangles may exceed the limits.
    assert np.quantile(values, 0.01) > least
    assert np.quantile(values, 0.99) < most
    assert atlas.warnings == ()


def test_a_finely_tessellated_ball_is_not_taken_for_a_plane():
    mesh = ball_mesh(5)
    scene = make_scene([mesh], [(0, place())])
    atlas = unwrap(scene, resolution=512)
    values = stretch(atlas.layouts[0], mesh, scene)
    assert np.quantile(values, 0.001) > 0.6
    assert len(atlas.layouts[0].triangle) / atlas.n_charts > 300


def test_density_in_texels_is_what_the_layout_says():
    # The area of a box in texels is its world area times the squared density, for each scale.
    mesh = box_mesh()
    scene = make_scene([mesh], [(0, place(0)), (0, place(3, 2.0)), (0, place(9, (1.0, 2.0, 4.0)))])
    atlas = unwrap(scene, resolution=512)
    density = atlas.layouts[0].texels_per_metre
    for layout, edges in zip(atlas.layouts, [(1, 1, 1), (2, 2, 2), (1, 2, 4)], strict=True):
        assert layout.texels_per_metre == density
        uv = layout.uv[layout.triangle].astype(float) * 512
        e1, e2 = uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]
        texels = 0.5 * np.abs(e1[:, 0] * e2[:, 1] - e1[:, 1] * e2[:, 0]).sum() / density**2
        a, b, c = edges
        assert texels == pytest.approx(2 * (a * b + b * c + c * a), rel=0.02)


def test_mirrored_instances_lie_like_the_others():
    mesh = box_mesh((1.0, 0.5, 2.0))
    scene = make_scene([mesh], [(0, place()), (0, place(5, (-1.0, 1.0, 1.0)))])
    atlas = unwrap(scene, resolution=256)
    first, second = atlas.layouts
    np.testing.assert_array_equal(first.vertex, second.vertex)
    shift = (second.uv - first.uv) * 256
    # The charts of both instances are equal up to a shift by whole texels.
    np.testing.assert_allclose(shift, np.round(shift), atol=1e-3)
    assert np.abs(shift).max() >= 1


def test_two_hundred_instances_each_get_their_own_texels():
    scene = make_scene([box_mesh()], [(0, place(2.0 * k)) for k in range(200)])
    atlas = unwrap(scene, resolution=512, padding=3)
    assert (atlas.n_pages, atlas.n_charts) == (1, 1200)
    owner = owner_maps(atlas)[0]
    assert len(np.unique(owner)) == 1201
    assert least_gap(owner, 3) == 3


@pytest.mark.parametrize("padding", [0, 2, 5])
def test_padding_is_there_and_the_border_is_free(padding):
    meshes = [ball_mesh(2), bent_mesh(), box_mesh()]
    scene = make_scene(meshes, [(0, place()), (1, place(3)), (2, place(6)), (0, place(9, 0.3))])
    atlas = unwrap(scene, resolution=256, padding=padding)
    owner = owner_maps(atlas)[0]
    # A bilinear lookup reads one texel beyond a chart, so charts have at least two texels between them.
    assert least_gap(owner, max(padding, 2)) == max(padding, 2)
    rim = max(1, padding // 2)
    assert owner[:rim].max() == owner[-rim:].max() == owner[:, :rim].max() == owner[:, -rim:].max() == 0
    assert (owner > 0).mean() > 0.45


def test_straight_borders_lie_on_texel_centres():
    scene = make_scene([box_mesh()], [(0, place())])
    texel = unwrap(scene, resolution=128).layouts[0].uv.astype(float) * 128 - 0.5
    np.testing.assert_allclose(texel, np.round(texel), atol=1e-4)


def test_split_normals_do_not_cut_charts_but_keep_their_vertices():
    # `flat` has three separate vertices for each triangle, as importers create them for flat shading.
    smooth = bent_mesh()
    corner = smooth.position[smooth.triangle].reshape(-1, 3)
    flat = make_mesh(corner, np.arange(len(corner)).reshape(-1, 3))
    one = unwrap(make_scene([smooth], [(0, place())]), resolution=128)
    other = unwrap(make_scene([flat], [(0, place())]), resolution=128)
    assert one.n_charts == other.n_charts
    assert len(other.layouts[0].vertex) == len(corner)
    for a, b in zip(one.layouts, other.layouts, strict=True):
        np.testing.assert_array_equal(a.uv[a.triangle], b.uv[b.triangle])


def test_degenerate_duplicate_and_sliver_triangles_all_get_uv():
    box = box_mesh()
    position = np.concatenate([box.position, [[5, 0, 0], [6, 0, 0], [5.5, 1e-6, 0], [8, 0, 0]]])
    bad = [[24, 25, 26], [24, 25, 25], [27, 27, 27], [0, 1, 2], [0, 1, 2], [2, 1, 0]]
    mesh = make_mesh(position, np.concatenate([box.triangle, bad]))
    scene = make_scene([mesh], [(0, place())])
    atlas = unwrap(scene, resolution=256)
    owner_maps(atlas)
    uv = atlas.layouts[0].uv[atlas.layouts[0].triangle].astype(float)
    e1, e2 = uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]
    area = (
        0.5
        * np.abs(e1[:, 0] * e2[:, 1] - e1[:, 1] * e2[:, 0])
        * 256**2
        / atlas.layouts[0].texels_per_metre ** 2
    )
    # The triangles of the box and the three copies have their world area, 0.5 m2.
    np.testing.assert_allclose(np.delete(area, [12, 13, 14]), 0.5, rtol=0.05)


def test_the_unit_of_length_does_not_matter():
    results = [
        unwrap(make_scene([torus_mesh()], [(0, place(0, scale))]), resolution=256)
        for scale in (1.0, 1e-4, 1e4)
    ]
    for other, factor in zip(results[1:], (1e-4, 1e4), strict=True):
        assert other.n_charts == results[0].n_charts
        assert other.layouts[0].texels_per_metre * factor == pytest.approx(
            results[0].layouts[0].texels_per_metre
        )


def test_the_bytes_do_not_depend_on_threads_or_repetition():
    # The scene has more than 3000 triangles, so the unwrap uses worker processes.
    meshes = [torus_mesh(), ball_mesh(3), box_mesh()]
    scene = make_scene(meshes, [(k % 3, place(4.0 * k)) for k in range(6)])
    one, two, again = (unwrap(scene, resolution=256, threads=n) for n in (1, 2, 2))
    assert digest(one) == digest(two) == digest(again)


def test_a_scene_without_triangles_is_refused():
    empty = make_mesh(np.zeros((0, 3)), np.zeros((0, 3), int))
    with pytest.raises(InputError, match="no triangles"):
        unwrap_scene(make_scene([empty], [(0, place())]), make_settings({}))


def test_an_instance_without_triangles_is_passed_over():
    empty = make_mesh(np.zeros((0, 3)), np.zeros((0, 3), int))
    atlas = unwrap(make_scene([empty, box_mesh()], [(0, place()), (1, place())]), resolution=64)
    assert [len(layout.triangle) for layout in atlas.layouts] == [0, 12]


BLACK = (0.0, 0.0, 0.0, 1.0)


@pytest.mark.parametrize(
    ("material", "gives_way"),
    [
        (Material(base_colour=BLACK, emission=(9.0, 9.0, 9.0)), True),
        (Material(base_colour=(1.0, 1.0, 1.0, 0.0), alpha_mode="BLEND"), True),
        (Material(base_colour=BLACK), False),
        (Material(base_colour=(1.0, 1.0, 1.0, 0.0)), False),
        (Material(emission=(9.0, 9.0, 9.0)), False),
    ],
    ids=["black emitter", "invisible", "black", "opaque whatever its alpha", "emitter that reflects"],
)
def test_what_shows_no_light_leaves_the_page_to_the_rest(material, gives_way):
    # The dome surrounds the box and is 100 times as wide.
    scene = make_scene([box_mesh(), box_mesh((100.0, 100.0, 100.0))], [(0, place()), (1, place())])
    dome = replace(scene.meshes[1], material=scene.meshes[1].material + 1)
    scene = replace(scene, meshes=(scene.meshes[0], dome), materials=(Material(), material))
    atlas = unwrap(scene, resolution=256)
    density = [layout.texels_per_metre for layout in atlas.layouts]
    alone = unwrap(make_scene([box_mesh()], [(0, place())]), resolution=256).layouts[0].texels_per_metre
    if gives_way:
        assert density[0] > 0.9 * alone
        # The density of the dome is much lower, but above 0.
        assert 0.0 < density[1] < 0.01 * density[0]
    else:
        assert density[0] == density[1] < 0.02 * alone
    # A requested density applies to all objects.
    dense = unwrap(scene, resolution=256, density=0.5)
    assert [layout.texels_per_metre for layout in dense.layouts] == [0.5, 0.5]
