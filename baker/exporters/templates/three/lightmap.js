// Loads a baked scene into three.js: scene.glb, with the irradiance pages as light maps.
//
//   import { loadBake } from './three/lightmap.js';
//   const { gltf } = await loadBake('./three/');
//   scene.add(gltf.scene);

import {
  DataTexture, DataUtils, FileLoader, HalfFloatType, LinearFilter, MeshLambertMaterial, NoColorSpace, RGBAFormat,
} from 'three';
import { EXRLoader } from 'three/addons/loaders/EXRLoader.js';
import { GLTFLoader } from 'three/addons/loaders/GLTFLoader.js';

// Loads the bake in `folder`. Options:
//   exposure  factor of all light; with 1, the default, materials show radiance in cd/m2
//   matte     true (default): use MeshLambertMaterial, which shows albedo * E / pi; false: keep the materials
//   lights    false (default): hide the lights of the file, because the light maps contain their light
//   ktx2      a KTX2Loader after detectSupport(renderer): load the KTX2 pages, which need `--encode ktx2`
//   webp      true: load the WebP pages, which need `--encode webp`
export async function loadBake(folder, options = {}) {
  const base = folder.endsWith('/') ? folder : folder + '/';
  const bake = JSON.parse(await new FileLoader().loadAsync(base + 'lightmap.json'));
  const [gltf, ...textures] = await Promise.all([
    new GLTFLoader().loadAsync(base + bake.scene),
    ...bake.pages.map((page) => loadPage(base, page, options)),
  ]);
  // Several nodes may have the same mesh and the same name. The parser returns the object of each node.
  const parts = bake.objects.map(async (object) => [await gltf.parser.getDependency('node', object.node), object]);
  const objects = new Map(await Promise.all(parts));
  applyLightmaps(gltf, bake, textures, { ...options, objects, topDown: Boolean(options.ktx2 || options.webp) });
  return { gltf, bake, textures };
}

function loadPage(base, page, { ktx2, webp }) {
  const name = ktx2 ? 'ktx2' : webp ? 'webp' : undefined;
  if (name === undefined) return new EXRLoader().loadAsync(base + page.file);
  const encoded = page.encodings[name];
  if (encoded === undefined) throw new Error(`the bake has no such pages; bake with --encode ${name}`);
  return ktx2 ? ktx2.loadAsync(base + encoded.file) : loadRgbm(base + encoded.file, encoded.max);
}

async function loadRgbm(url, top) {
  const { readRgbm } = await import('./rgbm.js');
  const { width, height, data } = await readRgbm(url, top, DataUtils.toHalfFloat);
  return new DataTexture(data, width, height, RGBAFormat, HalfFloatType);
}

// Assigns light maps to the objects of a loaded glTF. Set the option `topDown` if the textures have the first row of
// the files at v = 0, as those of KTX2Loader have. Textures of EXRLoader have the last row there. The option `objects`
// is a Map from nodes to entries of `bake.objects`.
export function applyLightmaps(gltf, bake, textures, options = {}) {
  const { exposure = 1, matte = true, lights = false, topDown = false, objects } = options;
  const byNode = new Map(bake.objects.map((object) => [object.node, object]));
  const byName = uniqueNames(bake.objects);
  const placed = new Map();
  const materials = new Map();
  const visit = (node, inherited) => {
    // GLTFLoader changes names (dots, blanks, repeated names), so identify nodes by index if possible.
    const index = gltf.parser.associations.get(node)?.nodes;
    let object = objects?.get(node);
    if (object === undefined && objects === undefined) {
      object = index === undefined ? byName.get(node.userData.name ?? node.name) : byNode.get(index);
    }
    // A mesh with several primitives becomes a group of meshes, which get the object of their node.
    if (object === undefined && index === undefined) object = inherited;
    if (node.isLight && !lights) node.visible = false;
    if (node.isMesh && object !== undefined) {
      const texture = placedTexture(textures, object, topDown, placed);
      node.material = Array.isArray(node.material)
        ? node.material.map((material) => litMaterial(material, texture, exposure, matte, materials))
        : litMaterial(node.material, texture, exposure, matte, materials);
    }
    for (const child of node.children) visit(child, object);
  };
  visit(gltf.scene, undefined);
}

// Returns a page's texture with the uv transform of an object; objects with equal transforms share it.
function placedTexture(textures, object, topDown, placed) {
  const key = [object.page, ...object.uv_scale, ...object.uv_offset].join();
  if (!placed.has(key)) {
    const texture = textures[object.page].clone();
    texture.channel = 1;
    texture.colorSpace = NoColorSpace;
    texture.minFilter = texture.magFilter = LinearFilter;
    texture.generateMipmaps = false;
    const [scaleU, scaleV] = object.uv_scale;
    const [offsetU, offsetV] = object.uv_offset;
    // v = 0 is the first row of a page. If the texture has the last row there, replace v by 1 - v.
    texture.repeat.set(scaleU, topDown ? scaleV : -scaleV);
    texture.offset.set(offsetU, topDown ? offsetV : 1 - offsetV);
    texture.needsUpdate = true;
    placed.set(key, texture);
  }
  return placed.get(key);
}

function litMaterial(material, texture, exposure, matte, materials) {
  // Unlit materials (KHR_materials_unlit) are not changed.
  if (material.isMeshBasicMaterial) return material;
  const key = material.uuid + texture.uuid;
  if (!materials.has(key)) {
    const lit = matte ? matteMaterial(material) : material.clone();
    lit.lightMap = texture;
    // The map contains irradiance, which three.js multiplies by albedo / pi.
    lit.lightMapIntensity = exposure;
    lit.emissiveIntensity *= exposure;
    // The irradiance already contains occlusion.
    lit.aoMap = null;
    materials.set(key, lit);
  }
  return materials.get(key);
}

function matteMaterial(material) {
  const { name, color, map, alphaMap, alphaTest, transparent, opacity, side, vertexColors, depthWrite } = material;
  const { emissive, emissiveMap, emissiveIntensity, userData } = material;
  const matte = new MeshLambertMaterial({
    name, map, alphaMap, alphaTest, transparent, opacity, side, vertexColors, depthWrite, emissiveMap, emissiveIntensity,
  });
  matte.color.copy(color);
  if (emissive) matte.emissive.copy(emissive);
  matte.userData = { ...userData };
  return matte;
}

function uniqueNames(objects) {
  const byName = new Map();
  for (const object of objects) byName.set(object.name, byName.has(object.name) ? undefined : object);
  return byName;
}
