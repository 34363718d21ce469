// Loads a baked scene into three.js: scene.glb with its irradiance pages as light maps.
//
//   import { loadBake } from './three/lightmap.js';
//   const { gltf } = await loadBake('./three/');
//   scene.add(gltf.scene);

import { FileLoader, LinearFilter, MeshLambertMaterial, NoColorSpace } from 'three';
import { EXRLoader } from 'three/addons/loaders/EXRLoader.js';
import { GLTFLoader } from 'three/addons/loaders/GLTFLoader.js';

// Loads the folder of this file. Options:
//   exposure  factor on all light, 1 by default: shown is radiance in cd/m2
//   matte     true (default): matte materials, which show exactly albedo * E / pi; false: keep the file's materials
//   lights    false (default): hide the lights of the file, for they are in the light maps
export async function loadBake(folder, options = {}) {
  const base = folder.endsWith('/') ? folder : folder + '/';
  const bake = JSON.parse(await new FileLoader().loadAsync(base + 'lightmap.json'));
  const exr = new EXRLoader();
  const [gltf, ...textures] = await Promise.all([
    new GLTFLoader().loadAsync(base + bake.scene),
    ...bake.pages.map((page) => exr.loadAsync(base + page.file)),
  ]);
  applyLightmaps(gltf, bake, textures, options);
  return { gltf, bake, textures };
}

// Gives every object of a loaded glTF its light map.
export function applyLightmaps(gltf, bake, textures, options = {}) {
  const { exposure = 1, matte = true, lights = false } = options;
  const byNode = new Map(bake.objects.map((object) => [object.node, object]));
  const byName = uniqueNames(bake.objects);
  const placed = new Map();
  const materials = new Map();
  const visit = (node, inherited) => {
    // GLTFLoader strips dots and blanks from names and numbers repeated ones, so the index goes first.
    const index = gltf.parser.associations.get(node)?.nodes;
    let object = index === undefined ? byName.get(node.userData.name ?? node.name) : byNode.get(index);
    // A mesh of several primitives becomes a group of meshes: they are their node's.
    if (object === undefined && index === undefined) object = inherited;
    if (node.isLight && !lights) node.visible = false;
    if (node.isMesh && object !== undefined) {
      const texture = placedTexture(textures, object, placed);
      node.material = Array.isArray(node.material)
        ? node.material.map((material) => litMaterial(material, texture, exposure, matte, materials))
        : litMaterial(node.material, texture, exposure, matte, materials);
    }
    for (const child of node.children) visit(child, object);
  };
  visit(gltf.scene, undefined);
}

// Returns the page's texture as one object reads it; objects that read it alike share it.
function placedTexture(textures, object, placed) {
  const key = [object.page, ...object.uv_scale, ...object.uv_offset].join();
  if (!placed.has(key)) {
    const texture = textures[object.page].clone();
    texture.channel = 1;
    texture.colorSpace = NoColorSpace;
    texture.minFilter = texture.magFilter = LinearFilter;
    texture.generateMipmaps = false;
    // EXRLoader hands rows out from below, and v = 0 is the first row: v becomes 1 - v.
    const [scaleU, scaleV] = object.uv_scale;
    const [offsetU, offsetV] = object.uv_offset;
    texture.repeat.set(scaleU, -scaleV);
    texture.offset.set(offsetU, 1 - offsetV);
    texture.needsUpdate = true;
    placed.set(key, texture);
  }
  return placed.get(key);
}

function litMaterial(material, texture, exposure, matte, materials) {
  // Materials that are no business of light (KHR_materials_unlit) stay as they are.
  if (material.isMeshBasicMaterial) return material;
  const key = material.uuid + texture.uuid;
  if (!materials.has(key)) {
    const lit = matte ? matteMaterial(material) : material.clone();
    lit.lightMap = texture;
    // three.js multiplies by albedo / pi itself: the map is irradiance.
    lit.lightMapIntensity = exposure;
    lit.emissiveIntensity *= exposure;
    // What is open or closed is in the irradiance already.
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
