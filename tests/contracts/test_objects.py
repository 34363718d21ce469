"""Each setting of objects has the effect that its description promises, with values from closed forms."""

from __future__ import annotations

import json

import numpy as np
import pytest
from gltf_builder import QUAD_TRIANGLE, GltfBuilder, write

import baker
from baker.core.errors import BakerError

SIZE = 64
POWER, HEIGHT = 100.0, 2.0
BLACK, WHITE, PANEL = 0, 1, 2
# Lightmap uv of the objects, (left, top, right, bottom) in texels of a page of `SIZE`.
PLACES = {
    "Floor": (2, 2, 34, 34),
    "Board": (38, 2, 54, 18),
    "Panel": (38, 22, 46, 30),
    "Roof": (2, 38, 18, 54),
    "Wide": (22, 38, 54, 46),
}
FLOOR = np.s_[2:34, 2:34]


class Stage(GltfBuilder):
    """A floor, and objects above it. Fronts are towards the floor, or up if `up`."""

    def __init__(self):
        super().__init__()
        self.json["extensionsUsed"] = ["KHR_lights_punctual"]
        light = {"type": "point", "intensity": POWER}
        self.json["extensions"] = {"KHR_lights_punctual": {"lights": [light]}}
        self.json["materials"] = [
            {"pbrMetallicRoughness": {"baseColorFactor": [c, c, c, 1]}, "emissiveFactor": [e, e, e]}
            for c, e in ((0, 0), (0.8, 0), (0, 1))
        ]
        self.quad("Floor", 4.0, 0.0, up=True)

    def quad(self, name, side, height, material=BLACK, *, up=False, at=(0.0, 0.0), **members):
        """Append a square of `side` metres, parallel to the floor; the axis +Y points up."""
        s, t = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32).T
        position = np.stack([(s - 0.5) * side, np.zeros(4), (0.5 - t) * side if up else (t - 0.5) * side], 1)
        left, top, right, bottom = PLACES[name]
        uv = np.stack([left + s * (right - left), top + t * (bottom - top)], axis=1) / SIZE
        part = self.primitive(
            np.float32(position), QUAD_TRIANGLE, TEXCOORD_1=np.float32(uv), material=material
        )
        mesh = self.mesh(part, name=name)
        return self.node(mesh=mesh, name=name, translation=[at[0], height, at[1]], **members)

    def with_light(self):
        """Append the point light."""
        self.node(name="Bulb", translation=[0, HEIGHT, 0], extensions={"KHR_lights_punctual": {"light": 0}})
        return self


def baked(stage, tmp_path, out=None, **settings):
    """Bake a stage in a small page without denoising."""
    path = write(tmp_path / "stage.glb", stage)
    settings = {"resolution": SIZE, "samples": 64, "padding": 2, "denoise": False, **settings}
    return baker.bake(path, out=None if out is None else tmp_path / out, **settings)


def floor(result, channel="irradiance"):
    """Return the floor's values (32, 32), the mean of all components."""
    return result.lightmaps[channel].value[0][FLOOR].mean(axis=-1)


def from_bulb():
    """Return (32, 32): I cos / r^2 on the floor at the centres of texels."""
    x = (np.arange(32) + 0.5) / 32 * 4.0 - 2.0
    square = x[:, None] ** 2 + x[None] ** 2 + HEIGHT**2
    return POWER * HEIGHT / square**1.5


def test_cast_false_lets_all_light_pass(tmp_path):
    stage = Stage().with_light()
    stage.quad("Board", 1.0, 1.0, WHITE)
    shadow = floor(baked(stage, tmp_path))
    assert shadow[10:22, 10:22].max() == 0.0
    free = baked(stage, tmp_path, object="Board cast=false")
    assert floor(free) == pytest.approx(from_bulb(), rel=0.01)
    assert (floor(free, "ao") == 1.0).all()
    # The board itself still gets light.
    assert np.bincount(free.texel_count > 0).tolist() == [0, 2]


def test_cast_false_emits_nothing_and_says_so(tmp_path):
    stage = Stage()
    stage.quad("Panel", 1.0, 1.0, PANEL)
    assert floor(baked(stage, tmp_path, channels="irradiance")).min() > 0.0
    dark = baked(stage, tmp_path, channels="irradiance", object="Panel cast=false")
    assert (floor(dark) == 0.0).all()
    assert "cast-emission" in {w.code for w in dark.warnings}


def test_cast_false_loses_no_light_of_others(tmp_path):
    """In front of a white roof, an object that no ray hits takes no part of the light of the floor."""
    stage = Stage().with_light()
    stage.quad("Roof", 4.0, 2.5, WHITE)
    alone = floor(baked(stage, tmp_path, samples=256))
    stage.quad("Board", 2.0, 2.4, WHITE)
    beside = floor(baked(stage, tmp_path, samples=256, object="Board cast=false"))
    assert beside.mean() == pytest.approx(alone.mean(), rel=0.01)


def test_receive_false_shadows_and_reflects_without_texels(tmp_path):
    stage = Stage().with_light()
    stage.quad("Board", 1.0, 1.0)
    stage.quad("Roof", 4.0, 2.5, WHITE)
    whole = baked(stage, tmp_path, samples=256)
    part = baked(stage, tmp_path, "out", samples=256, object=["Roof receive=false", "Board receive=false"])
    assert floor(part)[10:22, 10:22].max() < 0.4 * from_bulb().max()
    assert floor(part).mean() == pytest.approx(floor(whole).mean(), rel=0.01)
    assert part.texel_count.tolist() == [32 * 32, 0, 0]
    # Only the floor and its dilation are in the page.
    assert (part.status[0][:, 44:] == 0).all()
    manifest = json.loads((tmp_path / "out" / "bake.json").read_text())
    assert [row["name"] for row in manifest["instances"]] == ["Floor"]
    assert {row["name"]: row["settings"] for row in manifest["objects"]} == {
        "Board": {"receive": False},
        "Roof": {"receive": False},
    }
    before = stage.document()
    after = baker.load(tmp_path / "out" / "scene.glb").source.json
    assert after["meshes"][1:] == before["meshes"][1:]
    assert after["nodes"] == before["nodes"]


def test_nothing_that_receives_is_refused(tmp_path):
    with pytest.raises(BakerError, match="no object is left that gets texels"):
        baked(Stage().with_light(), tmp_path, object="* receive=false")


def test_bounce_false_is_a_bake_with_a_black_object(tmp_path):
    stage, black = Stage().with_light(), Stage().with_light()
    stage.quad("Roof", 4.0, 2.5, WHITE)
    black.quad("Roof", 4.0, 2.5, BLACK)
    lit = floor(baked(stage, tmp_path))
    dull = floor(baked(stage, tmp_path, object="Roof bounce=false"))
    assert lit.mean() > 1.1 * dull.mean()
    assert np.array_equal(dull, floor(baked(black, tmp_path)))
    assert dull == pytest.approx(from_bulb(), rel=0.01)


def test_emissive_false_is_a_bake_with_a_dark_object(tmp_path):
    stage, dark = Stage().with_light(), Stage().with_light()
    stage.quad("Panel", 1.0, 1.0, PANEL)
    dark.quad("Panel", 1.0, 1.0, BLACK)
    lit, off = baked(stage, tmp_path), baked(stage, tmp_path, "out", object="Panel emissive=false")
    assert floor(lit).mean() > floor(off).mean()
    assert np.array_equal(floor(off), floor(baked(dark, tmp_path)))
    assert [light["kind"] for light in off.manifest["lights"]] == ["point"]
    # The material in scene.glb still emits.
    assert baker.load(tmp_path / "out" / "scene.glb").materials[PANEL].emission == (1.0, 1.0, 1.0)


def test_double_sided_changes_the_material_of_one_object(tmp_path):
    """Panels whose fronts point up: only the back of the panel with `double_sided` lights the floor."""
    stage = Stage()
    stage.quad("Panel", 1.0, 1.0, PANEL, up=True)
    stage.quad("Board", 1.0, 1.0, PANEL, up=True, at=(5.0, 0.0))
    assert (floor(baked(stage, tmp_path, channels="irradiance")) == 0.0).all()
    one = floor(baked(stage, tmp_path, channels="irradiance", object="Panel double_sided=true"))
    alone = Stage()
    alone.quad("Panel", 1.0, 1.0, PANEL)
    facing = floor(baked(alone, tmp_path, channels="irradiance", light_samples=64))
    assert one == pytest.approx(facing, rel=0.05)
    alone.json["materials"][PANEL]["doubleSided"] = True
    off = baked(alone, tmp_path, channels="irradiance", object="Panel double_sided=false")
    assert floor(off) == pytest.approx(facing, rel=0.05)


def test_visible_to_ao_false_keeps_shadows(tmp_path):
    stage = Stage().with_light()
    stage.quad("Board", 1.0, 1.0)
    plain = baked(stage, tmp_path, ao_distance="inf")
    hidden = baked(stage, tmp_path, ao_distance="inf", object="Board visible_to_ao=false")
    assert floor(plain, "ao")[15:17, 15:17].max() < 0.85
    assert (floor(hidden, "ao") == 1.0).all()
    assert np.array_equal(floor(hidden), floor(plain))
    only = baked(stage, tmp_path, ao_distance="inf", object="Board cast=false visible_to_ao=true")
    assert floor(only) == pytest.approx(from_bulb(), rel=0.01)
    assert floor(only, "ao") == pytest.approx(floor(plain, "ao"), abs=0.1)
    assert floor(only, "ao").mean() == pytest.approx(floor(plain, "ao").mean(), abs=0.01)


def densities(result):
    """Return the texels per metre of each object by name."""
    pairs = zip(result.scene.instances, result.atlas.layouts, strict=True)
    return {instance.name: layout.texels_per_metre for instance, layout in pairs}


@pytest.mark.parametrize("uv", ["unwrap", "keep"])
@pytest.mark.parametrize("density", [None, 6.0])
def test_density_is_a_factor_or_texels_per_metre(uv, density, tmp_path):
    stage = Stage().with_light()
    stage.quad("Board", 1.0, 1.0)
    stage.quad("Roof", 1.0, 2.5)
    rules = ["Board density=2x", "Roof density=10"]
    result = baked(stage, tmp_path, uv=uv, density=density, channels="ao", object=rules)
    found = densities(result)
    assert found["Board"] == pytest.approx(2.0 * found["Floor"], rel=1e-3)
    assert found["Roof"] == pytest.approx(10.0, rel=1e-3)
    if density is not None:
        assert found["Floor"] == pytest.approx(density, rel=1e-3)
    for k, layout in enumerate(result.atlas.layouts):
        used = layout.uv[layout.triangle].reshape(-1, 2)
        side = {"Floor": 4.0, "Board": 1.0, "Roof": 1.0}[result.scene.instances[k].name]
        assert np.ptp(used, axis=0) * SIZE / side == pytest.approx([layout.texels_per_metre] * 2, rel=0.02)


def test_density_that_does_not_fit_is_lowered_with_a_warning(tmp_path):
    stage = Stage().with_light()
    stage.quad("Board", 1.0, 1.0)
    result = baked(stage, tmp_path, uv="unwrap", channels="ao", object="Board density=500")
    assert densities(result)["Board"] < SIZE
    assert "uv.density_lowered" in {w.code for w in result.warnings}


def test_a_group_has_pages_of_its_own(tmp_path):
    stage = Stage().with_light()
    stage.quad("Board", 1.0, 1.0)
    stage.quad("Roof", 1.0, 2.5)
    plain = baked(stage, tmp_path)
    result = baked(stage, tmp_path, "out", object=["Board group=small", "Roof group=small"])
    rows = {row["name"]: row["page"] for row in result.manifest["instances"]}
    assert rows == {"Floor": 0, "Board": 1, "Roof": 1}
    assert result.status.shape[0] == 2
    assert floor(result) == pytest.approx(floor(plain), rel=0.02, abs=0.02)
    assert (result.status[1][FLOOR] % 2 == 0).all()
    crowded = [f"{name} group={name}" for name in ("Board", "Roof")]
    with pytest.raises(BakerError, match="more groups than `max_pages`"):
        baked(stage, tmp_path, density=4.0, max_pages=2, object=crowded)


def test_samples_multiply_the_rays_of_one_object(tmp_path):
    stage = Stage().with_light()
    stage.quad("Board", 1.0, 1.0, WHITE, up=True)
    few = {"ao_samples": 32, "ao_distance": "inf"}
    plain = baked(stage, tmp_path, **few)
    more = baked(stage, tmp_path, **few, object="Floor samples=4")
    board, ground = int(plain.texel_count[1]), int(plain.texel_count[0])
    assert plain.rays["final gather"] == 64 * (ground + board)
    assert more.rays["final gather"] == 64 * (4 * ground + board)
    assert more.rays["ambient occlusion"] == 32 * (4 * ground + board)
    truth = floor(baked(stage, tmp_path, ao_samples=4096, ao_distance="inf"), "ao")
    errors = [np.abs(floor(result, "ao") - truth).mean() for result in (plain, more)]
    assert errors[1] < 0.6 * errors[0]


def test_uv_of_one_object(tmp_path):
    """The TEXCOORD_1 of the square is four times as wide as high; unwrapped uv are square."""
    stage = Stage().with_light()
    stage.quad("Wide", 1.0, 1.0)
    for rule, shape in (("Wide uv=unwrap", 1.0), ("Floor uv=unwrap", 4.0)):
        layout = baked(stage, tmp_path, channels="ao", object=rule).atlas.layouts[1]
        width, height = np.ptp(layout.uv, axis=0)
        assert width / height == pytest.approx(shape, rel=0.05)


def test_exclude_is_a_bake_without_the_object(tmp_path):
    stage, without = Stage().with_light(), Stage().with_light()
    stage.quad("Board", 1.0, 1.0, WHITE)
    one = baked(stage, tmp_path, "out", object="Board exclude=true")
    two = baked(without, tmp_path)
    for channel in ("irradiance", "ao"):
        assert np.array_equal(one.lightmaps[channel].value, two.lightmaps[channel].value)
    after = baker.load(tmp_path / "out" / "scene.glb")
    assert after.source.json["nodes"] == stage.document()["nodes"]
    assert after.source.json["meshes"][1] == stage.document()["meshes"][1]


def test_neutral_settings_change_no_byte(tmp_path):
    stage = Stage().with_light()
    stage.quad("Board", 1.0, 1.0, WHITE)
    stage.quad("Panel", 0.5, 1.5, PANEL)
    neutral = (
        "* receive=true cast=true visible_to_ao=true density=1x group= samples=1 double_sided=false"
        " emissive=true bounce=true uv=auto exclude=false"
    )
    plain = baked(stage, tmp_path, "plain")
    given = baked(stage, tmp_path, "given", object=neutral)
    for channel in ("irradiance", "ao"):
        assert np.array_equal(plain.lightmaps[channel].value, given.lightmaps[channel].value)
    files = [(tmp_path / out / "scene.glb").read_bytes() for out in ("plain", "given")]
    assert files[0] == files[1]


def test_verify_renders_and_compares_a_bake_with_all_settings(tmp_path):
    """The path tracer treats objects as the bake does, by its own code."""
    stage = Stage().with_light()
    stage.quad("Board", 1.0, 1.0, WHITE, at=(1.0, 0.0))
    stage.quad("Roof", 4.0, 2.5, WHITE)
    stage.quad("Panel", 0.5, 1.5, PANEL, at=(-1.0, 0.0))
    rules = ["Board cast=false visible_to_ao=true", "Roof receive=false", "Panel double_sided=true group=b"]
    for rule in (
        rules,
        ["Roof bounce=false samples=2", "Board receive=false bounce=false", "Panel emissive=no"],
    ):
        baked(stage, tmp_path, "out", samples=256, object=rule)
        report = baker.verify(
            tmp_path / "out", texels=150, spp=128, fail_if="irradiance.bias > 0.02, ao.bias > 0.02"
        )
        assert report.passed, report.problems
        median = report.channels["irradiance"].metrics["median"]
        assert median < 0.05
    assert baker.diff(tmp_path / "out", tmp_path / "out", fail_if="irradiance.max > 0").passed
