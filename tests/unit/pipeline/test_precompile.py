"""Which kernels are compiled ahead for which scene."""

from __future__ import annotations

import numpy as np
import pytest

from baker.core.scene import Material, Scene, Texture
from baker.pipeline import precompile

SOLID, HOLED = np.full((2, 2, 4), 255, np.uint8), np.full((2, 2, 4), 255, np.uint8)
HOLED[0, 0, 3] = 254


def material(mode, colour=(1.0, 1.0, 1.0), alpha=1.0, image=None):
    texture = None if image is None else Texture(image)
    return Material(base_colour=(*colour, alpha), base_colour_texture=texture, alpha_mode=mode)


@pytest.mark.parametrize(
    ("materials", "kind"),
    [
        ([material("OPAQUE", alpha=0.0)], None),
        ([material("BLEND"), material("BLEND", image=SOLID)], None),
        ([material("OPAQUE"), material("MASK", (1, 0, 0), image=HOLED)], "holes"),
        ([material("BLEND", alpha=0.5)], "glass"),
        ([material("BLEND", (1, 0, 0), 0.5), material("MASK", image=HOLED)], "glass"),
        ([material("BLEND", image=HOLED)], "glass"),
        ([material("BLEND", image=HOLED.astype(np.float32) / 255)], "glass"),
    ],
)
def test_the_scene_tells_what_is_compiled(monkeypatch, materials, kind):
    started, stopped = [], []
    monkeypatch.setattr(precompile, "_run", lambda *kind: started.extend(kind) or "new")
    monkeypatch.setattr(precompile, "stop", stopped.append)
    scene = Scene("", None, (), tuple(materials), ())
    assert precompile.suit("old", scene) == ("new" if kind else "old")
    assert started == ([kind] if kind else [])
    assert stopped == (["old"] if kind else [])
    # Where kernels are on disk nothing is started.
    assert precompile.suit(None, scene) is None
