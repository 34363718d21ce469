// Loads a baked scene into PlayCanvas: scene.glb, with the irradiance pages as light maps.
//
//   import * as pc from 'playcanvas';
//   import { loadBake } from './playcanvas/lightmap.js';
//   const { entity } = await loadBake(pc, app, './playcanvas/');
//   app.root.addChild(entity);

// Largest half float. PlayCanvas writes infinity for larger numbers.
const HALF_MAX = 65504;

// Loads the bake in `folder`. Options:
//   exposure  factor of all light; with 1, the default, materials show radiance in cd/m2
//   lights    false (default): switch off the lights of the file, because the light maps contain their light
export async function loadBake(pc, app, folder, options = {}) {
  const { exposure = 1, lights = false } = options;
  const base = folder.endsWith('/') ? folder : folder + '/';
  const bake = await (await fetch(base + 'lightmap.json')).json();
  const [container, ...pages] = await Promise.all([
    loadAsset(pc, app, 'container', base + bake.scene),
    ...bake.pages.map((page) => loadAsset(pc, app, 'texture', base + page.file)),
  ]);
  // PlayCanvas multiplies a light map by the albedo, without 1 / pi.
  const textures = pages.map((page) => filterable(pc, app, page, exposure / Math.PI));
  for (const page of pages) unloadAsset(app, page);
  const entity = container.resource.instantiateRenderEntity();
  if (!lights) for (const light of entity.findComponents('light')) light.enabled = false;
  // Each baked node has a mesh of its own. PlayCanvas changes repeated names, so identify nodes by mesh.
  const objects = new Map(bake.objects.map((object) => [container.resource.renders[object.mesh].id, object]));
  const materials = new Map();
  for (const render of entity.findComponents('render')) {
    const object = objects.get(render.asset);
    if (object === undefined) continue;
    for (const part of render.meshInstances) {
      part.material = litMaterial(pc, part.material, textures[object.page], object, exposure, materials);
    }
  }
  return { entity, bake, textures, container };
}

function loadAsset(pc, app, type, url) {
  return new Promise((resolve, reject) => {
    const asset = new pc.Asset(url, type, { url });
    asset.once('load', resolve);
    asset.once('error', (error) => reject(new Error(`${url} cannot be loaded: ${error}`)));
    app.assets.add(asset);
    app.assets.load(asset);
  });
}

function unloadAsset(app, asset) {
  app.assets.remove(asset);
  asset.unload();
}

// Returns a half float copy of a page, multiplied by `factor`. PlayCanvas loads an .hdr file as mantissas and exponents,
// which cannot be filtered.
function filterable(pc, app, page, factor) {
  const { width, height } = page.resource;
  const rgbe = page.resource.lock({ mode: pc.TEXTURELOCK_READ });
  const half = new Uint16Array(rgbe.length);
  for (let texel = 0; texel < rgbe.length; texel += 4) {
    const step = factor * 2 ** (rgbe[texel + 3] - 136);
    for (let k = texel; k < texel + 3; k += 1) half[k] = pc.FloatPacking.float2Half(Math.min(rgbe[k] * step, HALF_MAX));
  }
  page.resource.unlock();
  return new pc.Texture(app.graphicsDevice, {
    name: page.name, width, height, format: pc.PIXELFORMAT_RGBA16F, mipmaps: false,
    minFilter: pc.FILTER_LINEAR, magFilter: pc.FILTER_LINEAR,
    addressU: pc.ADDRESS_CLAMP_TO_EDGE, addressV: pc.ADDRESS_CLAMP_TO_EDGE, levels: [half],
  });
}

function litMaterial(pc, material, texture, object, exposure, materials) {
  // Unlit materials (KHR_materials_unlit) are not changed.
  if (!material.useLighting) return material;
  const key = [material.id, object.page, ...object.uv_scale, ...object.uv_offset].join();
  if (!materials.has(key)) {
    const lit = material.clone();
    const [scaleU, scaleV] = object.uv_scale;
    const [offsetU, offsetV] = object.uv_offset;
    lit.lightMap = texture;
    lit.lightMapUv = 1;
    lit.lightMapChannel = 'rgb';
    lit.lightMapTiling = new pc.Vec2(scaleU, scaleV);
    // PlayCanvas counts offsets from the last row.
    lit.lightMapOffset = new pc.Vec2(offsetU, 1 - scaleV - offsetV);
    lit.emissiveIntensity *= exposure;
    // Show only diffuse light, as the bake does. PlayCanvas adds neither ambient light nor occlusion to a light map.
    lit.useSkybox = false;
    lit.metalness = 0;
    lit.metalnessMap = null;
    lit.update();
    materials.set(key, lit);
  }
  return materials.get(key);
}
