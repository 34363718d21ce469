"""The scene's TEXCOORD_1 are kept unchanged, packed as one rectangle per object, replaced, or refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from uv_scenes import box_mesh, box_uv, make_mesh, make_scene, place
from uv_truth import check_contract, least_gap, owner_maps

from baker.core.errors import InputError
from baker.core.settings import make_settings
from baker.uv.unwrap import unwrap_scene


def unwrap(scene, **settings):
    atlas = unwrap_scene(scene, make_settings({"resolution": 128, **settings}))
    check_contract(atlas, scene)
    return atlas


def half_uv(side: int) -> np.ndarray:
    return (box_uv() * (0.5, 1.0) + (0.5 * side, 0.0)).astype(np.float32)


@pytest.mark.parametrize("mode", ["auto", "keep"])
def test_disjoint_uv_stays_to_the_byte(mode):
    meshes = [box_mesh(uv=half_uv(0)), box_mesh(uv=half_uv(1))]
    scene = make_scene(meshes, [(0, place()), (1, place(2))])
    atlas = unwrap(scene, uv=mode, padding=1)
    assert (atlas.n_pages, atlas.n_charts) == (1, 12)
    for layout, mesh in zip(atlas.layouts, meshes, strict=True):
        assert layout.kept
        assert layout.uv.tobytes() == mesh.texcoord[1].tobytes()
        np.testing.assert_array_equal(layout.vertex, np.arange(24))
    assert atlas.warnings == ()


def test_kept_uv_with_charts_too_close_is_kept_with_a_warning():
    scene = make_scene([box_mesh(uv=box_uv())], [(0, place())])
    atlas = unwrap(scene, padding=8)
    assert atlas.layouts[0].kept
    assert [w.code for w in atlas.warnings] == ["uv.close"]


@pytest.mark.parametrize("mode", ["auto", "keep"])
def test_objects_that_each_fill_the_square_become_rectangles(mode):
    meshes = [box_mesh(uv=box_uv(0, 1)), box_mesh((2, 2, 2), uv=box_uv(0, 1))]
    scene = make_scene(meshes, [(0, place()), (1, place(3)), (0, place(8))])
    atlas = unwrap(scene, uv=mode, padding=3)
    owner = owner_maps(atlas)[0]
    owner_of = np.zeros(atlas.n_charts + 1, int)
    scales = []
    for layout in atlas.layouts:
        source = meshes[scene.instances[layout.instance].mesh].texcoord[1].astype(float)
        # The object's uv are shifted and scaled, by the same factor for u and v, but not rotated.
        design = np.concatenate([source, np.ones((len(source), 1))], axis=1)
        fit, *_ = np.linalg.lstsq(design, layout.uv.astype(float), rcond=None)
        np.testing.assert_allclose(design @ fit, layout.uv, atol=1e-6)
        np.testing.assert_allclose(fit[:2], np.eye(2) * fit[0, 0], atol=1e-6)
        scales.append(fit[0, 0])
        # Instances of one mesh share its TEXCOORD_1, which stays as it is.
        assert layout.kept == (layout.shared is not None) == (layout.instance != 1)
        owner_of[np.unique(layout.chart) + 1] = layout.instance + 1
    assert least_gap(owner_of[owner], 3) == 3
    # All objects have the same number of texels per area. The edges of the second box are twice as long.
    assert scales[1] / scales[0] == pytest.approx(2.0, rel=1e-5)
    assert scales[2] == pytest.approx(scales[0], rel=1e-5)


def test_an_object_with_bad_uv_is_unwrapped_beside_the_good():
    folded = box_uv()
    folded[4:8] = folded[:4]
    meshes = [box_mesh(uv=folded, name="folded"), box_mesh(uv=box_uv()), box_mesh()]
    scene = make_scene(meshes, [(0, place()), (1, place(2)), (2, place(4))])
    atlas = unwrap(scene)
    owner_maps(atlas)
    assert [(w.code, w.object) for w in atlas.warnings] == [("uv.overlap", "object 0")]
    assert "16.7%" in atlas.warnings[0].message
    assert atlas.n_charts == 18


def broken(kind: str) -> np.ndarray | None:
    uv = box_uv()
    if kind == "overlaps":
        uv[4:8] = uv[:4]
    elif kind == "outside":
        uv[3, 0] = 1.4
    elif kind == "not finite":
        uv[0, 0] = np.nan
    elif kind == "degenerate":
        uv[:] = uv[0]
    elif kind == "collapsed face":
        uv[:4] = uv[0]
    return uv


@pytest.mark.parametrize(
    ("kind", "code", "word"),
    [
        ("overlaps", "uv.overlap", "overlaps itself"),
        ("outside", "uv.out_of_range", "outside 0 to 1"),
        ("not finite", "uv.not_finite", "not finite"),
        ("degenerate", "uv.degenerate", "less than one texel"),
        ("collapsed face", "uv.degenerate", "16.7%"),
    ],
)
def test_bad_uv_is_replaced_in_auto_and_refused_in_keep(kind, code, word):
    scene = make_scene([box_mesh(uv=broken(kind))], [(0, place())])
    atlas = unwrap(scene)
    owner_maps(atlas)
    assert [w.code for w in atlas.warnings] == [code]
    with pytest.raises(InputError, match=word) as caught:
        unwrap(scene, uv="keep")
    assert caught.value.object == "object 0"


def test_keep_refuses_what_has_no_uv():
    with pytest.raises(InputError, match="no TEXCOORD_1"):
        unwrap(make_scene([box_mesh()], [(0, place())]), uv="keep")


def test_unwrap_never_keeps():
    scene = make_scene([box_mesh(uv=box_uv())], [(0, place())])
    atlas = unwrap(scene, uv="unwrap")
    assert not atlas.layouts[0].kept
    # The new charts are squares. In the mesh's TEXCOORD_1 they are rectangles with the aspect ratio 2 : 3.
    uv = atlas.layouts[0].uv[atlas.layouts[0].triangle].astype(float)
    np.testing.assert_allclose(np.ptp(uv[..., 0], axis=1), np.ptp(uv[..., 1], axis=1), rtol=1e-4)


def test_shared_edges_and_rounding_are_no_overlap():
    # A sheet of 64 quads. Its uv are a rotated grid, rounded to 12 bits.
    s, t = (a.ravel() for a in np.meshgrid(np.arange(9) / 8, np.arange(9) / 8, indexing="ij"))
    angle = 0.3
    uv = np.stack([np.cos(angle) * s - np.sin(angle) * t, np.sin(angle) * s + np.cos(angle) * t], axis=1)
    uv = np.round((0.7 * uv + (0.22, 0.02)) * 4096) / 4096
    triangle = [
        triple
        for i in range(8)
        for j in range(8)
        for a, b, c, d in [(9 * i + j, 9 * i + j + 9, 9 * i + j + 10, 9 * i + j + 1)]
        for triple in ((a, b, c), (a, c, d))
    ]
    mesh = make_mesh(np.stack([s, 0 * s, t], axis=1), triangle, "sheet", uv)
    atlas = unwrap(make_scene([mesh], [(0, place())]), uv="keep")
    assert (atlas.layouts[0].kept, atlas.n_charts) == (True, 1)


def test_density_is_not_used_on_kept_pages_and_says_so():
    scene = make_scene([box_mesh(uv=box_uv())], [(0, place())])
    atlas = unwrap(scene, density=5, padding=1)
    assert atlas.layouts[0].kept
    assert "uv.density_unused" in [w.code for w in atlas.warnings]


def test_texels_per_metre_of_kept_uv_is_measured():
    scene = make_scene([box_mesh(uv=box_uv())], [(0, place(0, 2.0))])
    layout = unwrap(scene).layouts[0]
    side = 0.96 * 0.92 / np.sqrt(6.0)
    assert layout.texels_per_metre == pytest.approx(128 * side / 2.0, rel=1e-4)


def test_a_third_set_does_not_matter():
    mesh = box_mesh(uv=box_uv())
    mesh = replace(mesh, texcoord=(None,))
    assert not unwrap(make_scene([mesh], [(0, place())])).layouts[0].kept
