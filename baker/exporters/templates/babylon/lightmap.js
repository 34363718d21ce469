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
export async function loadBake(BABYLON, folder, scene, options = {}) {
  const { exposure = 1, lights = false, fflate, zstd } = options;
  const base = folder.endsWith('/') ? folder : folder + '/';
  if (fflate) BABYLON.ExrLoaderGlobalConfiguration.FFLATEUrl = fflate;
  const bake = await (await fetch(base + 'lightmap.json')).json();
  if (zstd && bake.pages.some((page) => !page.ktx2)) throw new Error('no KTX2 pages; bake with --encode ktx2');
  const loaded = await BABYLON.SceneLoader.ImportMeshAsync('', base, bake.scene, scene);
  if (!lights) for (const light of loaded.lights) light.setEnabled(false);
  const byNode = new Map(bake.objects.map((object) => [object.node, object]));
  const textures = new Map();
  const materials = new Map();
  const waiting = [];
  for (const mesh of loaded.meshes) {
    const object = byNode.get(nodeIndex(mesh));
    if (object === undefined || !mesh.material) continue;
    const key = [object.page, ...object.uv_scale, ...object.uv_offset].join();
    if (!textures.has(key)) {
      const page = bake.pages[object.page];
      const texture = zstd
        ? await ktx2Texture(BABYLON, base + page.ktx2, zstd, scene)
        : exrTexture(BABYLON, base + page.file, scene);
      placeTexture(BABYLON, texture, object, zstd !== undefined);
      texture.level = exposure / Math.PI;
      if (!zstd) waiting.push(loadedLinear(BABYLON, texture));
      textures.set(key, texture);
    }
    mesh.material = litMaterial(mesh.material, textures.get(key), key, exposure, materials);
  }
  await Promise.all(waiting);
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

function exrTexture(BABYLON, url, scene) {
  return new BABYLON.Texture(url, scene, true, false, BABYLON.Texture.BILINEAR_SAMPLINGMODE);
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
  const { TEXTUREFORMAT_RGB, TEXTURETYPE_UNSIGNED_INT_5_9_9_9_REV, TEXTURE_BILINEAR_SAMPLINGMODE } = BABYLON.Constants;
  const texture = new BABYLON.RawTexture(
    texels, width, height, TEXTUREFORMAT_RGB, scene, false, false, TEXTURE_BILINEAR_SAMPLINGMODE,
    TEXTURETYPE_UNSIGNED_INT_5_9_9_9_REV,
  );
  texture.gammaSpace = false;
  return texture;
}

// v = 0 is the first row of a page. Babylon.js stores the rows of an EXR bottom-up, so v is replaced by 1 - v there.
function placeTexture(BABYLON, texture, object, topDown) {
  texture.coordinatesIndex = 1;
  texture.wrapU = texture.wrapV = BABYLON.Texture.CLAMP_ADDRESSMODE;
  texture.uScale = object.uv_scale[0];
  texture.vScale = topDown ? object.uv_scale[1] : -object.uv_scale[1];
  texture.uOffset = object.uv_offset[0];
  texture.vOffset = topDown ? object.uv_offset[1] : 1 - object.uv_offset[1];
}

// Resolves when the page is loaded. The EXR loader marks textures as gamma-encoded, so set them to linear then.
function loadedLinear(BABYLON, texture) {
  return new Promise((resolve, reject) => {
    const done = () => { texture.gammaSpace = false; resolve(); };
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
