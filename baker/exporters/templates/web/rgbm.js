// Reads RGBM pages: RGBA pictures with E = top * (rgb * a)^2.2, where rgb and a are the stored bytes / 255.

const LARGEST_HALF = 65504;
let context;

// Returns { width, height, data } of a picture: four half floats per texel, first row first. `top` is the largest E;
// `toHalf` converts a number to the bits of a half float.
export async function readRgbm(url, top, toHalf) {
  const response = await fetch(url);
  if (!response.ok) throw new Error(`${url} cannot be loaded`);
  const { width, height, bytes } = await storedBytes(await response.blob());
  // E depends only on the product of two bytes.
  const table = new Uint16Array(255 * 255 + 1);
  for (let i = 0; i < table.length; i += 1) table[i] = toHalf(rounded(top * (i / 65025) ** 2.2));
  const data = new Uint16Array(bytes.length);
  const one = toHalf(1);
  for (let at = 0; at < data.length; at += 4) {
    for (let channel = at; channel < at + 3; channel += 1) data[channel] = table[bytes[channel] * bytes[at + 3]];
    data[at + 3] = one;
  }
  return { width, height, data };
}

// Rounds a number to the nearest half float; the functions `toHalf` of engines drop the digits that do not fit.
function rounded(value) {
  const step = 2 ** (Math.max(Math.floor(Math.log2(value)), -14) - 10);
  return Math.min(Math.round(value / step) * step, LARGEST_HALF);
}

// Returns the bytes of a picture unchanged. A 2D canvas would multiply colours by alpha and round them.
async function storedBytes(blob) {
  const picture = await createImageBitmap(blob, { premultiplyAlpha: 'none', colorSpaceConversion: 'none' });
  const { width, height } = picture;
  context ??= new OffscreenCanvas(1, 1).getContext('webgl2');
  const gl = context;
  const texture = gl.createTexture();
  gl.bindTexture(gl.TEXTURE_2D, texture);
  gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, gl.RGBA, gl.UNSIGNED_BYTE, picture);
  const framebuffer = gl.createFramebuffer();
  gl.bindFramebuffer(gl.FRAMEBUFFER, framebuffer);
  gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, texture, 0);
  const bytes = new Uint8Array(width * height * 4);
  gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, bytes);
  gl.deleteFramebuffer(framebuffer);
  gl.deleteTexture(texture);
  picture.close();
  return { width, height, bytes };
}
