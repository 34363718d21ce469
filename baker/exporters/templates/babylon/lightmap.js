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
export async function loadBake(BABYLON, folder, scene, options = {}) {
  const { exposure = 1, lights = false, fflate } = options;
  const base = folder.endsWith('/') ? folder : folder + '/';
  if (fflate) BABYLON.ExrLoaderGlobalConfiguration.FFLATEUrl = fflate;
  const bake = await (await fetch(base + 'lightmap.json')).json();
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
      const texture = pageTexture(BABYLON, base + bake.pages[object.page].file, object, scene);
      texture.level = exposure / Math.PI;
      waiting.push(loadedLinear(BABYLON, texture));
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

function pageTexture(BABYLON, url, object, scene) {
  const texture = new BABYLON.Texture(url, scene, true, false, BABYLON.Texture.BILINEAR_SAMPLINGMODE);
  texture.coordinatesIndex = 1;
  texture.wrapU = texture.wrapV = BABYLON.Texture.CLAMP_ADDRESSMODE;
  // Babylon.js stores EXR rows bottom-up, but v = 0 is the first row of the EXR: replace v by 1 - v.
  texture.uScale = object.uv_scale[0];
  texture.vScale = -object.uv_scale[1];
  texture.uOffset = object.uv_offset[0];
  texture.vOffset = 1 - object.uv_offset[1];
  return texture;
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
