// node meshopt_streams.mjs NODE_MODULES COUNT SEED LONGEST: prints COUNT random streams of all modes, filters and
// versions as JSON, with the elements that the decoder of npm's meshoptimizer returns for them.
import { pathToFileURL } from 'node:url';

const [modules, count, seed, longest] = process.argv.slice(2);
const load = (file) => import(pathToFileURL(`${modules}/meshoptimizer/${file}`));
const { MeshoptEncoder: encoder } = await load('meshopt_encoder.js');
const { MeshoptDecoder: decoder } = await load('meshopt_decoder.mjs');
await encoder.ready;
await decoder.ready;

let state = Number(seed);
const random = () => {
    state = (state * 1664525 + 1013904223) >>> 0;
    return state / 4294967296;
};
const below = (n) => Math.floor(random() * n);
const choice = (items) => items[below(items.length)];

const FILTERS = ['OCTAHEDRAL', 'QUATERNION', 'EXPONENTIAL', 'COLOR'];
const ENCODE = {
    OCTAHEDRAL: encoder.encodeFilterOct, QUATERNION: encoder.encodeFilterQuat,
    EXPONENTIAL: encoder.encodeFilterExp, COLOR: encoder.encodeFilterColor,
};

// Bytes: noise, ramps, mostly constant, smooth floats, and small steps between elements.
function bytes(n, stride) {
    const data = new Uint8Array(n * stride), style = below(5);
    if (style === 0) {
        new Float32Array(data.buffer).forEach((_, i, all) => { all[i] = Math.sin(i * 0.01) * 10 + random() * 0.01; });
        return data;
    }
    for (let i = 0; i < data.length; i++) {
        const before = i >= stride ? data[i - stride] : 0;
        data[i] = [0, below(256), (i / stride) * 3, random() < 0.1 ? below(256) : 7, before + below(choice([2, 4, 16]))][style];
    }
    return data;
}

function filtered(name, n, stride) {
    const width = name === 'EXPONENTIAL' ? stride / 4 : 4;
    const value = new Float32Array(n * width);
    for (let i = 0; i < n; i++) {
        const part = value.subarray(i * width, (i + 1) * width);
        for (let c = 0; c < width; c++) {
            const size = name === 'EXPONENTIAL' ? 10 ** (below(10) - 5) : 1;
            part[c] = name === 'COLOR' ? random() : (random() * 2 - 1) * size;
        }
        const unit = { OCTAHEDRAL: part.subarray(0, 3), QUATERNION: part }[name];
        if (unit) unit.set(unit.map((v) => v / Math.hypot(...unit)));
    }
    const most = { QUATERNION: 16, EXPONENTIAL: 24 }[name] ?? 2 * stride;
    const least = { QUATERNION: 4, EXPONENTIAL: 1 }[name] ?? 2;
    return ENCODE[name](value, n, stride, least + below(most - least + 1));
}

function indices(n, stride) {
    const most = stride === 2 ? 65535 : 1e6, style = below(4);
    const index = new Uint32Array(n).map((_, i) => [
        below(most), Math.floor(i / 3) + below(8), below(20), Math.floor(i / 3) + (i % 3),
    ][style] % most);
    return stride === 2 ? new Uint8Array(new Uint16Array(index).buffer) : new Uint8Array(index.buffer);
}

function stream() {
    const kind = below(8), n = 1 + below(choice([8, 40, Number(longest)]));
    if (kind < 5) {
        const filter = kind < 3 ? 'NONE' : choice(FILTERS);
        const stride = { NONE: 4 * (1 + below(choice([2, 8, 64]))), QUATERNION: 8 }[filter] ?? 4 * (1 + below(2));
        const data = filter === 'NONE' ? bytes(n, stride) : filtered(filter, n, stride);
        const encoded = encoder.encodeVertexBufferLevel(data, n, stride, below(4), below(2));
        return ['ATTRIBUTES', filter, n, stride, encoded];
    }
    const mode = kind < 7 ? 'TRIANGLES' : 'INDICES', stride = choice([2, 4]);
    const total = mode === 'TRIANGLES' ? 3 * n : n;
    return [mode, 'NONE', total, stride, encoder.encodeGltfBuffer(indices(total, stride), total, stride, mode)];
}

const base64 = (data) => Buffer.from(data).toString('base64');
const found = [];
for (let k = 0; k < Number(count); k++) {
    const [mode, filter, n, stride, encoded] = stream();
    const decoded = new Uint8Array(n * stride);
    decoder.decodeGltfBuffer(decoded, n, stride, encoded, mode, filter);
    found.push({ mode, filter, count: n, stride, encoded: base64(encoded), decoded: base64(decoded) });
}
console.log(`[\n${found.map((item) => JSON.stringify(item)).join(',\n')}\n]`);
