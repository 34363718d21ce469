// Entry point of the page: loads the bake, keeps the user's choices, and passes them to the renderer.

import { bindControls, controls } from "./controls.js";
import { loadImage, loadPage, loadScene, loadStatus, texelValue } from "./data.js";
import { firstView, frame, project } from "./orbit.js";
import { element, count, showLegend, showPicked } from "./panel.js";
import { colourAt, pickTexel } from "./pick.js";
import { MODES } from "./shaders.js";
import { draw, loadThree, makeView, pageTexture, statusTexture } from "./view.js";

const at = (id) => document.getElementById(id);

start().catch((error) => say(error.message, true));

async function start() {
  say("loading the scene ...");
  const scene = await loadScene();
  document.title = `${scene.name} - baker view`;
  const THREE = await loadThree(scene.three);
  const images = await Promise.all(scene.images.map((_, number) => loadImage(scene, number)));
  const state = {
    scene,
    images,
    view: makeView(THREE, scene, images, at("canvas")),
    lens: new THREE.PerspectiveCamera(),
    camera: firstView(scene),
    modes: modesOf(scene),
    mode: null,
    page: 0,
    atlas: { u: 0.5, v: 0.5, zoom: 0.97 },
    exposure: 0,
    falseColour: false,
    smooth: true,
    ranges: new Map(scene.channels.map((channel) => [channel.name, firstRange(channel)])),
    picked: null,
    channels: new Map(),
    status: [],
  };
  let waiting = false;
  const app = { state, setMode, setPage, pick, redraw, update };
  for (let page = 0; page < scene.pages; page += 1) {
    state.status.push(await loadStatus(page));
    state.view.pages[page].statusPage.value = statusTexture(state.view, state.status[page], scene.resolution);
  }
  showFacts(scene);
  bindControls(app);
  await setMode(state.modes.find(({ enabled }) => enabled));
  say(scene.warnings.join("; ") || "drag turns, wheel zooms, click picks; ? for keys");
  document.documentElement.dataset.ready = "yes";

  /** Switches to another display mode; the pages of its channel are fetched at the first use. */
  async function setMode(mode) {
    if (!mode || !mode.enabled) return;
    state.mode = mode;
    controls.showMode(app);
    if (mode.channel) {
      const pages = await channelPages(state, mode.channel);
      if (state.mode !== mode) return; // the user has chosen another mode in the meantime
      pages.forEach((page, number) => {
        page.texture ??= pageTexture(state.view, page.loaded, scene.resolution);
        state.view.pages[number].page.value = page.texture;
      });
    }
    update();
    document.documentElement.dataset.shown = mode.id;
  }

  function setPage(page) {
    state.page = Math.min(Math.max(page, 0), scene.pages - 1);
    update();
  }

  /** Picks texel (row, column) of a page; without `surface`, the surface at the centre of the texel is searched. */
  async function pick(page, row, column, surface = null) {
    const size = scene.resolution;
    [row, column] = [row, column].map((value) => Math.min(Math.max(value, 0), size - 1));
    const centre = [(column + 0.5) / size, (row + 0.5) / size];
    surface ??= pickTexel(scene, page, ...centre);
    const picked = { page, row, column, surface, centre };
    state.picked = picked;
    setPage(page);
    const values = [];
    for (const channel of scene.channels) {
      const loaded = (await channelPages(state, channel))[page].loaded;
      values.push({ channel, value: texelValue(loaded, channel, size, row, column) });
    }
    if (state.picked !== picked) return;
    const status = state.status[page][row * size + column];
    const colour = surface && colourAt(scene, images, surface);
    showPicked(at("picked-body"), { page, row, column, status, surface, values, colour });
  }

  /** Updates the uniforms of the shaders, the legend and the controls from the state, and redraws. */
  function update() {
    const { mode, view } = state;
    const channel = mode.channel;
    const range = channel && state.ranges.get(channel.name);
    const { shared } = view;
    shared.mode.value = mode.mode;
    shared.exposure.value = exposureOf(scene) * 2 ** state.exposure;
    shared.brightness.value = mode.mode === MODES.lit ? shared.exposure.value * Math.PI : brightnessOf(state);
    shared.smoothed.value = state.smooth;
    shared.falseColour.value = falseColour(state);
    shared.grey.value = channel?.width === 1;
    if (range) {
      shared.range.value.set(range.low, range.high);
      shared.logarithmic.value = range.log;
    }
    showLegend(at("legend"), legendOf(state), scene.status);
    controls.show(app);
    redraw();
  }

  /** Requests a redraw; several requests before the next animation frame cause one redraw. */
  function redraw() {
    if (waiting || !state.mode) return;
    waiting = true;
    requestAnimationFrame(() => {
      waiting = false;
      paint(state);
    });
  }
}

/** Returns a promise of the pages of a channel, each {loaded, texture}; they are fetched once. */
function channelPages(state, channel) {
  if (!state.channels.has(channel.name)) {
    const fetchAll = async () => {
      const pages = [];
      for (let page = 0; page < channel.files.length; page += 1) {
        pages.push({ loaded: await loadPage(state.scene, channel, page), texture: null });
      }
      return pages;
    };
    const wanted = fetchAll();
    state.channels.set(channel.name, wanted);
    wanted.catch((error) => say(error.message, true));
  }
  return state.channels.get(channel.name);
}

function paint(state) {
  const { view, lens, camera, atlas, picked } = state;
  const stage = at("stage");
  const { eye } = frame(camera);
  lens.fov = camera.fov;
  lens.aspect = stage.clientWidth / Math.max(stage.clientHeight, 1);
  lens.near = Math.max(camera.distance * 0.01, camera.radius * 1e-4);
  lens.far = camera.distance + camera.radius * 50;
  lens.position.set(...eye);
  lens.lookAt(...camera.target);
  lens.updateProjectionMatrix();
  lens.updateMatrixWorld();
  view.shared.atlasWindow.value.set(atlas.u, atlas.v, atlas.zoom);
  draw(view, lens, stage, at("atlas"), state.page);

  const spot = picked?.surface && project(camera, picked.surface.position, lens.aspect);
  place(at("stage-ring"), spot);
  const onPage = picked && picked.page === state.page;
  const size = Math.max((at("atlas").clientWidth * atlas.zoom) / state.scene.resolution + 4, 14);
  place(
    at("atlas-ring"),
    onPage && { x: (picked.centre[0] - atlas.u) * 2 * atlas.zoom, y: (atlas.v - picked.centre[1]) * 2 * atlas.zoom },
    size,
  );
}

function place(ring, spot, size = 20) {
  ring.hidden = !spot;
  if (!spot) return;
  Object.assign(ring.style, {
    left: `${50 + 50 * spot.x}%`,
    top: `${50 - 50 * spot.y}%`,
    width: `${size}px`,
    height: `${size}px`,
    margin: `${-size / 2}px`,
  });
}

function modesOf(scene) {
  const channel = (name) => scene.channels.find((known) => known.name === name);
  const [light, ao] = [channel("irradiance"), channel("ao")];
  const others = scene.channels.filter((known) => known !== light && known !== ao);
  return [
    { id: "lit", label: "Albedo \u00d7 light", mode: MODES.lit, channel: light, enabled: Boolean(light) },
    { id: "irradiance", label: "Irradiance", mode: MODES.light, channel: light, enabled: Boolean(light) },
    { id: "ao", label: "AO", mode: MODES.plain, channel: ao, enabled: Boolean(ao) },
    { id: "checker", label: "UV checker", mode: MODES.checker, channel: null, enabled: true },
    { id: "status", label: "Texel status", mode: MODES.status, channel: null, enabled: true },
    ...others.map((other) => ({
      id: other.name,
      label: other.name.replaceAll("_", " "),
      mode: MODES.plain,
      channel: other,
      enabled: true,
    })),
  ];
}

function firstRange(channel) {
  if (channel.name === "ao") return { low: 0, high: 1, log: false };
  const high = channel.high > 0 ? channel.high : 1;
  const low = Math.max(channel.low, high * 1e-4);
  // Use a logarithmic scale if the values span more than two decades.
  return { low: short3(low), high: short3(high), log: high / low > 100 };
}

function short3(value) {
  return Number(value.toPrecision(3));
}

// Linear display value, 0 to 1, of a white surface with the median irradiance at exposure 0, for a bake without a
// suggested exposure.
const MIDDLE = 0.35;

function exposureOf(scene) {
  if (scene.suggestedExposure) return scene.suggestedExposure / Math.PI;
  const light = scene.channels.find(({ name }) => name === "irradiance");
  const typical = light?.median || light?.high || 0;
  return typical > 0 ? MIDDLE / typical : 1 / Math.PI;
}

function brightnessOf(state) {
  // Ambient occlusion is from 0 to 1 and is not scaled; other channels are scaled by the exposure.
  return state.mode.id === "ao" ? 1 : 2 ** state.exposure;
}

function falseColour(state) {
  const { mode } = state.mode;
  return state.falseColour && (mode === MODES.light || mode === MODES.plain);
}

function legendOf(state) {
  const { mode, scene, view } = state;
  if (mode.mode === MODES.status) return { title: "What each texel is", kind: "status" };
  if (mode.mode === MODES.checker) {
    return { title: "UV checker", kind: "note", at: "a square is 8 \u00d7 8 texels; each object has its own hue" };
  }
  const unit = mode.channel.unit === "1" ? "" : mode.channel.unit;
  if (falseColour(state)) {
    const { low, high, log } = state.ranges.get(mode.channel.name);
    const value = (t) => (log ? low * (high / low) ** t : low + (high - low) * t);
    const title = mode.channel.width === 3 ? `${mode.label}, luminance` : mode.label;
    return { title, unit, kind: "ramp", at: value };
  }
  const white = mode.mode === MODES.plain ? 1 / view.shared.brightness.value : 1 / view.shared.exposure.value;
  const linear = (t) => (t <= 0.04045 ? t / 12.92 : ((t + 0.055) / 1.055) ** 2.4);
  const title = mode.mode === MODES.lit ? "Irradiance of a white surface" : mode.label;
  return { title, unit: unit || "open share", kind: "grey", at: (t) => white * linear(t) };
}

function showFacts(scene) {
  at("name").textContent = scene.name;
  const pages = scene.pages === 1 ? "one page" : `${scene.pages} pages`;
  const texels = scene.status[1] + scene.status[3] + scene.status[4];
  const facts = [
    `${scene.instances.length} objects`,
    `${count(scene.triangles)} triangles`,
    `${pages} of ${scene.resolution}\u00b2`,
    `${count(texels)} texels`,
  ];
  at("facts").textContent = facts.join(" \u00b7 ");
  at("facts").title = `${scene.folder}\nbaker ${scene.baker}, ${scene.created}`;
  for (let page = 0; page < scene.pages; page += 1) at("page").append(element("option", { value: page }, String(page)));
}

function say(text, loud = false) {
  at("note").textContent = text;
  at("note").classList.toggle("loud", loud);
}
