// Fetches and decodes the data of the page: the scene, its arrays, textures and lightmap pages.

const TYPES = { float: Float32Array, uint: Uint32Array };

/** Fetches scene.json and the arrays; `sections[name].width` is the number of components of array `name`. */
export async function loadScene() {
  const scene = await (await ask("scene.json")).json();
  const bytes = await (await ask("geometry.bin")).arrayBuffer();
  scene.arrays = {};
  for (const [name, { offset, rows, width, type }] of Object.entries(scene.sections)) {
    scene.arrays[name] = new TYPES[type](bytes, offset, rows * width);
  }
  return scene;
}

/** Fetches a lightmap page: {numbers, width, half}; `width` is components per texel, `half` means 16-bit floats. */
export async function loadPage(scene, channel, page) {
  const bytes = await (await ask(`page/${encodeURIComponent(channel.name)}/${page}.bin`)).arrayBuffer();
  const width = channel.width === 1 ? 1 : 4;
  const half = bytes.byteLength === 2 * width * scene.resolution ** 2;
  return { numbers: half ? new Uint16Array(bytes) : new Float32Array(bytes), width, half };
}

/** Fetches the texel states of a page, one byte for each texel. */
export async function loadStatus(page) {
  return new Uint8Array(await (await ask(`status/${page}.bin`)).arrayBuffer());
}

/** Fetches a texture: {numbers, width, height, srgb}. */
export async function loadImage(scene, number) {
  const bytes = await (await ask(`image/${number}.bin`)).arrayBuffer();
  const image = scene.images[number];
  return { ...image, numbers: image.srgb ? new Uint8Array(bytes) : new Float32Array(bytes) };
}

/** Returns the components of one texel, without rounding. */
export function texelValue(loaded, channel, resolution, row, column) {
  const first = (row * resolution + column) * loaded.width;
  const stored = loaded.numbers.subarray(first, first + channel.width);
  return Array.from(stored, (number) => (loaded.half ? fromHalf(number) : number));
}

/** Returns the value of a 16-bit float (IEEE 754) from its bits. */
export function fromHalf(bits) {
  const sign = bits & 0x8000 ? -1 : 1;
  const exponent = (bits >> 10) & 31;
  const fraction = bits & 1023;
  if (exponent === 31) return fraction ? NaN : sign * Infinity;
  if (exponent === 0) return sign * fraction * 2 ** -24;
  return sign * (1024 + fraction) * 2 ** (exponent - 25);
}

async function ask(address) {
  const answer = await fetch(address).catch(() => null);
  if (!answer) throw new Error("the server does not answer; start it again and reload this page");
  if (!answer.ok) throw new Error(`the server has no ${address} (${answer.status})`);
  return answer;
}
