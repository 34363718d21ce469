// Draws the 3D view and the atlas view into one canvas with three.js, from the same triangles.

import { rampBytes, rgb, STATUS } from "./colours.js";
import { MODES, SHEET, SHEET_VERTEX, SURFACE, VERTEX } from "./shaders.js";

const WRAP = { repeat: "RepeatWrapping", mirror: "MirroredRepeatWrapping", clamp: "ClampToEdgeWrapping" };

/** Loads three.js from an ES module or from a script that sets the global THREE. */
export async function loadThree({ file, module }) {
  const address = new URL(file, document.baseURI).href;
  if (module) return import(address);
  await new Promise((resolve, reject) => {
    const script = document.createElement("script");
    script.addEventListener("load", resolve);
    script.addEventListener("error", () => reject(new Error("three.js could not be loaded")));
    script.src = address;
    document.head.append(script);
  });
  return window.THREE;
}

/** Creates the renderer and all objects that it draws. `images` are the decoded textures. */
export function makeView(THREE, scene, images, canvas) {
  const renderer = new THREE.WebGLRenderer({ canvas, antialias: true, powerPreference: "high-performance" });
  if (scene.resolution > renderer.capabilities.maxTextureSize) {
    const most = renderer.capabilities.maxTextureSize;
    throw new Error(`this graphics card shows pages of at most ${most} texels; these have ${scene.resolution}`);
  }
  renderer.autoClear = false;
  renderer.setPixelRatio(window.devicePixelRatio);

  const nothing = dataTexture(THREE, new Uint8Array(4), 1, 1, { format: "RGBAFormat", type: "UnsignedByteType" });
  const shared = {
    mode: { value: MODES.lit },
    exposure: { value: 1 },
    brightness: { value: 1 },
    smoothed: { value: true },
    falseColour: { value: false },
    logarithmic: { value: false },
    grey: { value: false },
    range: { value: new THREE.Vector2(0, 1) },
    ramp: { value: dataTexture(THREE, rampBytes(), 256, 1, { format: "RGBAFormat", type: "UnsignedByteType", smooth: true }) },
    statusColour: { value: STATUS.map(({ colour }) => new THREE.Vector3(...rgb(colour))) },
    atlasWindow: { value: new THREE.Vector3(0.5, 0.5, 0.97) },
  };
  const pages = Array.from({ length: scene.pages }, () => ({ page: { value: nothing }, statusPage: { value: nothing } }));
  const textures = new Map();
  const texture = (used) => {
    if (!used) return nothing;
    const key = `${used.image} ${used.wrap}`;
    if (!textures.has(key)) textures.set(key, colourTexture(THREE, images[used.image], used.wrap));
    return textures.get(key);
  };

  const space = new THREE.Scene();
  const sheet = new THREE.Scene();
  const quad = sheetMesh(THREE, shared);
  sheet.add(quad);
  const attributes = sceneAttributes(THREE, scene);
  for (const group of scene.groups) {
    const material = scene.materials[group.material];
    const geometry = new THREE.BufferGeometry();
    for (const [name, attribute] of Object.entries(attributes)) geometry.setAttribute(name, attribute);
    const index = scene.arrays.triangle.subarray(3 * group.start, 3 * (group.start + group.count));
    geometry.setIndex(new THREE.BufferAttribute(index, 1));
    for (const unfolded of [false, true]) {
      const uniforms = {
        ...shared,
        ...pages[group.page],
        unfolded: { value: unfolded },
        baseColour: { value: new THREE.Vector4(...material.colour) },
        emission: { value: new THREE.Vector3(...material.emission) },
        colourMap: { value: texture(material.colourMap) },
        emissionMap: { value: texture(material.emissionMap) },
        hasColourMap: { value: Boolean(material.colourMap) },
        hasEmissionMap: { value: Boolean(material.emissionMap) },
        // OPAQUE materials ignore alpha: a cutoff of 0 discards nothing.
        alphaCutoff: { value: { OPAQUE: 0, MASK: material.alphaCutoff, BLEND: -1 }[material.alphaMode] },
      };
      const blend = material.alphaMode === "BLEND" && !unfolded;
      const mesh = new THREE.Mesh(
        geometry,
        new THREE.RawShaderMaterial({
          glslVersion: THREE.GLSL3,
          vertexShader: VERTEX,
          fragmentShader: SURFACE,
          uniforms,
          // Cull back faces in the 3D view, as engines do, so that rooms are visible from outside.
          side: unfolded || material.doubleSided ? THREE.DoubleSide : THREE.FrontSide,
          transparent: blend,
          depthWrite: !blend && !unfolded,
          depthTest: !unfolded,
        }),
      );
      mesh.frustumCulled = false;
      mesh.renderOrder = 1;
      mesh.userData.page = group.page;
      (unfolded ? sheet : space).add(mesh);
    }
  }
  const flat = new THREE.Camera();
  return { THREE, renderer, canvas, shared, pages, space, sheet, quad, flat };
}

/** Returns a texture of a lightmap page that `loadPage` has returned. */
export function pageTexture(view, loaded, resolution) {
  return dataTexture(view.THREE, loaded.numbers, resolution, resolution, {
    format: loaded.width === 1 ? "RedFormat" : "RGBAFormat",
    type: loaded.half ? "HalfFloatType" : "FloatType",
  });
}

/** Returns a texture of the texel states of a page. */
export function statusTexture(view, bytes, resolution) {
  return dataTexture(view.THREE, bytes, resolution, resolution, { format: "RedFormat", type: "UnsignedByteType" });
}

/** Draws the scene into the rectangle of the element `stage`, and page number `page` into that of `atlas`. */
export function draw(view, camera, stage, atlas, page) {
  const { renderer, pages, quad, sheet } = view;
  const width = window.innerWidth;
  const height = window.innerHeight;
  renderer.setScissorTest(false);
  renderer.setSize(width, height, false);
  renderer.setScissorTest(true);
  window_(renderer, stage.getBoundingClientRect(), height, 0x0d1015);
  renderer.render(view.space, camera);
  quad.material.uniforms.page = pages[page].page;
  quad.material.uniforms.statusPage = pages[page].statusPage;
  for (const mesh of sheet.children) {
    const whole = view.shared.mode.value === MODES.lit || view.shared.mode.value === MODES.checker;
    mesh.visible = mesh === quad || (whole && mesh.userData.page === page);
  }
  window_(renderer, atlas.getBoundingClientRect(), height, 0x090b0e);
  renderer.render(sheet, view.flat);
}

function window_(renderer, box, height, ground) {
  const place = [box.left, height - box.bottom, box.width, box.height];
  renderer.setViewport(...place);
  renderer.setScissor(...place);
  renderer.setClearColor(ground);
  renderer.clear();
}

function dataTexture(THREE, numbers, width, height, { format, type, smooth = false }) {
  const texture = new THREE.DataTexture(numbers, width, height, THREE[format], THREE[type]);
  texture.minFilter = texture.magFilter = smooth ? THREE.LinearFilter : THREE.NearestFilter;
  texture.needsUpdate = true;
  return texture;
}

function colourTexture(THREE, image, wrap) {
  const type = image.srgb ? "UnsignedByteType" : "FloatType";
  const texture = dataTexture(THREE, image.numbers, image.width, image.height, { format: "RGBAFormat", type });
  [texture.wrapS, texture.wrapT] = wrap.map((name) => THREE[WRAP[name]]);
  if (image.srgb) {
    // With this format the GPU decodes sRGB before it filters, so that linear values are interpolated.
    texture.internalFormat = "SRGB8_ALPHA8";
    texture.generateMipmaps = true;
    texture.minFilter = THREE.LinearMipmapLinearFilter;
    texture.magFilter = THREE.LinearFilter;
    texture.anisotropy = 8;
  }
  return texture;
}

function sceneAttributes(THREE, scene) {
  const { arrays, sections } = scene;
  const attributes = {};
  for (const name of ["position", "normal", "pageUv", "colourUv", "emissionUv", "colour"]) {
    attributes[name] = new THREE.BufferAttribute(arrays[name], sections[name].width);
  }
  const owner = new Float32Array(sections.position.rows);
  arrays.triangle.forEach((vertex, corner) => {
    owner[vertex] = arrays.instance[Math.floor(corner / 3)];
  });
  attributes.owner = new THREE.BufferAttribute(owner, 1);
  return attributes;
}

function sheetMesh(THREE, shared) {
  const geometry = new THREE.BufferGeometry();
  const corners = new Float32Array([0, 0, 0, 0, 1, 0, 1, 1, 0, 1, 0, 0]);
  geometry.setAttribute("position", new THREE.BufferAttribute(corners, 3));
  geometry.setIndex([0, 1, 2, 0, 2, 3]);
  const material = new THREE.RawShaderMaterial({
    glslVersion: THREE.GLSL3,
    vertexShader: SHEET_VERTEX,
    fragmentShader: SHEET,
    uniforms: { ...shared, page: { value: null }, statusPage: { value: null } },
    side: THREE.DoubleSide,
    depthTest: false,
    depthWrite: false,
  });
  const mesh = new THREE.Mesh(geometry, material);
  mesh.frustumCulled = false;
  mesh.renderOrder = 0;
  return mesh;
}
