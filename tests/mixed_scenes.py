"""Makes scenes that together use all features of the path tracer, and are small enough for many passes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scenes import icosphere
from tiny_scenes import Quad, box_quads, grey, quad_scene

from baker.core.scene import Camera, Instance, Material, Mesh, PunctualLight, Scene, Texture
from baker.pathtracer.camera import look_at


def texture(rows, *, linear=False):
    """Return a texture from (H, W, 3) sRGB bytes or linear floats."""
    image = np.array(rows)
    alpha = np.ones((*image.shape[:2], 1))
    if linear:
        return Texture(np.concatenate([image, alpha], axis=2).astype(np.float32))
    return Texture(np.concatenate([image, 255 * alpha], axis=2).astype(np.uint8))


def glossy(base, metallic, roughness, **more):
    return Material(base_colour=(*base, 1.0), metallic=metallic, roughness=roughness, **more)


def smooth_ball(scene: Scene, centre, radius, material, level=1) -> Scene:
    """Return the scene with an added ball of 20 * 4**level triangles and smooth normals."""
    corner = icosphere(level).reshape(-1, 3)
    n = len(corner)
    mesh = Mesh(
        "ball", np.float32(np.array(centre) + radius * corner),
        np.float32(corner / np.linalg.norm(corner, axis=1, keepdims=True)),
        np.arange(n, dtype=np.int32).reshape(-1, 3), np.full(n // 3, len(scene.materials), np.int32),
        np.zeros(n // 3, np.int32), np.zeros(n, np.int32), np.arange(n, dtype=np.int32),
    )  # fmt: skip
    ball = Instance(len(scene.instances), "ball", len(scene.meshes), np.eye(4))
    return replace(
        scene,
        meshes=(*scene.meshes, mesh),
        materials=(*scene.materials, material),
        instances=(*scene.instances, ball),
    )


def glossy_room(lights: tuple[PunctualLight, ...] = ()) -> Scene:
    """Return a room with textured, glossy and mirror walls, a two-sided emitter and two balls."""
    walls = box_quads((0, 0, 0), (2, 2, 2), inward=True)
    tiles = texture([[[230, 60, 60], [90, 160, 90]], [[90, 90, 200], [220, 220, 220]]])
    # The green channel scales roughness, the blue channel metallic.
    finish = texture([[[0, 1.0, 0.0], [0, 0.5, 1.0]], [[0, 0.7, 0.5], [0, 1.0, 0.2]]], linear=True)
    kinds = [
        glossy((0.8, 0.8, 0.8), 0.0, 1.0, base_colour_texture=tiles),
        glossy((0.9, 0.9, 0.9), 1.0, 0.0),
        glossy((0.7, 0.6, 0.5), 1.0, 0.9, metallic_roughness_texture=finish, base_colour_texture=tiles),
        glossy((0.5, 0.5, 0.5), 0.0, 0.0),
        glossy((0.6, 0.6, 0.6), 0.0, 0.5),
        glossy((0.6, 0.6, 0.6), 0.0, 1.0),
    ]
    quads = [replace(quad, material=kind) for quad, kind in zip(walls, kinds, strict=True)]
    quads[5] = replace(quads[5], colour=[[1, 0, 0, 1], [0, 1, 0, 1], [0, 0, 1, 1], [1, 1, 1, 1]])
    emission = texture([[[255, 255, 255], [120, 60, 20]]])
    emitter = Material(
        base_colour=(0.3, 0.3, 0.3, 1.0),
        emission=(6.0, 6.0, 6.0),
        emission_texture=emission,
        double_sided=True,
    )
    quads.append(Quad((0.8, 0.7, 1.5), (0.5, 0, 0), (0, 0.5, 0.1), emitter))
    fin = glossy((0.7, 0.7, 0.2), 0.3, 0.4, double_sided=True)
    quads.append(Quad((0.5, 1.2, 0.0), (0.3, 0.3, 0), (0, 0, 0.7), fin))
    scene = replace(quad_scene(quads), lights=lights)
    scene = smooth_ball(scene, (1.4, 1.4, 0.4), 0.35, glossy((0.95, 0.9, 0.8), 1.0, 0.0))
    return smooth_ball(scene, (0.5, 0.6, 0.4), 0.3, glossy((0.8, 0.5, 0.3), 1.0, 0.35))


def open_yard() -> Scene:
    """Return ground, wall and glossy ball, with a sun, a spot light and a point light that has a range."""
    quads = [
        Quad((-2, -2, 0), (4, 0, 0), (0, 4, 0), glossy((0.6, 0.5, 0.4), 0.0, 0.6)),
        Quad((-1, 1, 0), (2, 0, 0), (0, 0, 1.5), glossy((0.8, 0.8, 0.8), 0.0, 1.0, double_sided=True)),
        *box_quads((-1.2, -0.4, 0), (-0.5, 0.3, 0.6), inward=False, material=grey(0.5)),
    ]
    sun = PunctualLight("directional", "sun", 0, (2.0, 1.8, 1.5), direction=(0.36, 0.48, -0.8))
    spot = PunctualLight("spot", "spot", 1, (3.0, 4.0, 5.0), (0.8, -0.5, 2.0), (0.0, 0.6, -0.8), 0.2, 0.5)
    bulb = PunctualLight("point", "bulb", 2, (0.5, 0.4, 0.3), (-0.8, 0.6, 1.0), range=1.6)
    scene = replace(quad_scene(quads), lights=(sun, spot, bulb))
    # Roughness is not lower, because eye paths rarely find the light of a point light in a narrow lobe.
    return smooth_ball(scene, (0.6, 0.2, 0.5), 0.45, glossy((0.9, 0.9, 0.9), 1.0, 0.5))


ROOM_CAMERA: Camera = look_at((0.15, 1.0, 1.2), (1.6, 1.0, 0.6), 75.0)
YARD_CAMERA: Camera = look_at((0.3, -2.6, 1.6), (0.0, 0.2, 0.4), 50.0)
