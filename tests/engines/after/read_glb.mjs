// Prints the nodes of a GLB as JSON: names, extras, world matrices, decompressed positions and TEXCOORD_1.
import { NodeIO } from '@gltf-transform/core';
import { ALL_EXTENSIONS } from '@gltf-transform/extensions';
import draco3d from 'draco3dgltf';
import { MeshoptDecoder } from 'meshoptimizer';

const io = new NodeIO().registerExtensions(ALL_EXTENSIONS).registerDependencies({
  'draco3d.decoder': await draco3d.createDecoderModule(),
  'meshopt.decoder': MeshoptDecoder,
});
const document = await io.read(process.argv[2]);
const elements = (accessor) => accessor && Array.from({ length: accessor.getCount() }, (_, i) => accessor.getElement(i, []));
const primitive = (found) => ({
  position: elements(found.getAttribute('POSITION')),
  uv: elements(found.getAttribute('TEXCOORD_1')),
  triangle: Array.from(found.getIndices().getArray()),
});
console.log(JSON.stringify(document.getRoot().listNodes().map((node) => ({
  name: node.getName(),
  extras: node.getExtras(),
  matrix: node.getWorldMatrix(),
  primitives: (node.getMesh()?.listPrimitives() ?? []).map(primitive),
}))));
