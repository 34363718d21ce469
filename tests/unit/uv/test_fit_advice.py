"""If objects do not fit their pages, the message names settings with which they fit."""

from __future__ import annotations

import re

import numpy as np
import pytest
from tiny_scenes import Quad, quad_scene

from baker.core.errors import InputError, SettingsError
from baker.core.settings import make_settings
from baker.uv.fit_advice import fit_advice
from baker.uv.unwrap import unwrap_scene


def squares(n, side=1.0):
    return quad_scene([Quad((2.0 * k, 0, 0), (side, 0, 0), (0, side, 0)) for k in range(n)])


def warned(scene, **settings):
    """Unwrap a scene; return the warnings about lowered densities."""
    atlas = unwrap_scene(scene, make_settings({"uv": "unwrap", "padding": 2, **settings}))
    return [w.message for w in atlas.warnings if w.code == "uv.density_lowered"]


def advised(message):
    """Return the settings that a message names, with their values."""
    return {name: float(value) for name, value in re.findall(r"`(\w+)=([\d.e+]+)`", message)}


@pytest.mark.parametrize(
    ("scene", "settings", "names"),
    [
        (
            squares(20),
            {"resolution": 64, "density": 20.0, "max_pages": 1},
            {"resolution", "max_pages", "density"},
        ),
        (
            squares(20),
            {"resolution": 64, "density": 20.0, "max_pages": 2},
            {"resolution", "max_pages", "density"},
        ),
        (squares(3, 4.0), {"resolution": 64, "density": 20.0, "max_pages": 9}, {"resolution", "density"}),
    ],
)
def test_each_value_of_the_advice_fits(scene, settings, names):
    settings = {"resolution": 64, "density": 20.0, **settings}
    (message, *_) = warned(scene, **settings)
    found = advised(message)
    assert set(found) == names
    for name, value in found.items():
        assert warned(scene, **{**settings, name: int(value) if name != "density" else value}) == []
        assert (value > settings[name]) == (name != "density")


def test_charts_that_never_fit_name_a_resolution_that_does():
    scene = squares(400)
    with pytest.raises(InputError, match="charts do not fit pages of 16") as caught:
        warned(scene, resolution=16, density=1.0, max_pages=1)
    width = int(re.search(r"raise `resolution` to (\d+)", caught.value.message)[1])
    warned(scene, resolution=width, density=1.0, max_pages=1)


def test_pages_of_other_groups_count():
    def pages_at(resolution, density, max_pages):
        pages = int(np.ceil(12 * (density / 10) ** 2 * (64 / resolution) ** 2))
        return pages if pages <= max_pages else None

    text = fit_advice(pages_at, 64, 10.0, 3, 5.0, reserved=2)
    assert text == "; `resolution=128`, `max_pages=14` or `density=5` fits"
    assert fit_advice(lambda *_: None, 64, 10.0, 3, 5.0) == ""


def densities(scene, **settings):
    atlas = unwrap_scene(scene, make_settings({"uv": "unwrap", "padding": 2, **settings}))
    return np.array([layout.texels_per_metre for layout in atlas.layouts]), atlas


@pytest.mark.parametrize("budget", ["1x64", "2x64", "3x128"])
def test_a_budget_is_filled_with_equal_densities(budget):
    pages, width = map(int, budget.split("x"))
    found, atlas = densities(squares(20), budget=budget)
    assert (atlas.n_pages, atlas.resolution) == (pages, width)
    assert np.ptp(found) < 1e-6
    # With a tenth more density the pages are not enough.
    settings = {"resolution": width, "max_pages": pages, "density": 1.1 * found[0]}
    assert warned(squares(20), **settings) != []


def test_a_density_is_the_upper_limit_of_a_budget():
    found, atlas = densities(squares(20), budget="4x64", density=5.0)
    assert (found == 5.0).all()
    found, atlas = densities(squares(20), budget="1x64", density=50.0)
    message = next(w.message for w in atlas.warnings if w.code == "uv.budget")
    assert f"at {found[0]:.4g} texels per metre" in message
    assert "of the 50 asked for" in message


def test_a_large_object_takes_no_density_of_small_ones():
    """The large square fills one of two pages, the small ones fill the other."""
    sides = [16.0, 1.0, 1.0, 1.0, 1.0]
    scene = quad_scene([Quad((20.0 * k, 0, 0), (s, 0, 0), (0, s, 0)) for k, s in enumerate(sides)])
    found, atlas = densities(scene, budget="2x64")
    assert atlas.n_pages == 2
    assert found[1:].min() > 3.0 * found[0]


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"budget": "1024"}, "not a number of pages and their width"),
        ({"budget": "0x1024"}, "greater than or equal to 1"),
        ({"budget": "2x7"}, "greater than or equal to 16"),
        ({"budget": "2x64", "resolution": 128}, "`budget` and `resolution` contradict"),
        ({"budget": "2x64", "max_pages": 3}, "`budget` and `max_pages` contradict"),
    ],
)
def test_wrong_budgets_are_sentences(settings, message):
    with pytest.raises(SettingsError, match=message):
        make_settings(settings)
