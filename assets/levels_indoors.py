"""Makes the indoor levels: closed rooms, corridors, a garage, halls, stairs, a kitchen, a cellar."""

from __future__ import annotations

import numpy as np
from level_parts import (
    BLACK,
    CONCRETE,
    PLASTER,
    WOOD,
    Level,
    glass_picture,
    house,
    inside,
    join,
    leaf_picture,
    led_picture,
    sheet,
    slab,
    wall,
)  # fmt: skip
from levels_outdoors import ground
from shapes import Point, lathe


def _indoors(sky: float = 0.0) -> Level:
    level = Level((sky, sky, sky))
    for name, colour in (("plaster", PLASTER), ("concrete", CONCRETE), ("wood", WOOD), ("black", BLACK)):
        level.glb.material(name, colour)
        level.glb.material(f"{name}, both sides", colour, double_sided=True)
    return level


def _panel_light(level: Level, name: str, at: Point, size: float = 0.6, radiance: float = 3000.0) -> None:
    if "lamp" not in level.emitters:
        level.emitters.append("lamp")
        level.glb.material("lamp", BLACK, emission=(radiance, radiance, radiance))
    level.put(name, sheet((at[0] - size / 2, at[1], at[2] - size / 2), (size, 0, 0), (0, 0, size)), "lamp")


def make_closed() -> Level:
    """Four closed rooms without light, under a sky. They share a floor that continues outside."""
    level = _indoors(1000.0)
    level.put("floor", ground((-10, -4), (10, 4)), "plaster")
    for k, both in enumerate(("", ", both sides")):
        x = -7.5 + 5 * k
        low, high = (x - 1.487, 0.0, -1.509), (x + 1.513, 2.5, 1.491)
        sides = ("-x", "+x", "+y", "-z", "+z")
        level.put(f"thin{both}", inside(low, high, sides), f"plaster{both}")
        house(level, f"thick{both}", (2.513 + 5 * k, 0.017), (3, 2.5, 3), f"plaster{both}", thick=0.15)
    return level


def make_garage() -> Level:
    """A closed garage whose beams, shelves and machines pass through its walls."""
    level = _indoors(500.0)
    level.put("floor", ground((-6, -6), (6, 6), (3, 3)), "concrete")
    house(level, "garage", (0.03, 0.02), (6, 2.6, 5), "plaster, both sides", thick=0.05)
    for k, z in enumerate((-1.6, 0.1, 1.7)):
        level.put(f"beam {k}", slab((-3.6, 2.2, z - 0.1), (3.6, 2.45, z + 0.1)), "wood")
    for k, y in enumerate((0.5, 1.0, 1.5)):
        level.put(f"shelf {k}", slab((-2.2, y, -2.6), (1.4, y + 0.03, -2.1)), "wood, both sides")
    for k, x in enumerate((-2.6, -1.9, -1.2)):
        level.put(f"machine {k}", slab((x, -0.02, 2.2), (x + 0.6, 0.85, 2.8)), "plaster, both sides")
    level.put(
        "pipe", lathe([(0.0, -0.3), (0.05, -0.3), (0.05, 3.1), (0.0, 3.1)], 10), "concrete", (2.4, 0.0, -2.0)
    )
    return level


def make_corridors() -> Level:
    """Corridors that form a T. The ends of each wall lie inside other walls."""
    level = _indoors(1500.0)
    level.put("floor", slab((-7.2, -0.2, -1.4), (7.2, 0.0, 8.2)), "concrete")
    level.put("ceiling", slab((-7.2, 2.45, -1.4), (7.2, 2.7, 8.2)), "plaster")
    walls = {
        "north": ((-7.1, -0.1, -1.2), (7.1, 2.5, -1.0)),
        "south left": ((-7.1, -0.1, 1.0), (-0.95, 2.5, 1.2)),
        "south right": ((0.95, -0.1, 1.0), (7.1, 2.5, 1.2)),
        "stem left": ((-1.2, -0.1, 1.05), (-1.0, 2.5, 8.1)),
        "stem right": ((1.0, -0.1, 1.05), (1.2, 2.5, 8.1)),
        "end": ((-1.15, -0.1, 7.9), (1.15, 2.5, 8.1)),
        "west": ((-7.1, -0.1, -1.1), (-6.9, 2.5, 1.1)),
        "east": ((6.9, -0.1, -1.1), (7.1, 2.5, 1.1)),
    }
    for name, (low, high) in walls.items():
        level.put(f"wall {name}", slab(low, high), "plaster, both sides")
    for k, (x, z) in enumerate(((-4.0, 0.0), (0.0, 0.2), (4.0, 0.0), (0.0, 5.0))):
        _panel_light(level, f"lamp {k}", (x, 2.44, z), 0.5)
    return level


def make_storeys() -> Level:
    """Two storeys connected by stairs. Light enters only through windows of the upper storey."""
    level = _indoors(2500.0)
    level.glb.light("sun", "directional", 30_000.0, towards=(0.5, -0.6, -0.6))
    level.put("yard", ground((-9, -8), (9, 8)), "concrete")
    window = (-1.2, 3.8, 1.2, 4.9)
    house(level, "house", (0, 0), (8, 5.6, 6), "plaster", holes={"+z": window, "-x": window})
    slab_parts = [
        slab((-4.1, 2.7, -3.1), (4.1, 2.9, 1.2)), slab((-4.1, 2.7, 1.2), (-2.6, 2.9, 3.1)),
        slab((1.6, 2.7, 1.2), (4.1, 2.9, 3.1)), slab((-2.6, 2.7, 2.4), (1.6, 2.9, 3.1)),
    ]  # fmt: skip
    level.put("storey", join(*slab_parts), "wood")
    steps = [
        slab((-2.6 + 0.28 * k, 0.18 * k, 1.25), (-2.3 + 0.28 * k, 0.18 * (k + 1), 2.35)) for k in range(15)
    ]
    level.put("stairs", join(*steps), "wood")
    level.put("partition", wall((-0.1, 2.85, -3.1), (0.1, 5.65, 1.1), (-2.6, 2.9, -1.7, 5.0)), "plaster")
    return level


def make_decals(apart: float = 0.001) -> Level:
    """Decals one millimetre in front of the walls and floor of a room: opaque, masked and blended."""
    level = _indoors()
    stain = np.zeros((16, 16, 4), np.uint8)
    stain[..., :3], stain[4:12, 4:12, 3] = (120, 60, 30), 160
    level.glb.material("stain", (1.0, 1.0, 1.0), texture=stain, mode="BLEND")
    level.glb.material("notice", (1.0, 1.0, 1.0), texture=leaf_picture(), mode="MASK")
    level.put("room", inside((-3, 0, -2), (3, 2.5, 2)), "plaster")
    for k, name in enumerate(("wood", "notice", "stain")):
        x = -2.2 + 1.6 * k
        level.put(f"{name} -z", sheet((x, 0.9, -2 + apart), (1.2, 0, 0), (0, 0.9, 0)), name)
        level.put(f"{name} floor", sheet((x, apart, -0.4), (0, 0, 0.8), (1.2, 0, 0)), name)
    level.put("corner poster", sheet((-3 + apart, 0.4, 2.0), (0, 0, -1), (0, 1.4, 0)), "wood")
    _panel_light(level, "lamp", (0, 2.49, 0), 0.8)
    return level


def make_tunnel() -> Level:
    """A dark tunnel lit by signs. One in 256 pixels of their emissive texture is not black."""
    level = _indoors()
    level.glb.material("sign", BLACK, emission=(20_000.0, 6000.0, 1000.0), emission_texture=led_picture())
    level.put("tunnel", inside((-2, 0, -15), (2, 3, 15)), "concrete")
    for k in range(5):
        z = -12.0 + 6 * k
        level.put(f"sign {k}", sheet((-1.99, 1.6, z + 0.5), (0, 0, -1.0), (0, 0.5, 0)), "sign")
    level.put("barrier", slab((0.6, -0.05, -4), (0.9, 0.8, 4)), "plaster")
    return level


def make_kitchen() -> Level:
    """A kitchen of double-sided cupboards that intersect each other and the walls."""
    level = _indoors(1500.0)
    level.put("floor", ground((-4, -4), (4, 4)), "wood, both sides")
    house(
        level,
        "kitchen",
        (0, 0),
        (4, 2.5, 3.2),
        "plaster, both sides",
        thick=0.12,
        holes={"+z": (-0.7, 1.0, 0.7, 2.0)},
    )
    for k in range(5):
        x = -2.05 + 0.58 * k
        level.put(f"cupboard {k}", slab((x, -0.02, -1.65), (x + 0.62, 0.88, -1.02)), "plaster, both sides")
        level.put(f"shelf {k}", slab((x, 1.5, -1.65), (x + 0.6, 2.1, -1.28)), "plaster, both sides")
    level.put("worktop", slab((-2.05, 0.86, -1.65), (0.95, 0.9, -0.98)), "wood, both sides")
    level.put("fridge", slab((1.2, -0.02, -1.63), (1.85, 1.8, -0.95)), "plaster, both sides")
    level.put("table", slab((-0.6, 0.7, -0.1), (0.6, 0.74, 0.7)), "wood, both sides")
    legs = [slab((x, -0.02, z), (x + 0.05, 0.72, z + 0.05)) for x in (-0.55, 0.5) for z in (-0.05, 0.6)]
    level.put("legs", join(*legs), "wood, both sides")
    _panel_light(level, "lamp", (0.0, 1.9, 0.3), 0.25)
    return level


def make_church() -> Level:
    """The nave of a church with windows of stained glass."""
    level = _indoors(1500.0)
    level.glb.material("glass", (1.0, 1.0, 1.0), texture=glass_picture(), mode="BLEND", double_sided=True)
    level.glb.light("sun", "directional", 40_000.0, towards=(-0.7, -0.6, 0.1))
    level.put("ground", ground((-9, -11), (9, 11)), "concrete")
    level.put("front", wall((-4.3, -0.1, -8.3), (4.3, 8.1, -8.0)), "plaster")
    level.put("back", wall((-4.3, -0.1, 8.0), (4.3, 8.1, 8.3)), "plaster")
    level.put("roof", slab((-4.6, 8.0, -8.6), (4.6, 8.3, 8.6)), "plaster")
    at = [-5.4, -1.8, 1.8, 5.4]
    for side, x in (("-x", -4.3), ("+x", 4.0)):
        holes = [(z - 0.7, 2.0, z + 0.7, 6.0) for z in at]
        level.put(f"wall {side}", wall((x, -0.1, -8.1), (x + 0.3, 8.1, 8.1), *holes), "plaster")
        for k, z in enumerate(at):
            level.put(
                f"glass {side} {k}", sheet((x + 0.15, 1.95, z + 0.75), (0, 0, -1.5), (0, 4.1, 0)), "glass"
            )
    pillar = lathe([(0.0, -0.1), (0.35, -0.1), (0.35, 8.05), (0.0, 8.05)], 12)
    for k, z in enumerate((-3.6, 0.0, 3.6)):
        level.put(f"pillar -x {k}", pillar, "plaster", (-2.2, 0.0, z))
        level.put(f"pillar +x {k}", pillar, "plaster", (2.2, 0.0, z))
    return level


def make_warehouse() -> Level:
    """A hall with a hundred point lights and a few racks."""
    level = _indoors()
    level.put("hall", inside((-15, 0, -20), (15, 8, 20)), "concrete")
    for k in range(100):
        x, z = -13.5 + 3 * (k % 10), -18.0 + 4 * (k // 10)
        level.glb.light(f"lamp {k}", "point", 40.0 + k, at=(x, 6.0 + 0.1 * (k % 7), z))
    for k in range(4):
        x = -9.0 + 6 * k
        shelves = [slab((x, y, -12), (x + 1, y + 0.05, 12)) for y in (0.2, 1.4, 2.6)]
        posts = [slab((x - 0.02, -0.05, z), (x + 1.02, 2.7, z + 0.08)) for z in (-12.02, -4, 4, 11.94)]
        level.put(f"rack {k}", join(*shelves, *posts), "wood")
    return level


def make_cellar() -> Level:
    """A cellar with one small window below its ceiling. The window opens to a light shaft."""
    level = _indoors(3000.0)
    level.put("cellar floor", slab((-3.1, -2.6, -4.1), (3.1, -2.4, 4.1)), "concrete")
    level.put("ceiling", slab((-3.3, -0.1, -4.3), (3.3, 0.05, 4.3)), "plaster")
    window = (-0.4, -0.75, 0.4, -0.25)
    level.put("wall -z", wall((-3.2, -2.5, -4.2), (3.2, -0.05, -4.0)), "plaster")
    level.put("wall +z", wall((-3.2, -2.5, 4.0), (3.2, -0.05, 4.2), window), "plaster")
    level.put("wall -x", wall((-3.2, -2.5, -4.1), (-3.0, -0.05, 4.1)), "plaster")
    level.put("wall +x", wall((3.0, -2.5, -4.1), (3.2, -0.05, 4.1)), "plaster")
    yard = [
        sheet((-6, 0, -7), (0, 0, 11.2), (12, 0, 0)), sheet((-6, 0, 5.0), (0, 0, 2), (12, 0, 0)),
        sheet((-6, 0, 4.2), (0, 0, 0.8), (5.4, 0, 0)), sheet((0.6, 0, 4.2), (0, 0, 0.8), (5.4, 0, 0)),
    ]  # fmt: skip
    level.put("yard", join(*yard), "concrete")
    level.put("shaft", inside((-0.6, -0.9, 4.2), (0.6, 0.0, 5.0), ("-x", "+x", "-y", "+z")), "concrete")
    level.put(
        "barrel",
        lathe([(0.0, -2.45), (0.4, -2.45), (0.5, -1.9), (0.4, -1.4), (0.0, -1.4)], 12),
        "wood",
        (1.5, 0.0, -2.0),
    )
    return level


def make_centimetres(unit: float = 100.0) -> Level:
    """A furnished room whose file contains centimetres where glTF requires metres."""
    level = _indoors()

    def put(name: str, surface: object, material: str) -> None:
        level.put(name, surface, material, scale=unit)  # type: ignore[arg-type]

    put("room", inside((-3, 0, -2), (3, 2.5, 2)), "plaster")
    put("table", slab((-0.8, 0.7, -0.4), (0.8, 0.75, 0.4)), "wood")
    put("crate", slab((1.2, -0.02, 0.6), (1.9, 0.7, 1.3)), "wood")
    put("rug", slab((-1.5, -0.001, -1), (0.5, 0.01, 1)), "concrete")
    level.glb.light("bulb", "point", 50.0 * unit * unit, at=(-1.5 * unit, 1.8 * unit, 1.2 * unit))
    level.glb.material("lamp", BLACK, emission=(500.0, 500.0, 500.0))
    put("lamp", sheet((-0.4, 2.45, -0.4), (0.8, 0, 0), (0, 0, 0.8)), "lamp")
    return level
