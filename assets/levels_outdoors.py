"""Makes the outdoor levels: a street, terrain, rocks, trees, a greenhouse, a cave and others."""

from __future__ import annotations

import math

import numpy as np
from level_parts import (
    BLACK,
    CONCRETE,
    PLASTER,
    WOOD,
    Level,
    crossed,
    height,
    house,
    join,
    leaf_picture,
    rock,
    sheet,
    slab,
    smooth,
    terrain,
)  # fmt: skip
from shapes import Surface, ball, lathe

Hole = tuple[float, float, float, float]
DOOR: Hole = (-0.5, 0.0, 0.5, 2.1)
WINDOW: Hole = (-0.8, 0.9, 0.8, 1.9)


def _outdoors(sky: float, sun: float = 0.0, towards: tuple[float, float, float] = (0.4, -0.8, 0.3)) -> Level:
    level = Level((0.8 * sky, sky, 1.3 * sky) if sun else (sky, sky, sky))
    for name, colour in (("plaster", PLASTER), ("concrete", CONCRETE), ("wood", WOOD), ("black", BLACK)):
        level.glb.material(name, colour)
        level.glb.material(f"{name}, both sides", colour, double_sided=True)
    if sun:
        level.glb.light("sun", "directional", sun, colour=(1.0, 0.95, 0.85), towards=towards)
    return level


def ground(low: tuple[float, float], high: tuple[float, float], cells: tuple[int, int] = (1, 1)) -> Surface:
    """Return a horizontal rectangle at y = 0 between the corners (x, z) `low` and `high`, facing up."""
    return sheet((low[0], 0, low[1]), (0, 0, high[1] - low[1]), (high[0] - low[0], 0, 0), cells)


def make_street() -> Level:
    """A sunlit street with four houses: closed, closed with a light inside, with a window, with a door."""
    level = _outdoors(2000.0, 50_000.0)
    level.put("street", ground((-13, -7), (13, 7), (13, 7)), "concrete")
    house(level, "shut", (-8, -3), (4, 2.6, 4), "plaster")
    house(level, "window", (0, -3), (4, 2.6, 4), "plaster", holes={"+z": WINDOW})
    house(level, "lamp", (8, -3), (4, 2.6, 4), "plaster")
    house(level, "open", (0, 4.2), (5, 2.6, 3), "plaster", holes={"-z": DOOR})
    level.glb.light("bulb", "point", 60.0, at=(8.0, 2.0, -3.0))
    level.put("table", slab((7.2, 0.7, -3.6), (8.6, 0.75, -2.6)), "wood")
    level.put("crate", slab((-0.9, -0.05, -4.2), (-0.2, 0.7, -3.5)), "wood")
    return level


def make_huts() -> Level:
    """Two huts, one closed and one open, on rolling ground that continues inside them."""
    level = _outdoors(1500.0, 30_000.0)
    level.put("terrain", terrain(20.0, 32), "concrete")
    house(level, "shut", (-4, -2), (3.2, 2.6, 3.2), "plaster", foot=-1.2)
    house(level, "open", (4, 2), (3.2, 2.8, 3.2), "wood", foot=-1.2, holes={"-x": (-0.5, -0.3, 0.5, 2.1)})
    for k, (x, z) in enumerate([(0.0, -6.0), (6.0, -6.0), (-6.0, 5.0)]):
        at = (x, round(float(height(np.array(x), np.array(z))), 4), z)
        level.put(f"stone {k}", rock(0.8, k, 1), "concrete", at)
    return level


def make_greenhouse() -> Level:
    """A greenhouse whose panes are single sheets of glass that pass through the frame."""
    level = _outdoors(1000.0, 20_000.0, (0.0, -1.0, 0.0))
    level.glb.material("glass", (1.0, 1.0, 1.0), alpha=0.25, mode="BLEND", double_sided=True)
    level.put("soil", ground((-8, -8), (8, 8)), "wood")
    for k in range(4):
        x = -4.0 + 2 * k
        level.put(f"roof pane {k}", sheet((x, 2.4, -3), (0, 0, 6), (2, 0, 0)), "glass")
        level.put(f"pane -z {k}", sheet((x, 0, -3), (0, 2.4, 0), (2, 0, 0)), "glass")
        level.put(f"pane +z {k}", sheet((x, 0, 3), (2, 0, 0), (0, 2.4, 0)), "glass")
    level.put("pane -x", sheet((-4, 0, -3), (0, 0, 6), (0, 2.4, 0)), "glass")
    level.put("pane +x", sheet((4, 0, -3), (0, 2.4, 0), (0, 0, 6)), "glass")
    posts = [
        slab((x - 0.04, -0.1, z - 0.04), (x + 0.04, 2.44, z + 0.04))
        for x in (-4, -2, 0, 2, 4)
        for z in (-3, 3)
    ]
    rails = [slab((x - 0.03, 2.37, -3.03), (x + 0.03, 2.43, 3.03)) for x in (-4, -2, 0, 2, 4)]
    level.put("frame", join(*posts, *rails), "plaster")
    for k in range(3):
        level.put(f"bed {k}", slab((-3.2 + 2.4 * k, -0.1, -2), (-1.6 + 2.4 * k, 0.4, 2)), "wood")
    return level


def make_rocks() -> Level:
    """Rocks that intersect each other and the ground."""
    level = _outdoors(2000.0, 40_000.0)
    level.put("ground", ground((-7, -7), (7, 7)), "concrete")
    rng = np.random.default_rng(5)
    for k in range(14):
        x, z = (round(float(v), 3) for v in rng.uniform(-3, 3, 2))
        size = round(float(rng.uniform(0.6, 1.6)), 3)
        y = round(float(rng.uniform(-0.2, 0.8)), 3)
        level.put(f"rock {k}", rock(size, 10 + k), "concrete", (x, y, z), turn=float(40 * k))
    return level


def make_grove() -> Level:
    """Trees made of crossing billboards whose leaves are cut out by alpha (MASK)."""
    level = _outdoors(3000.0, 30_000.0)
    level.glb.material("leaves", (1.0, 1.0, 1.0), texture=leaf_picture(), mode="MASK", double_sided=True)
    level.put("meadow", ground((-8, -8), (8, 8)), "concrete")
    crown, trunk = crossed(2.4, 2.4, 3), lathe([(0.0, -0.2), (0.18, -0.2), (0.14, 1.6), (0.0, 1.6)], 8)
    for k, (x, z) in enumerate(
        [(-4, -4), (0, -3.5), (4, -4), (-3.5, 1), (0.8, 1.2), (4, 0.5), (-1, 5), (3.4, 4.6)]
    ):
        level.put(f"crown {k}", crown, "leaves", (x, 1.0, z), turn=float(25 * k))
        level.put(f"trunk {k}", trunk, "wood", (x, 0.0, z))
    return level


def make_skybox() -> Level:
    """A yard inside an emissive sphere, a skybox: the irradiance of unoccluded surfaces is pi x radiance."""
    level = _outdoors(0.0)
    level.glb.material("sky", BLACK, emission=(1000.0, 1000.0, 1000.0))
    dome = ball(300.0, 2)
    level.put("sky", Surface(dome.position, -dome.normal, dome.triangle[:, ::-1]), "sky")
    level.put("yard", ground((-6, -6), (6, 6)), "concrete")
    house(level, "shed", (-3, -3), (2.4, 2.4, 2.4), "plaster")
    level.put("crate", slab((2, 0, 2), (3, 1, 3)), "wood")
    level.put("table", slab((1, 2.9, -3), (3, 3.0, -1)), "black")
    return level


def make_hulls(hulls: bool = True) -> Level:
    """A yard with objects and their invisible collision hulls; without `hulls`, the objects only."""
    level = _outdoors(1000.0, 20_000.0)
    level.glb.material("hull", (1.0, 1.0, 1.0), alpha=0.0, mode="BLEND")
    level.put("yard", ground((-6, -6), (6, 6)), "concrete")
    boxes = {
        "crate": ((-2, 0, -2), (-1, 1, -1)),
        "wall": ((-4, 0, 2), (4, 2.4, 2.3)),
        "beam": ((1, 0, -3), (1.3, 2, -2.7)),
    }
    for name, (low, high) in boxes.items():
        level.put(name, slab(low, high), "plaster")
        if hulls:
            level.put(f"UCX_{name}", slab(low, high), "hull")
            apart = tuple(v - 0.02 for v in low), tuple(v + 0.02 for v in high)
            level.put(
                f"UBX_{name}",
                slab((apart[0][0], apart[0][1], apart[0][2]), (apart[1][0], apart[1][1], apart[1][2])),
                "hull",
            )
    return level


def make_balcony() -> Level:
    """A house with a balcony: a slab with rails that passes through the front, at a door."""
    level = _outdoors(2000.0, 40_000.0, (0.3, -0.7, -0.5))
    level.put("street", ground((-8, -6), (8, 8)), "concrete")
    house(level, "flat", (0, 0), (5, 5.4, 4), "plaster", holes={"+z": (-1.0, 2.8, 1.0, 4.9)})
    level.put("slab", slab((-2, 2.6, -2.1), (2, 2.8, 3.6)), "concrete")
    level.put("floor", slab((-2.6, 2.55, -2.05), (2.6, 2.75, 2.05)), "wood, both sides")
    bars = [
        slab((x - 0.02, 2.7, 3.5), (x + 0.02, 3.7, 3.54))
        for x in np.linspace(-1.96, 1.96, 25).round(3).tolist()
    ]
    level.put("rail", join(*bars, slab((-2, 3.68, 3.48), (2, 3.73, 3.56))), "black")
    return level


def make_cave() -> Level:
    """A cave: a tube of rock that is open at one end and has a fire at the other."""
    level = _outdoors(2000.0, 30_000.0, (0.1, -0.35, -0.9))
    level.glb.material("fire", BLACK, emission=(3000.0, 1500.0, 400.0))
    rings, sides = 24, 20
    along, turn = np.meshgrid(
        np.linspace(0, 14, rings + 1), np.arange(sides) * 2 * math.pi / sides, indexing="ij"
    )
    wide = 2.0 + 0.25 * np.sin(1.3 * along + 2 * turn) + 0.2 * np.cos(2.1 * along - 3 * turn)
    wide[0] = 0.02
    x, y = wide * np.cos(turn), np.maximum(wide * np.sin(turn), -1.1)
    position = np.stack([x + 0.8 * np.sin(0.4 * along), y, along - 14], axis=-1).reshape(-1, 3).round(4)
    index = np.arange((rings + 1) * sides).reshape(rings + 1, sides)
    a, b = index[:-1], index[1:]
    c, d = np.roll(b, -1, axis=1), np.roll(a, -1, axis=1)
    tube = smooth(position, np.stack([a, b, c, a, c, d], axis=-1).reshape(-1, 3))
    level.put("rock", tube, "concrete")
    level.put("ground", sheet((-8, -1.05, -0.5), (0, 0, 8.5), (16, 0, 0), (4, 4)), "concrete")
    level.put("fire", ball(0.15, 1), "fire", (0.3, -0.7, -12.0))
    level.put("boulder", rock(0.7, 3, 1), "wood", (-0.6, -0.8, -8.0))
    return level
