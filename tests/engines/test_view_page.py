"""`baker view` in a browser: pixels and displayed numbers are compared with the files of the bake.

Expected pixel positions follow from the camera in `scene.glb`. Expected colours follow from the EXR and PNG
files of the bake. Tests and `baker view` read them with the same decoders.
"""

from __future__ import annotations

import io
import re
import threading
import time
from contextlib import contextmanager

import numpy as np
import pytest
from browser import need_modules, page_at
from PIL import Image
from view_bake import (
    FACTOR,
    LEAF_AT,
    PAINT,
    PAINTED_AT,
    PLAIN,
    PLAIN_AT,
    SIZE,
    make_bake,
    painted_uv,
    plain_uv,
)

from baker.core.colour import linear_from_srgb
from baker.encodings.exr import decode_exr
from baker.io.bake.read_bake import read_bake
from baker.io.png import decode_palette_png
from baker.viewer.script import find_three
from baker.viewer.server import make_server

pytestmark = pytest.mark.engines
# Largest permitted difference of a pixel, sRGB bytes. Texture unit and frame buffer may round up or down.
LEVELS = 2
# Displayed linear value of the median luminance, as in the viewer's main.js.
MIDDLE = 0.35
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])


class Page:
    """The viewer page of one bake in one browser window, and the files of the bake."""

    def __init__(self, window, url, out):
        self.window, self.url, self.out = window, url, out
        self.light = np.stack([decode_exr(out / f"irradiance_{k}.exr").pixels for k in (0, 1)])
        self.ao = np.stack([decode_exr(out / f"ao_{k}.exr").pixels for k in (0, 1)])
        self.status = np.stack([decode_palette_png(out / f"status_{k}.png") for k in (0, 1)])
        covered = np.isin(self.status, (1, 3, 4))
        self.exposure = MIDDLE / np.median(self.light[covered] @ LUMINANCE)

    def fresh(self):
        self.window.goto(self.url)
        self.wait_for("document.documentElement.dataset.ready === 'yes'", 60)
        return self

    def ask(self, expression):
        return self.window.evaluate(expression)

    def wait_for(self, expression, seconds=10):
        # Poll from this process. Playwright's own waits evaluate a string in the page, which the page's
        # Content-Security-Policy forbids.
        end = time.monotonic() + seconds
        while not self.ask(expression):
            assert time.monotonic() < end, f"waited in vain for {expression}"
            time.sleep(0.02)

    def press(self, key):
        self.window.keyboard.press(key)

    def click(self, place):
        self.window.mouse.click(*place)

    def drag(self, start, end, button="left"):
        mouse = self.window.mouse
        mouse.move(*start)
        mouse.down(button=button)
        mouse.move(*end, steps=4)
        mouse.up(button=button)

    def picture(self):
        """Return a screenshot (height, width, 3) after all requested changes are drawn."""
        self.ask("new Promise(done => requestAnimationFrame(() => requestAnimationFrame(() => done(1))))")
        shot = Image.open(io.BytesIO(self.window.screenshot()))
        return np.asarray(shot.convert("RGB")).astype(int)

    def box(self, name):
        script = f"(() => {{ const b = document.getElementById('{name}').getBoundingClientRect();"
        return self.ask(script + " return [b.left, b.top, b.width, b.height]; })()")

    def spot(self, x, y, z=0.0):
        """Return the pixel at which the camera at (0, 0, 5) sees a world point."""
        left, top, width, height = self.box("stage")
        tall = 0.4 * (5 - z)
        return left + width / 2 + x / tall * height / 2, top + height / 2 - y / tall * height / 2

    def atlas_spot(self, u, v):
        """Return the pixel at which the atlas window shows the uv (u, v)."""
        left, top, width, height = self.box("atlas")
        return left + width * (0.5 + (u - 0.5) * 0.97), top + height * (0.5 + (v - 0.5) * 0.97)

    def pixels(self, places):
        """Return (n, 3) colours at pixels of one screenshot."""
        picture = self.picture()
        return np.array([picture[int(y), int(x)] for x, y in places])

    def pixel(self, place):
        return self.pixels([place])[0]

    def field(self, name):
        return self.ask(f"document.querySelector('[data-field=\"{name}\"]')?.innerText ?? null")

    def picked_light(self):
        parts = [f"[data-field=irradiance] [data-part={letter}]" for letter in "RGB"]
        return [float(self.ask(f"document.querySelector('{part}').innerText")) for part in parts]

    def show(self, key, name):
        self.press(key)
        self.wait_for(f"document.documentElement.dataset.shown === '{name}'")


@contextmanager
def served(out, three=None):
    server = make_server(read_bake(out), find_three(three))
    thread = threading.Thread(target=server.serve_forever, args=(0.05,), daemon=True)
    thread.start()
    yield server.url
    server.shutdown()
    server.server_close()
    thread.join()


@contextmanager
def window_of(browser):
    """Open a window of 1200 x 720 pixels; fail if the page requests anything from another machine."""
    context = browser.browser.new_context(viewport={"width": 1200, "height": 720})
    context.set_default_timeout(90_000)  # milliseconds, enough for busy machines
    with page_at(context, "about:blank") as (window, troubles):
        far = re.compile(r"^(?!http://127\.0\.0\.1:|data:|about:)")
        window.on("request", lambda asked: troubles.append(asked.url) if far.match(asked.url) else None)
        yield window, troubles
    context.close()


@pytest.fixture(scope="module")
def opened(browser):
    with window_of(browser) as found:
        yield found


@pytest.fixture
def window(opened):
    opened[1].clear()
    yield opened[0]
    assert opened[1] == []


@pytest.fixture(scope="module")
def out(tmp_path_factory):
    return make_bake(tmp_path_factory.mktemp("view"))


@pytest.fixture(scope="module")
def address(out):
    with served(out) as url:
        yield url


@pytest.fixture
def page(window, address, out):
    return Page(window, address, out).fresh()


def srgb(linear):
    value = np.clip(np.asarray(linear, float), 0, 1)
    return 255 * np.where(value <= 0.0031308, value * 12.92, 1.055 * value ** (1 / 2.4) - 0.055)


def texel_at(uv):
    return int(uv[1] * SIZE), int(uv[0] * SIZE)


def world(at, s, t):
    x, y, side, z = at
    return x + s * side, y + t * side, z


def close(pixel, expected):
    return np.abs(pixel - np.asarray(expected)).max() <= LEVELS


# (s, t) points on the squares, not on borders of texels or of the quadrants of `PAINT`.
PLACES = [(0.2, 0.9), (0.8, 0.7), (0.15, 0.2), (0.93, 0.35)]


def paint_at(s, t):
    return linear_from_srgb(PAINT[int(t < 0.5), int(s >= 0.5)] / 255) * np.array(FACTOR[:3])


def lit_pixels(page):
    """Return (drawn, expected) colours at `PLACES` of both squares, without bilinear lookup."""
    page.press("t")
    spots, expected = [], []
    for s, t in PLACES:
        row, column = texel_at(painted_uv(s, t))
        spots.append(page.spot(*world(PAINTED_AT, s, t)))
        expected.append(srgb(paint_at(s, t) * page.light[0, row, column] * page.exposure))
        row, column = texel_at(plain_uv(s, t))
        emission = np.array([0, 0, 0.5]) * np.pi
        spots.append(page.spot(*world(PLAIN_AT, s, t)))
        expected.append(srgb((np.array(PLAIN[:3]) * page.light[1, row, column] + emission) * page.exposure))
    return page.pixels(spots), np.array(expected)


def test_albedo_times_light_is_what_is_seen(page):
    seen, expected = lit_pixels(page)
    np.testing.assert_allclose(seen, expected, atol=LEVELS)


def test_a_bilinear_lookup_is_what_is_seen_between_texels(page):
    page.show("2", "irradiance")
    u, v = np.array([painted_uv(s, t) for s, t in PLACES]).T
    value = np.stack([10.03125 + v * SIZE - 0.5, 10.5 + u * SIZE - 0.5, np.full(len(PLACES), 12.0)], axis=-1)
    seen = page.pixels([page.spot(*world(PAINTED_AT, s, t)) for s, t in PLACES])
    np.testing.assert_allclose(seen, srgb(value * page.exposure), atol=LEVELS)


@pytest.mark.parametrize("wrong", ["rows upside down", "transposed", "pi left out"])
def test_a_wrong_page_is_seen(window, out, wrong, monkeypatch):
    change = {
        "rows upside down": lambda pixels: pixels[::-1],
        "transposed": lambda pixels: pixels.transpose(1, 0, 2),
        "pi left out": lambda pixels: pixels / np.float32(np.pi),
    }[wrong]
    from baker.viewer import answers

    plain = answers.page_numbers
    monkeypatch.setattr(answers, "page_numbers", lambda pixels: plain(np.ascontiguousarray(change(pixels))))
    with served(out) as url:
        seen, expected = lit_pixels(Page(window, url, out).fresh())
    assert np.abs(seen - expected).max() > 3 * LEVELS


def test_a_click_tells_object_texel_and_the_exact_value(page):
    for s, t in PLACES:
        for at, name, number, place in (
            (PAINTED_AT, "painted", 0, painted_uv),
            (PLAIN_AT, "plain <b>&", 1, plain_uv),
        ):
            page.click(page.spot(*world(at, s, t)))
            row, column = texel_at(place(s, t))
            told = f"page {number}, row {row}, column {column}"
            page.wait_for(f"document.querySelector('[data-field=texel]')?.innerText === '{told}'")
            assert page.field("object") == f"{name} node {number}"
            assert page.picked_light() == page.light[number, row, column].tolist()
            assert float(page.field("ao")) == page.ao[number, row, column, 0]
            assert page.field("status") == "covered"
            x, y, z = (float(word) for word in page.field("position").split()[:3])
            # The tolerance is less than a pixel, which is about 6 mm wide in the scene.
            np.testing.assert_allclose((x, y, z), world(at, s, t), atol=0.004)


def test_numbers_of_32_bits_are_told_exactly(window, tmp_path):
    out = make_bake(tmp_path, half=False)
    with served(out) as url:
        page = Page(window, url, out).fresh()
        page.click(page.spot(*world(PAINTED_AT, 0.2, 0.9)))
        page.wait_for("document.querySelector('[data-field=irradiance]') !== null", 5)
        row, column = texel_at(painted_uv(0.2, 0.9))
        value = page.light[0, row, column]
        assert page.picked_light() == value.astype(float).tolist()
        assert np.any(value.astype(np.float16) != value)
        page.show("2", "irradiance")
        page.press("t")
        assert close(
            page.pixel(page.spot(*world(PAINTED_AT, 0.8, 0.7))), light_pixel(page, 0, painted_uv(0.8, 0.7))
        )


def light_pixel(page, number, uv):
    row, column = texel_at(uv)
    return srgb(page.light[number, row, column] * page.exposure)


def test_one_sees_and_clicks_through_the_holes_of_a_leaf(page):
    for s, name in ((0.25, "plain <b>& node 1"), (0.75, "leaf node 2")):
        page.click(page.spot(*world(LEAF_AT, s, 0.4)))
        page.wait_for(f"document.querySelector('[data-field=object]')?.innerText === {name!r}", 5)
    page.show("2", "irradiance")
    x, y = page.spot(*world(LEAF_AT, 0.25, 0.4))
    # The point of the plane z = 0 behind the hole, then its (s, t) on the plain square.
    behind = [0.25 * 0.6 + 0.8, 0.4 * 0.6 - 0.3] * np.array(5 / 4.5)
    s, t = (behind - np.array(PLAIN_AT[:2])) / PLAIN_AT[2]
    page.press("t")
    assert close(page.pixel((x, y)), light_pixel(page, 1, plain_uv(s, t)))


def test_every_switch_shows_its_quantity(page):
    spot = page.spot(*world(PLAIN_AT, 0.8, 0.7))
    row, column = texel_at(plain_uv(0.8, 0.7))
    page.press("t")
    page.show("3", "ao")
    assert close(page.pixel(spot), srgb(np.repeat(page.ao[1, row, column], 3)))
    page.show("2", "irradiance")
    assert close(page.pixel(spot), srgb(page.light[1, row, column] * page.exposure))
    page.press("]")
    page.press("]")
    assert close(page.pixel(spot), srgb(page.light[1, row, column] * page.exposure * 2))
    assert page.ask("document.getElementById('exposure-value').innerText") == "+1.0 EV"
    page.show("5", "status")
    # The colour of a texel is the legend's colour of its status, times the brightness of the headlight. The
    # brightness is 0.55 + 0.45 cos a, where a is the angle between the surface normal and the direction to
    # the camera.
    for kind, place in ((1, (0.1, 0.1)), (3, (0.25, 0.75)), (4, (0.55, 0.45))):
        row, column = texel_at(painted_uv(*place))
        assert page.status[0, row, column] == kind
        swatch = f"getComputedStyle(document.querySelectorAll('#legend .swatch')[{kind}]).backgroundColor"
        colour = [int(part) for part in re.findall(r"\d+", page.ask(swatch))]
        x, y, _ = world(PAINTED_AT, *place)
        light = 0.55 + 0.45 * 5 / np.sqrt(x * x + y * y + 25)
        assert close(page.pixel(page.spot(*world(PAINTED_AT, *place))), np.array(colour) * light)
    counts = page.ask("[...document.querySelectorAll('#legend li')].map(row => row.children[1].innerText)")
    assert [int(re.sub(r"\D", "", text)) for text in counts] == np.bincount(
        page.status.ravel(), minlength=5
    ).tolist()


def test_the_checker_has_squares_of_eight_texels(page):
    page.show("4", "checker")
    # The painted square begins at texel 4 of page 0, so squares of the checker change at s = 4/24, 12/24,
    # 20/24.
    spots = [page.spot(*world(PAINTED_AT, s, 0.25)) for s in (0.08, 0.25, 0.42, 0.6, 0.8, 0.92)]
    row = page.pixels(spots).mean(axis=1)
    light = row > row.mean()
    assert light.tolist() in (
        [True, False, False, True, True, False],
        [False, True, True, False, False, True],
    )
    # Each object has a different hue: the hues of two objects differ more than light and dark squares of one
    # object.
    hues = page.pixels([page.spot(*world(at, s, 0.25)) for at in (PAINTED_AT, PLAIN_AT) for s in (0.1, 0.9)])
    ratios = [np.argsort(hue).tolist() for hue in hues]
    assert ratios[0] == ratios[1] != ratios[2] == ratios[3]


def test_false_colour_runs_from_the_lowest_to_the_highest(page):
    page.show("2", "irradiance")
    page.press("t")
    left, top, width, height = page.box("false-colour")
    page.click((left + width / 2, top + height / 2))
    assert page.ask("document.querySelector('#legend h3').innerText") == "Irradiance, luminance lx"
    spot = page.spot(*world(PAINTED_AT, 0.8, 0.7))
    row, column = texel_at(painted_uv(0.8, 0.7))
    value = float(page.light[0, row, column] @ LUMINANCE)
    for low, high, expected in (
        (value, value * 2, (0x14, 0x0B, 0x3D)),
        (value / 2, value, (0xFF, 0xF2, 0xBF)),
        (value - 3, value + 3, (0x17, 0x9E, 0x9E)),
    ):
        fill = "const set = (id, v) => { const i = document.getElementById(id); i.value = v;"
        fill += " i.dispatchEvent(new Event('input')); };"
        page.ask(f"(() => {{ {fill} set('low', {low}); set('high', {high}); }})()")
        assert np.abs(page.pixel(spot) - np.array(expected)).max() <= 4  # the ramp has 256 steps


def test_the_atlas_shows_the_page_with_its_first_row_on_top(page):
    page.show("2", "irradiance")
    page.press("t")
    for number in (0, 1):
        places = [(0.3, 0.1), (0.61, 0.86), (0.2, 0.52)]
        seen = page.pixels([page.atlas_spot(*place) for place in places])
        expected = [light_pixel(page, number, place) for place in places]
        np.testing.assert_allclose(seen, expected, atol=LEVELS)
        page.press(".")
    assert page.ask("document.getElementById('page').value") == "1"
    u, v = plain_uv(0.8, 0.7)
    page.click(page.atlas_spot(u, v))
    row, column = texel_at((u, v))
    page.wait_for("document.querySelector('[data-field=object]') !== null", 5)
    assert page.field("texel") == f"page 1, row {row}, column {column}"
    assert page.field("object") == "plain <b>& node 1"
    assert page.picked_light() == page.light[1, row, column].tolist()
    # Each arrow key moves the picked texel by one.
    page.press("ArrowRight")
    page.press("ArrowDown")
    assert page.field("texel") == f"page 1, row {row + 1}, column {column + 1}"
    page.click(page.atlas_spot(0.99, 0.99))
    page.wait_for("document.querySelector('[data-field=object]').innerText === 'no surface here'", 5)
    assert page.field("status") == "empty"


def test_one_can_turn_shift_zoom_and_come_back(page):
    middle = page.spot(0, 0)
    before = page.picture()
    seen = [before]
    page.window.mouse.move(*middle)
    for act in (
        lambda: page.drag(middle, (middle[0] + 120, middle[1] + 40)),
        lambda: page.drag(middle, (middle[0] + 120, middle[1] + 40), button="right"),
        lambda: page.window.mouse.wheel(0, -300),
        lambda: page.press("w"),
        lambda: page.press("ArrowLeft"),
        lambda: page.press("Shift+ArrowLeft"),
        lambda: page.press("-"),
    ):
        act()
        seen.append(page.picture())
        assert np.abs(seen[-1] - seen[-2]).mean() > 0.2
    page.press("0")
    page.ask("document.activeElement.blur()")  # the stage marks its middle while it has the focus
    stage = np.s_[60:660, 330:870]  # without the legend
    np.testing.assert_array_equal(page.picture()[stage], before[stage])


def test_it_can_be_used_without_a_mouse(page):
    page.press("Tab")
    assert page.ask("document.activeElement.name") == "mode"
    page.press("ArrowRight")
    page.wait_for("document.documentElement.dataset.shown === 'irradiance'")
    for _ in range(6):
        if page.ask("document.activeElement.id") == "stage":
            break
        page.press("Tab")
    assert page.ask("document.activeElement.id") == "stage"
    for _ in range(2):
        page.press("Shift+ArrowRight")
    page.press("Enter")
    page.wait_for("document.querySelector('[data-field=object]')?.innerText.startsWith('plain')", 5)
    page.press("?")
    assert page.ask("document.getElementById('help').open")


def test_every_control_has_a_name(page):
    script = """[...document.querySelectorAll('button, input, select, [tabindex]')]
        .filter(part => !(part.labels?.length || part.getAttribute('aria-label') || part.innerText.trim()))
        .map(part => part.id)"""
    assert page.ask(script) == []


def test_the_newest_three_from_npm_draws_the_same(window, out):
    with served(out, need_modules() / "three") as url:
        page = Page(window, url, out).fresh()
        assert page.ask("window.__THREE__") != "130"
        seen, expected = lit_pixels(page)
        np.testing.assert_allclose(seen, expected, atol=LEVELS)
