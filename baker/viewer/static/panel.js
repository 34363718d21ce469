// Fills the legend and the panel about the picked texel.

import { rampGradient, srgb, STATUS } from "./colours.js";

/** Creates an element with the children `parts`. Strings become text nodes, so names in files cannot add HTML. */
export function element(tag, attributes = {}, ...parts) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
  made.append(...parts);
  return made;
}

/** Returns a number as text with at most four significant digits. */
export function short(value) {
  if (!Number.isFinite(value)) return String(value);
  const size = Math.abs(value);
  if (size !== 0 && (size < 1e-3 || size >= 1e6)) return value.toExponential(1);
  return String(Number(value.toPrecision(size >= 100 ? 4 : 3)));
}

/** Returns a count with thin spaces between thousands. */
export function count(value) {
  return String(value).replace(/\B(?=(\d{3})+$)/g, "\u2009");
}

/** Fills the legend. `at` is the text of a note, or a function from a position on the colour bar, 0 to 1, to a value. */
export function showLegend(legend, { title, unit, kind, at }, status) {
  const heading = element("h3", {}, title);
  if (unit) heading.append(element("span", {}, ` ${unit}`));
  legend.replaceChildren(heading);
  if (kind === "status") {
    const total = status.slice(1).reduce((sum, n) => sum + n, 0);
    const list = element("ul");
    STATUS.forEach(({ name, colour, says }, number) => {
      const swatch = element("span", { class: "swatch" });
      swatch.style.background = colour;
      const share = number && total ? ` (${short((100 * status[number]) / total)} %)` : "";
      const row = element("li", { title: says, "data-status": name });
      row.append(element("span", {}, swatch, name));
      row.append(element("span", { class: "number" }, count(status[number])), element("span", { class: "number" }, share));
      list.append(row);
    });
    legend.append(list);
  } else if (kind === "note") {
    legend.append(element("div", { class: "dim" }, at));
  } else {
    const bar = element("span", { class: "bar", role: "img", "aria-label": `${title}: ${short(at(0))} to ${short(at(1))} ${unit}` });
    bar.style.background = kind === "ramp" ? rampGradient() : "linear-gradient(90deg, #000, #fff)";
    const ticks = element("div", { class: "ticks" });
    for (const place of [0, 0.25, 0.5, 0.75, 1]) {
      const tick = element("span", {}, short(at(place)));
      tick.style.left = `${100 * place}%`;
      ticks.append(tick);
    }
    legend.append(bar, ticks);
  }
}

/** Fills the list of properties of the picked texel. `surface` is null if no surface covers the texel. */
export function showPicked(body, { page, row, column, status, surface, values, colour }) {
  const list = element("dl");
  const add = (term, field, ...parts) => {
    const shown = element("dd", { "data-field": field }, ...parts);
    list.append(element("dt", {}, term), shown);
    return shown;
  };
  if (surface) {
    const node = element("span", { class: "dim" }, ` node ${surface.instance.node}`);
    add("Object", "object", surface.instance.name || "no name").append(node);
    if (surface.material.name) add("Material", "material", surface.material.name);
  } else {
    add("Object", "object", "no surface here");
  }
  add("Texel", "texel", `page ${page}, row ${row}, column ${column}`);
  const kind = STATUS[status];
  const swatch = element("span", { class: "chip" });
  swatch.style.background = kind.colour;
  const told = add("Status", "status", swatch, kind.name);
  told.title = kind.says;
  if (status === 3 || status === 4) told.classList.add("warn");
  for (const { channel, value } of values) {
    const unit = channel.unit && channel.unit !== "1" ? ` ${channel.unit}` : "";
    const title = channel.name === "ao" ? "AO" : channel.name[0].toUpperCase() + channel.name.slice(1).replaceAll("_", " ");
    if (value.length === 3) {
      const row = add(title, channel.name);
      row.classList.add("value");
      ["R", "G", "B"].forEach((letter, k) => {
        const name = element("span", { class: letter.toLowerCase() }, `${letter}\u00a0`);
        const number = element("span", { "data-part": letter }, String(value[k]));
        row.append(element("span", { class: "part" }, name, number), " ");
      });
      row.lastElementChild.append(unit); // keeps the unit on the line of the number
    } else {
      add(title, channel.name, `${value.join("  ")}${unit}`).classList.add("value");
    }
  }
  if (colour) {
    const chip = element("span", { class: "chip" });
    chip.style.background = `rgb(${colour.slice(0, 3).map((part) => Math.round(255 * srgb(part))).join(" ")})`;
    add("Albedo", "albedo", chip, colour.slice(0, 3).map(short).join("  "));
    const light = values.find(({ channel }) => channel.name === "irradiance");
    if (light) {
      const leaves = light.value.map((value, k) => short((value * colour[k]) / Math.PI)).join("  ");
      add("Albedo \u00d7 E / \u03c0", "radiance", `${leaves} cd/m\u00b2`);
    }
  }
  if (surface) {
    add("Position", "position", surface.world.map((value) => value.toFixed(4)).join("  "), " m");
    add("Lightmap uv", "uv", surface.uv.map((value) => value.toFixed(6)).join("  "));
    const made = surface.instance.kept ? "the file's own uv" : "unwrapped";
    add("Density", "density", `${short(surface.instance.density)} texels/m, ${made}`);
  }
  body.replaceChildren(list);
}
