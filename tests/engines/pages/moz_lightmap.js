// Plug-ins for GLTFLoader that load MOZ_lightmap as two known loaders do.
import { HalfFloatType, LinearSRGBColorSpace } from 'three';
import { HDRLoader } from 'three/addons/loaders/HDRLoader.js';

// As Mozilla Hubs: the texture is used as it is, always on the second uv set, and its picture is the Radiance HDR.
class HubsLightmap {
  constructor(parser) { Object.assign(this, { parser, name: 'MOZ_lightmap' }); }
  async loadMaterial(index) {
    const found = this.parser.json.materials[index].extensions?.MOZ_lightmap;
    if (!found) return null;
    const [material, texture] = await Promise.all([
      this.parser.loadMaterial(index), this.parser.getDependency('texture', found.index),
    ]);
    material.lightMap = texture;
    material.lightMap.channel = 1;
    material.lightMapIntensity = found.intensity ?? 1;
    return material;
  }
}

class HubsRadiance {
  constructor(parser) { Object.assign(this, { parser, name: 'MOZ_texture_rgbe' }); }
  loadTexture(index) {
    const found = this.parser.json.textures[index].extensions?.MOZ_texture_rgbe;
    return found ? this.parser.loadTextureImage(index, found.source, new HDRLoader().setDataType(HalfFloatType)) : null;
  }
}

// As the add-on in the development version of three.js: `texCoord` is read, and the picture is the PNG.
class AddonLightmap {
  constructor(parser) { Object.assign(this, { parser, name: 'MOZ_lightmap' }); }
  async loadMaterial(index) {
    const found = this.parser.json.materials[index].extensions?.MOZ_lightmap;
    if (!found) return null;
    const material = await this.parser.loadMaterial(index);
    await this.parser.assignTexture(material, 'lightMap', { texCoord: 1, ...found }, LinearSRGBColorSpace);
    material.lightMapIntensity = found.intensity ?? 1;
    return material;
  }
}

const PLUGINS = { hubs: [HubsLightmap, HubsRadiance], addon: [AddonLightmap] };

export function register(loader, name) {
  for (const Plugin of PLUGINS[name]) loader.register((parser) => new Plugin(parser));
  return loader;
}
