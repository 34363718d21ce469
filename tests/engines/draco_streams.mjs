// node draco_streams.mjs NODE_MODULES COUNT SEED LONGEST: prints COUNT random Draco meshes as JSON, with the
// attributes and faces that the decoder of npm's draco3dgltf returns for them.
import { createRequire } from 'node:module';

const [modules, count, seed, longest] = process.argv.slice(2);
const draco = createRequire(`${modules}/`)('draco3dgltf');
const encoders = await draco.createEncoderModule();
const decoders = await draco.createDecoderModule();

let state = Number(seed);
const random = () => {
    state = (state * 1664525 + 1013904223) >>> 0;
    return state / 4294967296;
};
const below = (n) => Math.floor(random() * n);
const base64 = (array) => Buffer.from(array.buffer, array.byteOffset, array.byteLength).toString('base64');

const TYPES = {
    int8: [Int8Array, 'Int8', 'DT_INT8', 127], uint8: [Uint8Array, 'UInt8', 'DT_UINT8', 255],
    int16: [Int16Array, 'Int16', 'DT_INT16', 32767], uint16: [Uint16Array, 'UInt16', 'DT_UINT16', 65535],
    uint32: [Uint32Array, 'UInt32', 'DT_UINT32', 1e6], float32: [Float32Array, 'Float', 'DT_FLOAT32', 1],
};
// Kinds of attributes, with a type and a number of components for each mesh.
const KINDS = [
    ['POSITION', ['float32', 'int16', 'uint16'], 3], ['NORMAL', ['float32', 'int8', 'int16'], 3],
    ['TEX_COORD', ['float32', 'uint8', 'uint16'], 2], ['COLOR', ['uint8', 'uint16', 'float32'], 4],
    ['GENERIC', ['uint8', 'uint16', 'uint32', 'float32'], 4],
];

// A grid of n x n vertices, or separate triangles.
function indices(n) {
    const found = [];
    for (let i = 0; i + 1 < n; i++) {
        for (let j = 0; j + 1 < n; j++) {
            const k = i * n + j;
            found.push(k, k + 1, k + n, k + 1, k + n + 1, k + n);
        }
    }
    return new Uint32Array(random() < 0.7 ? found : found.map((_, k) => k % (n * n)));
}

function stream() {
    const n = 2 + below(Number(longest)), index = indices(n);
    const encoder = new encoders.Encoder(), builder = new encoders.MeshBuilder(), mesh = new encoders.Mesh();
    for (const [kind, types, width] of KINDS.filter((_, k) => k === 0 || random() < 0.6)) {
        const [array, name, , most] = TYPES[types[below(types.length)]];
        const value = new array(n * n * width).map((_, i) => most * (0.5 + 0.4 * Math.sin(i * 0.3) + 0.1 * random()));
        builder[`Add${name}Attribute`](mesh, encoders[kind], n * n, width, value);
        if (name === 'Float') encoder.SetAttributeQuantization(encoders[kind], 6 + below(10));
    }
    builder.AddFacesToMesh(mesh, index.length / 3, index);
    encoder.SetEncodingMethod(random() < 0.5 ? encoders.MESH_EDGEBREAKER_ENCODING : encoders.MESH_SEQUENTIAL_ENCODING);
    encoder.SetSpeedOptions(below(11), below(11));
    const packed = new encoders.DracoInt8Array();
    const size = encoder.EncodeMeshToDracoBuffer(mesh, packed);
    const data = new Int8Array(size).map((_, k) => packed.GetValue(k));
    for (const made of [packed, mesh, builder, encoder]) encoders.destroy(made);
    return data;
}

function decode(data) {
    const buffer = new decoders.DecoderBuffer(), decoder = new decoders.Decoder(), mesh = new decoders.Mesh();
    buffer.Init(data, data.length);
    decoder.DecodeBufferToMesh(buffer, mesh);
    const attributes = [];
    for (let k = 0; k < mesh.num_attributes(); k++) {
        const attribute = decoder.GetAttribute(mesh, k), width = attribute.num_components();
        const [dtype, [array, , name]] = Object.entries(TYPES).find(([, t]) => decoders[t[2]] === attribute.data_type());
        const size = mesh.num_points() * width * array.BYTES_PER_ELEMENT, at = decoders._malloc(size);
        decoder.GetAttributeDataArrayForAllPoints(mesh, attribute, decoders[name], size, at);
        attributes.push({ id: attribute.unique_id(), dtype, width, data: base64(decoders.HEAPU8.slice(at, at + size)) });
        decoders._free(at);
    }
    const size = 12 * mesh.num_faces(), at = decoders._malloc(size);
    decoder.GetTrianglesUInt32Array(mesh, size, at);
    const faces = base64(decoders.HEAPU8.slice(at, at + size));
    decoders._free(at);
    for (const made of [mesh, decoder, buffer]) decoders.destroy(made);
    return { faces, attributes };
}

const found = [];
while (found.length < Number(count)) {
    const data = stream();
    if (data.length) found.push({ stream: base64(data), ...decode(data) });
}
console.log(`[\n${found.map((item) => JSON.stringify(item)).join(',\n')}\n]`);
