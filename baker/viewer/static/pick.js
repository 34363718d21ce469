// Finds the surface under the mouse and the surface under a texel.

/** Returns the nearest surface that a ray hits, or null: {triangle, weights (barycentric), position, world, uv, ...}. */
export function pickRay(scene, images, { origin, direction }) {
  const hits = [];
  for (const group of scene.groups) {
    const material = scene.materials[group.material];
    for (let t = group.start; t < group.start + group.count; t += 1) {
      const hit = meet(scene, t, origin, direction, material.doubleSided);
      if (hit) hits.push({ ...hit, triangle: t, material });
    }
  }
  hits.sort((a, b) => a.distance - b.distance);
  // Skip hits on parts that are not drawn, such as the holes in a MASK texture.
  const found = hits.find((hit) => alphaAt(scene, images, hit) >= (hit.material.alphaMode === "MASK" ? hit.material.alphaCutoff : 0));
  return found ? surface(scene, found.triangle, found.weights) : null;
}

/** Returns the surface at (u, v) of a page, or null if no triangle contains this point. */
export function pickTexel(scene, page, u, v) {
  const { triangle, pageUv } = scene.arrays;
  for (const group of scene.groups) {
    if (group.page !== page) continue;
    for (let t = group.start; t < group.start + group.count; t += 1) {
      const [a, b, c] = [0, 1, 2].map((k) => 2 * triangle[3 * t + k]);
      const weights = within(pageUv, a, b, c, u, v);
      if (weights) return surface(scene, t, weights);
    }
  }
  return null;
}

/** Returns factor x vertex colour x texture of the base colour: linear red, green, blue, and alpha. */
export function colourAt(scene, images, { triangle, weights, material }) {
  const vertex = blend(scene, "colour", triangle, weights);
  let colour = material.colour.map((value, k) => value * vertex[k]);
  if (material.colourMap) {
    const texel = textureAt(images[material.colourMap.image], material.colourMap.wrap, blend(scene, "colourUv", triangle, weights));
    colour = colour.map((value, k) => value * texel[k]);
  }
  return colour;
}

function surface(scene, triangle, weights) {
  const position = blend(scene, "position", triangle, weights);
  const group = scene.groups.find(({ start, count }) => triangle >= start && triangle < start + count);
  return {
    triangle,
    weights,
    material: scene.materials[group.material],
    page: group.page,
    instance: scene.instances[scene.arrays.instance[triangle]],
    position,
    // Positions are relative to `scene.origin`.
    world: position.map((value, axis) => value + scene.origin[axis]),
    uv: blend(scene, "pageUv", triangle, weights),
  };
}

function blend(scene, name, t, weights) {
  const array = scene.arrays[name];
  const { width } = scene.sections[name];
  const vertices = scene.arrays.triangle.subarray(3 * t, 3 * t + 3);
  return Array.from({ length: width }, (_, k) =>
    weights.reduce((sum, weight, corner) => sum + weight * array[width * vertices[corner] + k], 0),
  );
}

// Based on: Moeller, Trumbore, Fast, minimum storage ray/triangle intersection, 1997.
function meet(scene, t, origin, direction, bothSides) {
  const { triangle, position } = scene.arrays;
  const [a, b, c] = [3 * triangle[3 * t], 3 * triangle[3 * t + 1], 3 * triangle[3 * t + 2]];
  const [ax, ay, az] = [position[a], position[a + 1], position[a + 2]];
  const [ex, ey, ez] = [position[b] - ax, position[b + 1] - ay, position[b + 2] - az];
  const [fx, fy, fz] = [position[c] - ax, position[c + 1] - ay, position[c + 2] - az];
  const [dx, dy, dz] = direction;
  const [px, py, pz] = [dy * fz - dz * fy, dz * fx - dx * fz, dx * fy - dy * fx];
  const area = ex * px + ey * py + ez * pz;
  if (bothSides ? area === 0 : area <= 0) return null;
  const [sx, sy, sz] = [origin[0] - ax, origin[1] - ay, origin[2] - az];
  const v = (sx * px + sy * py + sz * pz) / area;
  if (v < 0 || v > 1) return null;
  const [qx, qy, qz] = [sy * ez - sz * ey, sz * ex - sx * ez, sx * ey - sy * ex];
  const w = (dx * qx + dy * qy + dz * qz) / area;
  if (w < 0 || v + w > 1) return null;
  const distance = (fx * qx + fy * qy + fz * qz) / area;
  return distance > 0 ? { distance, weights: [1 - v - w, v, w] } : null;
}

function within(uv, a, b, c, u, v) {
  const [ex, ey] = [uv[b] - uv[a], uv[b + 1] - uv[a + 1]];
  const [fx, fy] = [uv[c] - uv[a], uv[c + 1] - uv[a + 1]];
  const area = ex * fy - ey * fx;
  if (area === 0) return null;
  const [sx, sy] = [u - uv[a], v - uv[a + 1]];
  const second = (sx * fy - sy * fx) / area;
  const third = (ex * sy - ey * sx) / area;
  return second >= 0 && third >= 0 && second + third <= 1 ? [1 - second - third, second, third] : null;
}

function alphaAt(scene, images, hit) {
  return hit.material.alphaMode === "MASK" ? colourAt(scene, images, hit)[3] : 1;
}

function textureAt(image, wrap, uv) {
  const size = [image.width, image.height];
  const [column, row] = uv.map((value, axis) => Math.min(Math.floor(wrapped(value, wrap[axis]) * size[axis]), size[axis] - 1));
  const first = 4 * (row * image.width + column);
  const stored = Array.from(image.numbers.subarray(first, first + 4));
  return image.srgb ? stored.map((value, k) => (k === 3 ? value / 255 : linear(value / 255))) : stored;
}

function wrapped(value, kind) {
  if (kind === "clamp") return Math.min(Math.max(value, 0), 1);
  const part = value - Math.floor(value);
  return kind === "mirror" && Math.floor(value) % 2 !== 0 ? 1 - part : part;
}

function linear(value) {
  return value <= 0.04045 ? value / 12.92 : ((value + 0.055) / 1.055) ** 2.4;
}
