// Loads a baked scene into Babylon.js: scene.glb, with the irradiance pages as light maps.
//
//   import { loadBake } from './babylon/lightmap.js';
//   await loadBake(BABYLON, './babylon/', scene);
//
// BABYLON is the namespace of the library with its glTF loader, from script tags or `import * as BABYLON`.

// Loads the bake in `folder`. Options:
//   exposure  factor of all light; with 1, the default, materials show radiance in cd/m2
//   lights    false (default): switch off the lights of the file, because the light maps contain their light
//   fflate    URL of the fflate script, which Babylon.js needs for ZIP pages; default: Babylon.js uses a CDN
//   zstd      an initialised ZSTDDecoder of the npm package zstddec: load the KTX2 pages, which need `--encode ktx2`
//   webp      true: load the WebP pages, which need `--encode webp`
export async function loadBake(BABYLON, folder, scene, options = {}) {
  const { exposure = 1, lights = false, fflate } = options;
  const base = folder.endsWith('/') ? folder : folder + '/';
  if (fflate) BABYLON.ExrLoaderGlobalConfiguration.FFLATEUrl = fflate;
  const bake = await (await fetch(base + 'lightmap.json')).json();
  // Instances of a mesh would share its material, but each node has its own place in the pages.
  const activated = BABYLON.SceneLoader.OnPluginActivatedObservable;
  const observer = activated.add((loader) => { if (loader.name === 'gltf') loader.createInstances = false; });
  const loaded = await BABYLON.SceneLoader.ImportMeshAsync('', base, bake.scene, scene);
  activated.remove(observer);
  if (!lights) for (const light of loaded.lights) light.setEnabled(false);
  const byNode = new Map(bake.objects.map((object) => [object.node, object]));
  const meshes = loaded.meshes
    .map((mesh) => ({ mesh, object: byNode.get(nodeIndex(mesh)) }))
    .filter(({ mesh, object }) => object !== undefined && mesh.material);
  // Objects with the same page and uv transform share a texture. All pages load at the same time.
  const keyOf = ({ page, uv_scale, uv_offset }) => [page, ...uv_scale, ...uv_offset].join();
  const objects = new Map(meshes.map(({ object }) => [keyOf(object), object]));
  const load = async ([key, object]) => [key, await placedTexture(BABYLON, base, bake, object, scene, options)];
  const textures = new Map(await Promise.all([...objects].map(load)));
  const materials = new Map();
  for (const { mesh, object } of meshes) {
    const key = keyOf(object);
    mesh.material = litMaterial(mesh.material, textures.get(key), key, exposure, materials);
  }
  return { ...loaded, bake, textures };
}

// Returns the glTF node index of a mesh from the loader's JSON pointers, because names may repeat. The mesh of a single
// primitive has no pointer, so its parents are searched.
function nodeIndex(mesh) {
  for (let node = mesh; node; node = node.parent) {
    for (const pointer of (node._internalMetadata ?? node.metadata)?.gltf?.pointers ?? []) {
      const match = /^\/nodes\/(\d+)$/.exec(pointer);
      if (match) return Number(match[1]);
    }
  }
  return undefined;
}

// Loads the page of an object, with its uv transform. v = 0 is the first row of a page. Babylon.js stores the rows of an
// EXR bottom-up, so v is replaced by 1 - v there.
async function placedTexture(BABYLON, base, bake, object, scene, options) {
  const texture = await loadPage(BABYLON, base, bake.pages[object.page], scene, options);
  const topDown = Boolean(options.zstd || options.webp);
  texture.level = (options.exposure ?? 1) / Math.PI;
  texture.coordinatesIndex = 1;
  texture.wrapU = texture.wrapV = BABYLON.Texture.CLAMP_ADDRESSMODE;
  texture.uScale = object.uv_scale[0];
  texture.vScale = topDown ? object.uv_scale[1] : -object.uv_scale[1];
  texture.uOffset = object.uv_offset[0];
  texture.vOffset = topDown ? object.uv_offset[1] : 1 - object.uv_offset[1];
  return texture;
}

function loadPage(BABYLON, base, page, scene, { zstd, webp }) {
  const name = zstd ? 'ktx2' : webp ? 'webp' : undefined;
  if (name === undefined) return exrTexture(BABYLON, base + page.file, scene);
  const encoded = page.encodings[name];
  if (encoded === undefined) throw new Error(`the bake has no such pages; bake with --encode ${name}`);
  if (zstd) return ktx2Texture(BABYLON, base + encoded.file, zstd, scene);
  return rgbmTexture(BABYLON, base + encoded.file, encoded.max, scene);
}

// Loads a KTX2 page with RGB9E5 texels. Babylon.js itself reads only KTX2 files of Basis Universal.
async function ktx2Texture(BABYLON, url, zstd, scene) {
  const response = await fetch(url);
  if (!response.ok) throw new Error(`${url} cannot be loaded`);
  const file = await response.arrayBuffer();
  const view = new DataView(file);
  const uint32 = (at) => view.getUint32(at, true);
  const uint64 = (at) => Number(view.getBigUint64(at, true));
  const [format, width, height, scheme] = [uint32(12), uint32(20), uint32(24), uint32(44)];
  if (format !== 123 || scheme !== 2) throw new Error(`${url} has no RGB9E5 texels with Zstandard compression`);
  const raw = zstd.decode(new Uint8Array(file, uint64(80), uint64(88)), uint64(96));
  const texels = new Uint32Array(raw.buffer, raw.byteOffset, raw.byteLength / 4);
  const { TEXTUREFORMAT_RGB, TEXTURETYPE_UNSIGNED_INT_5_9_9_9_REV } = BABYLON.Constants;
  return rawTexture(BABYLON, texels, width, height, TEXTUREFORMAT_RGB, TEXTURETYPE_UNSIGNED_INT_5_9_9_9_REV, scene);
}

async function rgbmTexture(BABYLON, url, top, scene) {
  const { readRgbm } = await import('./rgbm.js');
  const { width, height, data } = await readRgbm(url, top, BABYLON.ToHalfFloat);
  const { TEXTUREFORMAT_RGBA, TEXTURETYPE_HALF_FLOAT } = BABYLON.Constants;
  return rawTexture(BABYLON, data, width, height, TEXTUREFORMAT_RGBA, TEXTURETYPE_HALF_FLOAT, scene);
}

function rawTexture(BABYLON, texels, width, height, format, type, scene) {
  const { TEXTURE_BILINEAR_SAMPLINGMODE } = BABYLON.Constants;
  const texture = new BABYLON.RawTexture(
    texels, width, height, format, scene, false, false, TEXTURE_BILINEAR_SAMPLINGMODE, type,
  );
  texture.gammaSpace = false;
  return texture;
}

// The EXR loader marks textures as gamma-encoded, so they are set to linear when they are loaded.
function exrTexture(BABYLON, url, scene) {
  const texture = new BABYLON.Texture(url, scene, true, false, BABYLON.Texture.BILINEAR_SAMPLINGMODE);
  return new Promise((resolve, reject) => {
    const done = () => { texture.gammaSpace = false; resolve(texture); };
    if (texture.isReady()) done();
    else texture.onLoadObservable.addOnce(done);
    BABYLON.Texture.OnTextureLoadErrorObservable.add((failed) => {
      if (failed === texture) reject(new Error(`${texture.url} cannot be loaded`));
    });
  });
}

// Babylon.js either adds a light map to a material's colour or multiplies by it. Here it multiplies: the unlit colour
// is the albedo and the light map is E / pi, so the product is albedo * E / pi.
function litMaterial(material, texture, key, exposure, materials) {
  const name = material.uniqueId + ' ' + key;
  if (!materials.has(name)) {
    const lit = material.clone(material.name);
    lit.unlit = true;
    lit.lightmapTexture = texture;
    lit.useLightmapAsShadowmap = true;
    lit.emissiveIntensity = (lit.emissiveIntensity ?? 1) * exposure;
    // The irradiance already contains occlusion.
    lit.ambientTexture = null;
    materials.set(name, lit);
  }
  return materials.get(name);
}
