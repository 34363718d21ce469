// The false-colour ramp, and the colours of the texel states.

// Colours at equal distances along the ramp. Lightness increases evenly, so that the order of values is visible
// in grey and with colour blindness.
const STOPS = ["#140b3d", "#2d2d8f", "#1f68b5", "#179e9e", "#53c06d", "#c4d54c", "#fff2bf"];

// Texel states; the index is the value in status_N.png.
export const STATUS = [
  { name: "empty", colour: "#20262f", says: "no surface" },
  { name: "covered", colour: "#3f8fcb", says: "baked" },
  { name: "dilated", colour: "#4f5d70", says: "grown into the gap between charts" },
  { name: "invalid", colour: "#ff4d6d", says: "inside geometry; filled from its neighbours" },
  { name: "not converged", colour: "#ffb454", says: "still noisy" },
];

/** Returns [red, green, blue], each 0 to 1, of a colour "#rrggbb". */
export function rgb(hex) {
  return [1, 3, 5].map((start) => parseInt(hex.slice(start, start + 2), 16) / 255);
}

/** Returns the ramp as 256 RGBA colours, 4 bytes each. */
export function rampBytes() {
  const stops = STOPS.map(rgb);
  const bytes = new Uint8Array(256 * 4);
  for (let k = 0; k < 256; k += 1) {
    const place = (k / 255) * (stops.length - 1);
    const low = Math.min(Math.floor(place), stops.length - 2);
    for (let c = 0; c < 3; c += 1) {
      const value = stops[low][c] + (stops[low + 1][c] - stops[low][c]) * (place - low);
      bytes[4 * k + c] = Math.round(value * 255);
    }
    bytes[4 * k + 3] = 255;
  }
  return bytes;
}

/** Returns the ramp as a CSS gradient. */
export function rampGradient() {
  return `linear-gradient(90deg, ${STOPS.join(", ")})`;
}

/** Returns the sRGB encoding, 0 to 1, of a linear value. */
export function srgb(linear) {
  const value = Math.min(Math.max(linear, 0), 1);
  return value <= 0.0031308 ? value * 12.92 : 1.055 * value ** (1 / 2.4) - 0.055;
}
