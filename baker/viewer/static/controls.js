// Handles buttons, sliders, keys and gestures, which change the application's state and redraw the page.

import { firstView, fly, frame, ray, shift, turn, zoom } from "./orbit.js";
import { listen, ownsArrows, typing } from "./input.js";
import { element } from "./panel.js";
import { pickRay, pickTexel } from "./pick.js";
import { MODES } from "./shaders.js";

const at = (id) => document.getElementById(id);
const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
const FLIGHT = { a: [-1, 0, 0], d: [1, 0, 0], q: [0, -1, 0], e: [0, 1, 0], s: [0, 0, -1], w: [0, 0, 1] };

/** Creates the mode buttons, and adds event listeners to all controls of the page. */
export function bindControls(app) {
  const { state } = app;
  state.modes.forEach((mode, number) => {
    const radio = element("input", { type: "radio", name: "mode", value: mode.id });
    radio.disabled = !mode.enabled;
    radio.addEventListener("change", () => app.setMode(mode));
    const key = number < 9 ? ` (${number + 1})` : "";
    const hint = mode.enabled ? `${mode.label}${key}` : "this bake has no such channel";
    at("modes").append(element("label", { title: hint }, radio, mode.label));
  });
  bindDisplay(app);
  bindStage(app);
  bindAtlas(app);
  window.addEventListener("keydown", (event) => onKey(app, event));
  new ResizeObserver(app.redraw).observe(at("stage"));
  document.querySelector("aside").addEventListener("scroll", app.redraw);
  at("help-button").addEventListener("click", () => at("help").showModal());
}

/** Updates the controls from the state. */
export const controls = {
  showMode({ state }) {
    for (const radio of at("modes").querySelectorAll("input")) radio.checked = radio.value === state.mode.id;
  },
  show({ state }) {
    const { mode, page, exposure } = state;
    const scaled = mode.mode === MODES.light || mode.mode === MODES.plain;
    const channel = mode.channel ?? state.scene.channels[0];
    at("page").value = String(page);
    at("file").textContent = channel.files[page];
    at("file").href = `out/${channel.files[page]}`;
    at("exposure").value = String(exposure);
    at("exposure").disabled = !mode.channel || mode.id === "ao" || (scaled && state.falseColour);
    at("exposure-value").textContent = `${exposure < 0 ? "\u2212" : "+"}${Math.abs(exposure).toFixed(1)} EV`;
    at("false-colour").checked = state.falseColour;
    at("false-colour").disabled = !scaled;
    at("smooth").checked = state.smooth;
    at("range-row").hidden = !(scaled && state.falseColour);
    const range = mode.channel && state.ranges.get(mode.channel.name);
    if (range) {
      if (document.activeElement !== at("low")) at("low").value = String(range.low);
      if (document.activeElement !== at("high")) at("high").value = String(range.high);
      at("log").checked = range.log;
      at("range-unit").textContent = mode.channel.unit === "1" ? "" : mode.channel.unit;
    }
  },
};

function bindDisplay(app) {
  const { state } = app;
  const range = () => state.mode.channel && state.ranges.get(state.mode.channel.name);
  const first = new Map([...state.ranges].map(([name, value]) => [name, { ...value }]));
  const change = (id, event, act) =>
    at(id).addEventListener(event, () => {
      act(at(id));
      app.update();
    });
  change("exposure", "input", ({ value }) => { state.exposure = Number(value); });
  change("exposure-reset", "click", () => { state.exposure = 0; });
  change("false-colour", "change", ({ checked }) => { state.falseColour = checked; });
  change("smooth", "change", ({ checked }) => { state.smooth = checked; });
  for (const id of ["low", "high"]) {
    change(id, "input", ({ value }) => {
      if (value !== "" && Number.isFinite(Number(value))) range()[id] = Number(value);
    });
  }
  change("log", "change", ({ checked }) => { range().log = checked; });
  change("range-reset", "click", () => { Object.assign(range(), first.get(state.mode.channel.name)); });
  at("page").addEventListener("change", () => app.setPage(Number(at("page").value)));
  at("atlas-fit").addEventListener("click", () => fitAtlas(app));
}

function bindStage(app) {
  const { state } = app;
  const stage = at("stage");
  listen(stage, {
    drag(x, y, shifting) {
      if (shifting) shift(state.camera, -x, y);
      else turn(state.camera, -x * 3, y * 3);
      app.redraw();
    },
    wheel(steps) {
      zoom(state.camera, steps);
      app.redraw();
    },
    click: (place) => pickAt(app, place),
    double(place) {
      const found = surfaceAt(app, place);
      if (!found) return;
      const { eye } = frame(state.camera);
      const away = eye.map((value, axis) => value - found.position[axis]);
      const distance = Math.hypot(...away);
      Object.assign(state.camera, {
        target: found.position,
        distance,
        yaw: Math.atan2(away[0], away[2]),
        pitch: Math.asin(away[1] / distance),
      });
      app.redraw();
    },
  });
}

function bindAtlas(app) {
  const { state } = app;
  const uv = ({ x, y }) => [state.atlas.u + x / (2 * state.atlas.zoom), state.atlas.v - y / (2 * state.atlas.zoom)];
  listen(at("atlas"), {
    drag(x, y) {
      state.atlas.u -= x / state.atlas.zoom;
      state.atlas.v -= y / state.atlas.zoom;
      app.redraw();
    },
    wheel(steps, place) {
      const [u, v] = uv(place);
      state.atlas.zoom = Math.min(Math.max(state.atlas.zoom / 0.86 ** steps, 0.5), state.scene.resolution / 8);
      // Keep the uv under the mouse at the same position.
      state.atlas.u = u - place.x / (2 * state.atlas.zoom);
      state.atlas.v = v + place.y / (2 * state.atlas.zoom);
      app.redraw();
    },
    click(place) {
      const [u, v] = uv(place);
      if (u < 0 || v < 0 || u >= 1 || v >= 1) return;
      const size = state.scene.resolution;
      app.pick(state.page, Math.floor(v * size), Math.floor(u * size), pickTexel(state.scene, state.page, u, v));
    },
    double() {},
  });
}

function fitAtlas(app) {
  Object.assign(app.state.atlas, { u: 0.5, v: 0.5, zoom: 0.97 });
  app.redraw();
}

function surfaceAt({ state }, { x, y }) {
  const stage = at("stage");
  return pickRay(state.scene, state.images, ray(state.camera, x, y, stage.clientWidth / stage.clientHeight));
}

function pickAt(app, place) {
  const found = surfaceAt(app, place);
  if (!found) return;
  const size = app.state.scene.resolution;
  app.pick(found.page, Math.floor(found.uv[1] * size), Math.floor(found.uv[0] * size), found);
}

function onKey(app, event) {
  if (typing(event) || at("help").open) return;
  const { state } = app;
  const key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
  const inAtlas = event.target === at("atlas");
  if (ARROWS[key] && !ownsArrows(event)) {
    const [x, y] = ARROWS[key];
    if (inAtlas) {
      const { page, row, column } = state.picked ?? { page: state.page, row: state.scene.resolution >> 1, column: state.scene.resolution >> 1 };
      app.pick(page, row - y, column + x);
    } else if (event.shiftKey) shift(state.camera, 0.05 * x, 0.05 * y);
    else turn(state.camera, 0.08 * x, 0.08 * y);
  } else if (key === "+" || key === "=" || key === "-") {
    const steps = key === "-" ? -1 : 1;
    if (inAtlas) state.atlas.zoom = Math.min(Math.max(state.atlas.zoom / 0.86 ** steps, 0.5), state.scene.resolution / 8);
    else zoom(state.camera, steps);
  } else if (FLIGHT[key]) {
    fly(state.camera, ...FLIGHT[key].map((part) => part * state.camera.radius * 0.04));
  } else if (key === "Enter" && event.target === at("stage")) {
    pickAt(app, { x: 0, y: 0 });
  } else if (key === "0") {
    state.camera = firstView(state.scene);
    fitAtlas(app);
  } else if (/^[1-9]$/.test(key)) {
    app.setMode(state.modes[Number(key) - 1]);
  } else if (key === "f") state.falseColour = !state.falseColour;
  else if (key === "t") state.smooth = !state.smooth;
  else if (key === "r") state.exposure = 0;
  else if (key === "[" || key === "]") state.exposure = Math.min(Math.max(state.exposure + (key === "[" ? -0.5 : 0.5), -8), 8);
  else if (key === "," || key === ".") app.setPage(state.page + (key === "," ? -1 : 1));
  else if (key === "?") at("help").showModal();
  else return;
  event.preventDefault();
  app.update();
}
