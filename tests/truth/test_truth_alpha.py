"""MASK surfaces pass light where alpha is below the cutoff; white BLEND surfaces pass the share 1 - alpha."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from closed_forms import point_irradiance
from scenes import SceneBuilder, prepared

from baker.core.scene import Texture

SUN = (0.0, -1.0, 0.0)
HIGH = 0.5


def alpha_material(
    builder, mode, alpha=1.0, *, cutoff=0.5, image=None, wrap="clamp", emission=0.0, albedo=0.0
):
    """Add a double-sided material and return its index; `image` (H, W) is the alpha of its texture."""
    number = builder.material(albedo, emission, double_sided=True)
    texture = None
    if image is not None:
        rgba = np.ones((*np.shape(image), 4), np.float32)
        rgba[..., 3] = image
        texture = Texture(rgba, wrap=(wrap, wrap))
    builder.materials[number] = replace(
        builder.materials[number],
        base_colour=(*np.broadcast_to(albedo, 3).tolist(), alpha),
        base_colour_texture=texture,
        alpha_mode=mode,
        alpha_cutoff=cutoff,
    )
    return number


def floor_under(*cards, half=1.0, texels=40, light="directional", **where):
    """Return a builder and its black floor of side 2 x `half`, below square cards 0.1 m above each other.

    cards : a function for each card that adds the card's material to the builder and returns its index
    """
    builder = SceneBuilder(96)
    floor = builder.quad(
        (-half, 0, -half), (0, 0, 2 * half), (2 * half, 0, 0), builder.material(0.0), (texels, texels)
    )
    for k, make in enumerate(cards):
        # Texel columns of the card and of the floor run along z, and their rows run along x.
        builder.quad((-1, HIGH + 0.1 * k, -1), (0, 0, 2), (2, 0, 0), make(builder), (8, 8))
    if light:
        builder.light(light, 1.0, **(where or {"direction": SUN}))
    return builder, floor


def masked(**settings):
    return lambda builder: alpha_material(builder, "MASK", **settings)


def blended(alpha, **settings):
    return lambda builder: alpha_material(builder, "BLEND", alpha, **settings)


def bilinear(image, u, v, wrap):
    """Return the bilinear lookup of an image (H, W) as a sum over tent functions of its pixels."""
    high, wide = image.shape
    total = np.zeros(np.shape(u))
    for row in range(-2 * high, 3 * high):
        for column in range(-2 * wide, 3 * wide):
            weight = np.clip(1 - np.abs(u * wide - 0.5 - column), 0, 1)
            weight = weight * np.clip(1 - np.abs(v * high - 0.5 - row), 0, 1)
            r, c = (
                {
                    "clamp": min(max(i, 0), n - 1),
                    "repeat": i % n,
                    "mirror": i % n if (i // n) % 2 == 0 else n - 1 - i % n,
                }[wrap]
                for i, n in ((row, high), (column, wide))
            )
            total += weight * image[r, c]
    return total


LEAF = np.array([[0.9, 0.1, 0.6], [0.2, 0.4, 1.0], [0.0, 0.8, 0.3], [0.5, 0.7, 0.1]])


@pytest.mark.parametrize("cutoff", [0.3, 0.7])
@pytest.mark.parametrize("wrap", ["clamp", "repeat", "mirror"])
def test_mask_casts_the_shadow_of_its_texture(wrap, cutoff):
    builder, floor = floor_under(masked(image=LEAF, cutoff=cutoff, wrap=wrap))
    mesh = builder.meshes[1]
    spread = mesh.texcoord[0] * np.float32([1.4, 1.2]) - np.float32([0.2, 0.1])
    builder.meshes[1] = replace(mesh, texcoord=(spread, mesh.texcoord[1]))
    found = floor.values(builder.bake(bounces=0))[..., 0]
    point = floor.points(8)
    u, v = (point[..., 2] + 1) / 2 * 1.4 - 0.2, (point[..., 0] + 1) / 2 * 1.2 - 0.1
    lit = bilinear(LEAF, u, v, wrap) < cutoff
    bright, dark = lit.all(axis=2), ~lit.any(axis=2)
    assert bright.sum() > 100
    assert dark.sum() > 100
    assert (found[dark] == 0).all()
    assert np.allclose(found[bright], 1.0, rtol=1e-5)
    assert found.mean() == pytest.approx(lit.mean(), abs=0.004)


@pytest.mark.parametrize(
    ("alpha", "cutoff", "light"), [(0.4, 0.5, 1), (0.5, 0.5, 0), (0.3, 0.3, 0), (0.6, 0.7, 1)]
)
def test_factor_alone_decides_a_mask(alpha, cutoff, light):
    builder, floor = floor_under(masked(alpha=alpha, cutoff=cutoff))
    assert np.allclose(floor.values(builder.bake(bounces=0)), light, rtol=1e-5)


def test_opaque_materials_ignore_alpha():
    image = np.zeros((2, 2))
    builder, floor = floor_under(lambda b: alpha_material(b, "OPAQUE", 0.0, image=image))
    assert (floor.values(builder.bake(bounces=0)) == 0).all()
    world, _ = prepared(builder)
    assert len(world.shading.alpha.slot) == 0


def test_vertex_alpha_counts():
    builder, floor = floor_under(masked(cutoff=0.5))
    mesh = builder.meshes[1]
    # Vertex alpha rises from 0 at x = -1 to 1 at x = 1.
    colour = np.ones((4, 4), np.float32)
    colour[:, 3] = (mesh.position[:, 0] + 1) / 2
    builder.meshes[1] = replace(mesh, colour=colour)
    found = floor.values(builder.bake(bounces=0))[..., 0]
    assert np.allclose(found[:20], 1.0, rtol=1e-5)
    assert (found[20:] == 0).all()


LIGHTS = {
    "sun": {"light": "directional", "direction": SUN},
    "point": {"light": "point", "position": (0.0, 2.0, 0.0)},
    "spot": {
        "light": "spot",
        "position": (0.1, 2.0, 0.0),
        "direction": SUN,
        "inner_cone": 0.4,
        "outer_cone": 0.6,
    },
}


@pytest.mark.parametrize("light", LIGHTS)
@pytest.mark.parametrize(("alpha", "layers"), [(0.25, 2), (0.6, 1), (0.9, 1)])
def test_blend_lets_the_rest_of_alpha_through(light, alpha, layers):
    """Panes multiply E by exactly (1 - alpha)^layers at each texel, also below their diagonals."""
    found, free = (
        floor.values(builder.bake(bounces=0))[..., 0]
        for builder, floor in (
            floor_under(*[blended(alpha, albedo=1.0)] * n, **LIGHTS[light]) for n in (layers, 0)
        )
    )
    assert (free > 0).sum() > 100
    np.testing.assert_allclose(found, free * (1 - alpha) ** layers, rtol=2e-6)
    if light == "point":
        truth = floor_under(light="")[1].texel_mean(lambda p: point_irradiance((0.0, 2.0, 0.0), p, (0, 1, 0)))
        assert (found / truth).mean() == pytest.approx((1 - alpha) ** layers, rel=1e-3)


@pytest.mark.parametrize("alpha", [0.0, 0.25, 1.0])
def test_ambient_occlusion_through_blend(alpha):
    """In a closed box of glass, every ray of the floor crosses one pane."""
    builder = SceneBuilder(96)
    floor = builder.quad((-1, 0, -1), (0, 0, 2), (2, 0, 0), builder.material(0.0), (16, 16))
    builder.box((-2, -1, -2), (2, 1, 2), alpha_material(builder, "BLEND", alpha), 8)
    found = floor.values(builder.bake(channels=["ao"], ao_samples=64, ao_distance="inf"), "ao")
    error = np.sqrt(alpha * (1 - alpha) / found.size / 64)
    assert found.mean() == pytest.approx(1 - alpha, abs=4 * error + 1e-6)


def test_sky_through_blend_and_its_own_reflection():
    """A room of coloured glass is lit by transmitted sky light and by the reflections of this light.

    From each point inside, only glass is visible. Therefore E = T * pi * L + alpha * albedo * E with
    T = (1 - alpha) * (1 - alpha * (1 - albedo)).
    """
    alpha, albedo = 0.4, np.array([0.5, 1.0, 0.0])
    builder = SceneBuilder(96)
    box = builder.box(
        (-1, -1, -1), (1, 1, 1), alpha_material(builder, "BLEND", alpha, albedo=albedo), 16, inward=True
    )
    result = builder.bake(sky=(1.0, 1.0, 1.0), samples=256)
    found = np.mean([side.values(result).mean(axis=(0, 1)) for side in box.values()], axis=0)
    through = (1 - alpha) * (1 - alpha * (1 - albedo))
    assert found == pytest.approx(through * np.pi / (1 - alpha * albedo), rel=0.01)


@pytest.mark.parametrize("mode", ["MASK", "BLEND"])
def test_holes_and_transparency_reduce_emission(mode):
    """With holes in half of its area, or with alpha 0.5, an emitter gives half of its light."""
    image = np.repeat(np.array([[0.0, 1.0]]), 2, axis=0)
    half = masked(image=image, emission=10.0) if mode == "MASK" else blended(0.5, emission=10.0)

    def mean(make):
        builder, floor = floor_under(make, light="")
        result = builder.bake(samples=64, bounces=0)
        return floor.values(result)[..., 0].mean(), builder

    whole, _ = mean(masked(emission=10.0))
    found, _ = mean(half)
    assert found == pytest.approx(whole / 2, rel=0.01)


def test_reciprocity_of_a_leaf_with_holes():
    """A card whose texture hides one half of it lights the floor like a card of half the size.

    The holes of the first card are texels with alpha 0. The second card has triangles for the opaque part
    only.
    """
    image = np.zeros((64, 64))
    image[:, 32:] = 1.0

    def mean(cut):
        builder = SceneBuilder(96)
        floor = builder.quad((-1, 0, -1), (0, 0, 2), (2, 0, 0), builder.material(0.8), (32, 32))
        if cut:
            card = builder.material(0.8, double_sided=True)
            builder.quad((-1, HIGH, 0), (0, 0, 1), (2, 0, 0), card, (16, 32))
        else:
            card = alpha_material(builder, "MASK", image=image, albedo=0.8)
            builder.quad((-1, HIGH, -1), (0, 0, 2), (2, 0, 0), card, (32, 32))
        builder.light("point", 10.0, position=(0.0, 0.25, -0.5))
        return floor.values(builder.bake(samples=256))[..., 0]

    assert mean(cut=False).mean() == pytest.approx(mean(cut=True).mean(), rel=0.004)


def test_same_bytes_on_any_number_of_threads():
    image = np.array([[0.0, 1.0], [0.6, 0.3]])
    builder, _ = floor_under(masked(image=image, albedo=0.5), blended(0.3, albedo=0.5))
    maps = [builder.bake(threads=n, samples=16, sky=(1.0, 1.0, 1.0)).lightmaps for n in (1, 2)]
    assert maps[0]["irradiance"].value.tobytes() == maps[1]["irradiance"].value.tobytes()
