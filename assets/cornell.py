"""Makes the Cornell box: two boxes in a room that is open at the front, lit by one area light.

Based on: Goral, Torrance, Greenberg, Battaile, Modeling the Interaction of Light Between
Diffuse Surfaces, 1984.
"""

from __future__ import annotations

from glb import GlbBuilder
from shapes import box, box_faces, quads

SIDE = 2.0
WHITE = (0.73, 0.71, 0.68)
RED = (0.61, 0.06, 0.06)
GREEN = (0.12, 0.45, 0.15)
# Radiance of the light, cd/m2. It causes about 250 lx on the floor below.
EMISSION = (4200.0, 3300.0, 2100.0)
NO_BOTTOM = ("-x", "+x", "+y", "-z", "+z")


def make_cornell() -> GlbBuilder:
    """Return the scene: 32 one-sided triangles in 8 objects, with a camera at +z."""
    glb = GlbBuilder()
    for name, colour in (("white", WHITE), ("red", RED), ("green", GREEN)):
        glb.material(name, colour)
    glb.material("lamp", (0.78, 0.78, 0.78), emission=EMISSION)
    half = SIDE / 2
    # The room is a box whose faces point inwards, so reverse the order of their corners.
    face = box_faces((-half, 0.0, -half), (half, SIDE, half))
    walls = (
        ("floor", "-y", "white"),
        ("ceiling", "+y", "white"),
        ("back_wall", "-z", "white"),
        ("red_wall", "-x", "red"),
        ("green_wall", "+x", "green"),
    )
    for name, side, colour in walls:
        glb.place(name, glb.mesh(name, [(quads([face[side][::-1]]), colour)]))
    # The boxes stand on the floor and have no bottom face, because it would be invisible.
    short = glb.mesh("short_box", [(box((0.6, 0.6, 0.6), faces=NO_BOTTOM), "white")])
    tall = glb.mesh("tall_box", [(box((0.6, 1.2, 0.6), faces=NO_BOTTOM), "white")])
    glb.place("short_box", short, (0.33, 0.0, 0.39), turn=-17.0)
    glb.place("tall_box", tall, (-0.34, 0.0, -0.28), turn=17.0)
    panel = box_faces((-0.24, 1.99, -0.19), (0.24, 2.1, 0.19))["-y"]
    glb.place("lamp", glb.mesh("lamp", [(quads([panel]), "lamp")]))
    glb.camera((0.0, 1.0, 4.6), (0.0, 1.0, 0.0), 33.0)
    return glb
