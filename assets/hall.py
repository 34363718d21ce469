"""Makes a hall with two rows of columns, balls and rings: 70 000 triangles, most of them in instances.

The hall is lit by a panel, a point light, and the sun through high windows. The file contains no sky; a bake
adds one with `--sky`.
"""

from __future__ import annotations

import math

from glb import GlbBuilder
from shapes import Surface, ball, box, join, lathe, rooms, rounded_box, torus

REST = 0.002
LENGTH, WIDTH, HEIGHT = 24.0, 12.0, 6.0
# Distance between the columns of a row, and distance of the two rows from the middle of the hall, metres.
SPACING, AISLE = 3.0, 3.2


def make_hall() -> GlbBuilder:
    """Return the scene."""
    glb = GlbBuilder()
    glb.material("stone", (0.62, 0.58, 0.5))
    glb.material("floor_stone", (0.38, 0.35, 0.32))
    glb.material("ceiling_paint", (0.8, 0.79, 0.76))
    glb.material("marble", (0.75, 0.74, 0.72), roughness=0.4)
    glb.material("terracotta", (0.56, 0.22, 0.12))
    glb.material("bronze_paint", (0.36, 0.25, 0.1), roughness=0.5)
    glb.material("verdigris", (0.16, 0.42, 0.35))
    glb.material("panel", (0.8, 0.8, 0.8), emission=(3800.0, 3600.0, 3300.0))
    _building(glb)
    _columns(glb)
    _balls_and_rings(glb)
    sides = ("-x", "+x", "+y", "-z", "+z")
    panel = [
        (box((3.0, 0.08, 1.2), faces=sides), "marble"),
        (box((3.0, 0.08, 1.2), faces=("-y",)), "panel"),
    ]
    glb.place("panel", glb.mesh("panel", panel), (-6.0, HEIGHT - 0.4, 0.0))
    glb.light("lantern", "point", 900.0, colour=(1.0, 0.72, 0.42), at=(7.5, 3.2, 0.0))
    glb.light("sun", "directional", 30000.0, colour=(1.0, 0.95, 0.87), towards=(0.25, -0.72, -0.65))
    glb.camera((-10.8, 1.9, 0.6), (4.0, 1.5, -0.4), 62.0)
    return glb


def _building(glb: GlbBuilder) -> None:
    half_x, half_z, wall = LENGTH / 2, WIDTH / 2, 0.4
    # Put one high window into each bay of the long wall at +z, from where the sun shines.
    edges = [
        round(-half_x + SPACING * bay + offset, 3)
        for bay in range(int(LENGTH / SPACING))
        for offset in (0.9, 2.1)
    ]

    def solid(x: float, y: float, z: float) -> str | None:
        if y < 0.0:
            return "floor_stone"
        if y > HEIGHT:
            return "ceiling_paint"
        if abs(x) < half_x and abs(z) < half_z:
            return None
        in_bay = 0.9 < (x + half_x) % SPACING < 2.1
        if z > half_z and abs(x) < half_x and in_bay and 3.2 < y < 5.2:
            return None
        return "stone"

    grid = (
        [-half_x - wall, -half_x, *edges, half_x, half_x + wall],
        [-wall, 0.0, 3.2, 5.2, HEIGHT, HEIGHT + wall],
        [-half_z - wall, -half_z, half_z, half_z + wall],
    )
    names = {"floor_stone": "floor", "stone": "walls", "ceiling_paint": "ceiling"}
    for material, surface in rooms(grid, solid).items():
        glb.place(names[material], glb.mesh(names[material], [(surface, material)]))


def _column() -> Surface:
    """Return a column: a lathed base, shaft with entasis, rings and capital, between two slabs."""
    shaft = []
    for k in range(13):
        share = k / 12
        shaft.append((0.27 - 0.05 * share**2 + 0.012 * math.sin(math.pi * share), 0.42 + 4.6 * share))
    round_foot = [(0.36 + 0.04 * math.sin(math.pi * k / 6), 0.2 + 0.16 * k / 6) for k in range(7)]
    echinus = [(0.23 + 0.13 * math.sin(math.pi / 2 * k / 6), 5.1 + 0.25 * (k / 6) ** 2) for k in range(7)]
    profile = [
        (0.0, 0.2),
        *round_foot,
        (0.29, 0.38),
        *shaft,
        (0.25, 5.04),
        (0.25, 5.08),
        *echinus,
        (0.0, 5.35),
    ]
    plinth = box((0.84, 0.196, 0.84))
    abacus = rounded_box((0.86, HEIGHT - 5.36 - 2 * REST, 0.86), 0.02, 2).moved((0.0, 5.354, 0.0))
    return join(plinth, lathe(profile, 34), abacus)


def _columns(glb: GlbBuilder) -> None:
    column = glb.mesh("column", [(_column(), "marble")])
    bays = int(LENGTH / SPACING) - 1
    for row, z in (("left", -AISLE), ("right", AISLE)):
        for k in range(bays):
            x = -LENGTH / 2 + SPACING * (k + 1)
            glb.place(f"column_{row}_{k}", column, (x, REST, z))


def _balls_and_rings(glb: GlbBuilder) -> None:
    plinth = glb.mesh("plinth", [(rounded_box((0.9, 0.8, 0.9), 0.03, 2), "stone")])
    kinds = [
        glb.mesh(f"ball_{name}", [(ball(0.45, 3), name)]) for name in ("terracotta", "marble", "verdigris")
    ]
    ring = glb.mesh("ring", [(torus(0.5, 0.15, 56, 24), "bronze_paint")])
    for k in range(4):
        x = -9.0 + 6.0 * k
        for side, z in (("left", -4.9), ("right", 4.9)):
            name = f"{side}_{k}"
            glb.place(f"plinth_{name}", plinth, (x, REST, z))
            if (k + (z > 0)) % 2:
                glb.place(f"ball_{name}", kinds[k % 3], (x, 0.8 + 2 * REST + 0.45, z))
            else:
                # Stack two rings, the upper one smaller.
                glb.place(f"ring_{name}", ring, (x, 0.8 + 2 * REST + 0.15, z))
                glb.place(f"ring_{name}_top", ring, (x, 1.19, z), scale=0.75)
    for k, (x, z, radius) in enumerate(
        ((-7.8, 0.9, 1.0), (-4.4, -1.2, 1.3), (0.4, 0.7, 1.6), (4.9, -0.8, 1.1))
    ):
        glb.place(f"ball_floor_{k}", kinds[(k + 1) % 3], (x, round(0.45 * radius + REST, 4), z), scale=radius)
    glb.place("ring_floor", ring, (7.5, 0.15 * 2.2 + REST, 0.0), scale=2.2)
