// The shaders of both views: the 3D view, and the atlas view with the same triangles at their lightmap uv.

export const MODES = { lit: 0, light: 1, plain: 2, checker: 3, status: 4 };

export const VERTEX = `
precision highp float;
in vec3 position;
in vec3 normal;
in vec2 pageUv;
in vec2 colourUv;
in vec2 emissionUv;
in vec4 colour;
in float owner;
uniform mat4 projectionMatrix, modelViewMatrix;
uniform vec3 atlasWindow;  // xy: uv in the middle of the atlas view; z: zoom, 1 shows the whole page
uniform bool unfolded;
out vec2 vPageUv, vColourUv, vEmissionUv;
out vec4 vColour;
out vec3 vNormal, vToEye;
flat out float vOwner;

void main() {
  vPageUv = pageUv;
  vColourUv = colourUv;
  vEmissionUv = emissionUv;
  vColour = colour;
  vOwner = owner;
  vec4 seen = modelViewMatrix * vec4(position, 1.0);
  vNormal = mat3(modelViewMatrix) * normal;
  vToEye = -seen.xyz;
  // Flip v, so that the first row of a page, v = 0, is at the top.
  vec2 flatPlace = (pageUv - atlasWindow.xy) * vec2(2.0, -2.0) * atlasWindow.z;
  gl_Position = unfolded ? vec4(flatPlace, 0.0, 1.0) : projectionMatrix * seen;
}`;

const COMMON = `
precision highp float;
precision highp int;
precision highp sampler2D;
uniform int mode;
uniform sampler2D page, statusPage, ramp;
uniform vec3 statusColour[5];
uniform float exposure;    // linear factor of irradiance, including 1 / pi
uniform float brightness;  // linear factor of other channels and of emission
uniform bool smoothed, falseColour, logarithmic, grey;
uniform vec2 range;
out vec4 fragment;

vec3 encode(vec3 linear) {
  vec3 v = clamp(linear, 0.0, 1.0);
  return mix(v * 12.92, 1.055 * pow(v, vec3(1.0 / 2.4)) - 0.055, step(0.0031308, v));
}

vec3 texel(ivec2 place) {
  vec3 value = texelFetch(page, clamp(place, ivec2(0), textureSize(page, 0) - 1), 0).rgb;
  return grey ? value.rrr : value;
}

// Bilinear lookup in the shader, because not all hardware can filter 32-bit float textures.
vec3 lookUp(vec2 uv) {
  vec2 place = uv * vec2(textureSize(page, 0));
  if (!smoothed) return texel(ivec2(floor(place)));
  vec2 low = floor(place - 0.5), part = place - 0.5 - low;
  ivec2 at = ivec2(low);
  return mix(mix(texel(at), texel(at + ivec2(1, 0)), part.x),
             mix(texel(at + ivec2(0, 1)), texel(at + ivec2(1, 1)), part.x), part.y);
}

vec3 statusAt(vec2 uv) {
  ivec2 size = textureSize(statusPage, 0);
  ivec2 place = clamp(ivec2(floor(uv * vec2(size))), ivec2(0), size - 1);
  return statusColour[clamp(int(texelFetch(statusPage, place, 0).r * 255.0 + 0.5), 0, 4)];
}

// Returns the sRGB-encoded colour of a value: scaled and encoded, or from the false-colour ramp.
vec3 shown(vec3 value) {
  if (any(isnan(value)) || any(isinf(value))) return vec3(1.0, 0.0, 1.0);
  if (falseColour) {
    float x = grey ? value.r : dot(value, vec3(0.2126, 0.7152, 0.0722));
    vec3 v = vec3(x, range);
    if (logarithmic) v = log(max(v, vec3(1e-12)));
    return texture(ramp, vec2(clamp((v.x - v.y) / max(v.z - v.y, 1e-12), 0.0, 1.0) * 255.0 / 256.0 + 0.5 / 256.0, 0.5)).rgb;
  }
  return encode(value * (mode == ${MODES.light} ? exposure : brightness));
}
`;

export const SURFACE = `${COMMON}
in vec2 vPageUv, vColourUv, vEmissionUv;
in vec4 vColour;
in vec3 vNormal, vToEye;
flat in float vOwner;
uniform sampler2D colourMap, emissionMap;
uniform vec4 baseColour;
uniform vec3 emission;
uniform bool hasColourMap, hasEmissionMap, unfolded;
uniform float alphaCutoff;  // -1: blend with alpha; otherwise discard fragments with a smaller alpha

vec3 hue(float number) {
  float h = fract(number * 0.61803398875 + 0.08) * 6.0;
  return clamp(vec3(abs(h - 3.0) - 1.0, 2.0 - abs(h - 2.0), 2.0 - abs(h - 4.0)), 0.0, 1.0);
}

// Shading by a light at the eye, which shows the shape in modes without baked light.
float headlight() {
  return unfolded ? 1.0 : 0.55 + 0.45 * abs(dot(normalize(vNormal), normalize(vToEye)));
}

// A checker of squares of 8 x 8 texels, with a different hue for each object.
vec3 checker() {
  vec2 square = vPageUv * vec2(textureSize(statusPage, 0)) / 8.0;
  vec2 wide = max(fwidth(square), 1e-6);
  // Average the pattern over a pixel, so that distant squares do not flicker.
  vec2 wave = clamp((abs(fract(square * 0.5 + 0.25) - 0.5) - 0.25) * 2.0 / wide, -0.5, 0.5);
  float light = 0.5 + 2.0 * wave.x * wave.y * step(max(wide.x, wide.y), 1.0);
  vec3 colour = mix(vec3(0.75), hue(vOwner), 0.62);
  return encode(colour * mix(0.18, 0.85, light) * headlight());
}

void main() {
  vec4 colour = baseColour * vColour;
  if (hasColourMap) colour *= texture(colourMap, vColourUv);
  if (alphaCutoff >= 0.0 && colour.a < alphaCutoff) discard;
  float alpha = alphaCutoff >= 0.0 ? 1.0 : colour.a;
  vec3 seen;
  if (mode == ${MODES.lit}) {
    vec3 emitted = emission;
    if (hasEmissionMap) emitted *= texture(emissionMap, vEmissionUv).rgb;
    // The exposure includes the 1 / pi that converts radiosity to radiance. Emission is radiance already.
    vec3 light = lookUp(vPageUv);
    seen = any(isnan(light)) ? vec3(1.0, 0.0, 1.0) : encode(colour.rgb * light * exposure + emitted * brightness);
  } else if (mode == ${MODES.checker}) {
    seen = checker();
  } else if (mode == ${MODES.status}) {
    seen = statusAt(vPageUv) * headlight();
  } else {
    seen = shown(lookUp(vPageUv));
  }
  fragment = vec4(seen, alpha);
}`;

export const SHEET_VERTEX = `
precision highp float;
in vec3 position;
uniform vec3 atlasWindow;
out vec2 vPageUv;
void main() {
  vPageUv = position.xy;
  gl_Position = vec4((position.xy - atlasWindow.xy) * vec2(2.0, -2.0) * atlasWindow.z, 0.0, 1.0);
}`;

// Draws the whole page in the atlas view; the unfolded triangles are drawn over it in some modes.
export const SHEET = `${COMMON}
in vec2 vPageUv;
void main() {
  if (mode == ${MODES.lit} || mode == ${MODES.checker}) {
    fragment = vec4(statusColour[0], 1.0);
  } else if (mode == ${MODES.status}) {
    fragment = vec4(statusAt(vPageUv), 1.0);
  } else {
    // If texels are smaller than a pixel, average 4 x 4 samples of the pixel.
    vec2 dx = dFdx(vPageUv) / 4.0, dy = dFdy(vPageUv) / 4.0;
    vec2 size = vec2(textureSize(page, 0));
    if (max(length(dx * size), length(dy * size)) * 4.0 < 1.5) {
      fragment = vec4(shown(texel(ivec2(floor(vPageUv * size)))), 1.0);
      return;
    }
    vec3 sum = vec3(0.0);
    for (int k = 0; k < 16; ++k) {
      vec2 place = vPageUv + dx * (float(k & 3) - 1.5) + dy * (float(k >> 2) - 1.5);
      sum += shown(texel(ivec2(floor(place * size))));
    }
    fragment = vec4(sum / 16.0, 1.0);
  }
}`;
