"""Makes two rooms joined by a doorway: sun through a window lights one, a ceiling panel the other."""

from __future__ import annotations

import math

import numpy as np
from glb import GlbBuilder
from numpy.typing import NDArray
from shapes import Surface, ball, box, join, lathe, rooms, rounded_box, torus

# Gap between objects that would touch, metres. It is needed because the light of coincident surfaces is
# undefined.
REST = 0.002
HEIGHT = 2.6


def make_interior() -> GlbBuilder:
    """Return the scene: a furnished living room and a furnished study, with walls 20 cm thick."""
    glb = GlbBuilder()
    _materials(glb)
    _building(glb)
    _living_room(glb)
    _study(glb)
    glb.light("sun", "directional", 20000.0, colour=(1.0, 0.93, 0.82), towards=(0.72, -0.62, 0.31))
    glb.camera((4.4, 1.6, 3.75), (0.9, 0.85, 0.9), 60.0)
    return glb


def _materials(glb: GlbBuilder) -> None:
    glb.material("planks", (0.85, 0.85, 0.85), texture=planks())
    glb.material("plaster", (0.78, 0.76, 0.71))
    glb.material("ceiling_paint", (0.82, 0.82, 0.82))
    glb.material("rug", (0.9, 0.9, 0.9), texture=stripes())
    glb.material("fabric", (0.16, 0.28, 0.38))
    glb.material("oak", (0.47, 0.3, 0.16), roughness=0.6)
    glb.material("enamel", (0.75, 0.74, 0.7), roughness=0.3)
    glb.material("clay", (0.58, 0.24, 0.13))
    glb.material("leaf", (0.13, 0.3, 0.08))
    for name, colour in (("red", (0.5, 0.08, 0.06)), ("ochre", (0.6, 0.4, 0.1)), ("navy", (0.07, 0.1, 0.3))):
        glb.material(f"book_{name}", colour)
    glb.material("panel", (0.8, 0.8, 0.8), emission=(2600.0, 2700.0, 2900.0))
    glb.material("bulb", (0.8, 0.8, 0.8), emission=(9000.0, 6200.0, 3300.0))


def _building(glb: GlbBuilder) -> None:
    def solid(x: float, y: float, z: float) -> str | None:
        inside_z = 0.0 < z < 4.0
        living, study = 0.0 < x < 5.0 and inside_z, 5.2 < x < 8.6 and inside_z
        doorway = 5.0 < x < 5.2 and 1.5 < z < 2.4 and y < 2.1
        window = x < 0.0 and 1.1 < z < 3.1 and 0.85 < y < 2.1
        mullion = window and 2.06 < z < 2.14
        if y < 0.0:
            return "planks"
        if y > HEIGHT:
            return "ceiling_paint"
        if living or study or doorway or (window and not mullion):
            return None
        return "plaster"

    grid = (
        [-0.2, 0.0, 5.0, 5.2, 8.6, 8.8],
        [-0.2, 0.0, 0.85, 2.1, HEIGHT, HEIGHT + 0.2],
        [-0.2, 0.0, 1.1, 1.5, 2.06, 2.14, 2.4, 3.1, 4.0, 4.2],
    )
    names = {"planks": "floor", "plaster": "walls", "ceiling_paint": "ceiling"}
    for material, surface in rooms(grid, solid, uv_scale=0.5).items():
        name = names[material]
        glb.place(name, glb.mesh(name, [(surface, material)]))


def _living_room(glb: GlbBuilder) -> None:
    glb.place("rug", glb.mesh("rug", [(box((2.4, 0.012, 1.6), uv_scale=0.8), "rug")]), (2.5, REST, 2.1))
    cushion = rounded_box((0.86, 0.2, 0.8), 0.06, 3).moved((0.0, 0.24, 0.0))
    back = rounded_box((0.86, 0.5, 0.2), 0.07, 3).moved((0.0, 0.46, -0.31))
    seat = glb.mesh("sofa_seat", [(join(cushion, back), "fabric")])
    for k in range(2):
        glb.place(f"sofa_seat_{k}", seat, (2.06 + 0.88 * k, 0.0, 0.52))
    base = box((1.8, 0.16, 0.8)).moved((0.0, 0.06, 0.0))
    arms = [rounded_box((0.18, 0.62, 0.86), 0.05, 3).moved((x, REST, 0.0)) for x in (-1.0, 1.0)]
    glb.place(
        "sofa_frame", glb.mesh("sofa_frame", [(base, "oak"), (join(*arms), "fabric")]), (2.5, 0.0, 0.52)
    )
    glb.place("coffee_table", glb.mesh("coffee_table", [(_round_table(0.45, 0.4), "oak")]), (2.5, 0.016, 2.1))
    bowl = [
        (0.0, 0.0),
        (0.06, 0.0),
        (0.1, 0.02),
        (0.145, 0.06),
        (0.16, 0.1),
        (0.15, 0.1),
        (0.13, 0.06),
        (0.08, 0.025),
    ]
    glb.place("bowl", glb.mesh("bowl", [(lathe([*bowl, (0.0, 0.018)], 40), "enamel")]), (2.42, 0.42, 2.05))
    fruit = glb.mesh("fruit", [(ball(0.042, 2), "book_ochre")])
    for k, (x, z) in enumerate(((-0.05, 0.01), (0.046, 0.035), (0.02, -0.055))):
        glb.place(f"fruit_{k}", fruit, (2.42 + x, 0.4895, 2.05 + z))
    _standing_light(glb, (4.5, REST, 0.5))
    _plant(glb, (0.55, REST, 3.5))
    _bookcase(glb, (4.78, REST, 3.2))


def _study(glb: GlbBuilder) -> None:
    legs = [box((0.06, 0.71, 0.06)).moved((x, 0.0, z)) for x in (-0.72, 0.72) for z in (-0.32, 0.32)]
    desk = join(rounded_box((1.6, 0.04, 0.76), 0.012, 3).moved((0.0, 0.712, 0.0)), *legs)
    glb.place("desk", glb.mesh("desk", [(desk, "oak")]), (7.0, REST, 0.5))
    chair = glb.mesh("chair", [(_chair(), "oak")])
    for k, (x, z, turn) in enumerate(((7.0, 1.25, 172.0), (6.0, 3.4, 24.0), (7.9, 3.3, -38.0))):
        glb.place(f"chair_{k}", chair, (x, REST, z), turn=turn)
    glb.place("stool", glb.mesh("stool", [(_round_table(0.22, 0.45), "oak")]), (8.1, REST, 1.6))
    mug = [
        (0.0, 0.0),
        (0.036, 0.0),
        (0.04, 0.004),
        (0.04, 0.095),
        (0.036, 0.095),
        (0.036, 0.008),
        (0.0, 0.008),
    ]
    handle = torus(0.026, 0.006, 24, 10)
    # Swap y and z to make the flat torus an upright handle. This reverses the winding, so reverse it again.
    upright = Surface(handle.position[:, [0, 2, 1]], handle.normal[:, [0, 2, 1]], handle.triangle[:, ::-1])
    cup = join(lathe(mug, 32), upright.moved((0.069, 0.05, 0.0)))
    glb.place("mug", glb.mesh("mug", [(cup, "enamel")]), (6.5, 0.757, 0.55), turn=35.0)
    sides = ("-x", "+x", "+y", "-z", "+z")
    panel = [(box((1.2, 0.05, 0.6), faces=sides), "enamel"), (box((1.2, 0.05, 0.6), faces=("-y",)), "panel")]
    glb.place("ceiling_panel", glb.mesh("ceiling_panel", panel), (6.9, HEIGHT - 0.055, 2.0))


def _round_table(radius: float, height: float) -> Surface:
    top = [
        (0.0, height - 0.03),
        (radius - 0.01, height - 0.03),
        (radius, height - 0.02),
        (radius, height - 0.008),
    ]
    top += [(radius - 0.008, height), (0.0, height)]
    foot = [
        (0.0, 0.0),
        (0.6 * radius, 0.0),
        (0.6 * radius, 0.012),
        (0.3 * radius, 0.03),
        (0.035, 0.06),
        (0.03, 0.1),
    ]
    foot += [(0.03, height - 0.08), (0.05, height - 0.035), (0.0, height - 0.032)]
    return join(lathe(top, 48), lathe(foot, 32))


def _chair() -> Surface:
    seat = rounded_box((0.44, 0.04, 0.42), 0.015, 3).moved((0.0, 0.43, 0.0))
    leg = lathe([(0.0, 0.0), (0.013, 0.0), (0.02, 0.3), (0.018, 0.428), (0.0, 0.428)], 12)
    legs = [leg.moved((x, 0.0, z)) for x in (-0.18, 0.18) for z in (-0.17, 0.17)]
    post = lathe([(0.0, 0.472), (0.016, 0.472), (0.012, 0.86), (0.0, 0.862)], 12)
    posts = [post.moved((x, 0.0, -0.185)) for x in (-0.17, 0.0, 0.17)]
    rail = rounded_box((0.42, 0.09, 0.028), 0.012, 3).moved((0.0, 0.864, -0.185))
    return join(seat, rail, *legs, *posts)


def _standing_light(glb: GlbBuilder, at: tuple[float, float, float]) -> None:
    stand = [(0.0, 0.0), (0.14, 0.0), (0.14, 0.015), (0.03, 0.03), (0.011, 0.05), (0.011, 1.42), (0.0, 1.425)]
    # The shade is a truncated cone, open at both ends, whose thin wall is a closed surface.
    shade = [(0.205, 1.3), (0.12, 1.62), (0.117, 1.62), (0.202, 1.3), (0.205, 1.3)]
    parts = [
        (lathe(stand, 32), "oak"),
        (lathe(shade, 48), "enamel"),
        (ball(0.045, 2).moved((0.0, 1.475, 0.0)), "bulb"),
    ]
    glb.place("floor_lamp", glb.mesh("floor_lamp", parts), at)


def _plant(glb: GlbBuilder, at: tuple[float, float, float]) -> None:
    pot = [
        (0.0, 0.0),
        (0.12, 0.0),
        (0.17, 0.3),
        (0.19, 0.3),
        (0.19, 0.34),
        (0.165, 0.34),
        (0.155, 0.3),
        (0.0, 0.3),
    ]
    glb.place("pot", glb.mesh("pot", [(lathe(pot, 40), "clay")]), at)
    leaves = []
    for k in range(9):
        turn, lean = 2.4 * k, 0.12 + 0.015 * k
        size = 0.11 + 0.01 * (k % 3)
        height = 0.48 + 0.075 * k
        leaves.append(ball(size, 2).moved((lean * math.cos(turn), height, lean * math.sin(turn))))
    trunk = lathe([(0.0, 0.302), (0.025, 0.302), (0.018, 1.0), (0.0, 1.0)], 16)
    glb.place("plant", glb.mesh("plant", [(trunk, "oak"), (join(*leaves), "leaf")]), at)


def _bookcase(glb: GlbBuilder, at: tuple[float, float, float]) -> None:
    """Place a bookcase whose front points to -x, and its books."""

    def solid(x: float, y: float, z: float) -> str | None:
        shelf = any(y0 < y < y0 + 0.03 for y0 in (0.0, 0.4, 0.8, 1.2, 1.6))
        return "oak" if shelf or abs(z) > 0.57 or x > 0.13 else None

    levels = sorted(y for y0 in (0.0, 0.4, 0.8, 1.2, 1.6) for y in (y0, round(y0 + 0.03, 3)))
    case = rooms(([-0.15, 0.13, 0.15], levels, [-0.6, -0.57, 0.57, 0.6]), solid)["oak"]
    glb.place("bookcase", glb.mesh("bookcase", [(case, "oak")]), at)
    kinds = []
    for colour, size in (
        ("red", (0.17, 0.24, 0.034)),
        ("ochre", (0.19, 0.28, 0.045)),
        ("navy", (0.16, 0.21, 0.028)),
    ):
        kinds.append((glb.mesh(f"book_{colour}", [(rounded_box(size, 0.004, 1), f"book_{colour}")]), size))
    count = 0
    for shelf in range(4):
        z = -0.55
        while z < 0.42 - 0.1 * shelf:
            mesh, size = kinds[(5 * count + shelf) % 7 % 3]
            z += size[2]
            glb.place(
                f"book_{count}",
                mesh,
                (at[0] + 0.01, at[1] + 0.4 * shelf + 0.032, round(at[2] + z - size[2] / 2, 4)),
            )
            z += 0.003
            count += 1


def planks() -> NDArray[np.uint8]:
    """Return a texture of floor boards, (64, 64, 3) uint8, sRGB."""
    row, column = np.mgrid[0:64, 0:64]
    board = row // 8
    grain = (column * 7 + board * 29 + (row % 8) * (1 + board % 3)) % 16
    shade = 150 + 9 * (board * 5 % 7) + grain
    gap = (row % 8 == 0) | ((column + 23 * board) % 64 == 0)
    shade = np.where(gap, 70, shade)
    return np.stack([shade, shade * 3 // 4, shade // 2], axis=2).astype(np.uint8)


def stripes() -> NDArray[np.uint8]:
    """Return a texture of a woven rug, (64, 64, 3) uint8, sRGB."""
    row, column = np.mgrid[0:64, 0:64]
    colour = np.array([[168, 52, 44], [222, 205, 170], [60, 74, 110], [222, 205, 170]], np.int64)
    weave = 6 * ((row + column) % 2)
    return (colour[(column // 8) % 4] + weave[..., None]).astype(np.uint8)
