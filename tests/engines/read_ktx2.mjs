// Reads a KTX2 file with ktx-parse and zstddec, and prints what it contains as JSON.
// Usage: node read_ktx2.mjs NODE_MODULES FILE

import { readFileSync } from 'node:fs';
import { pathToFileURL } from 'node:url';

const [modules, path] = process.argv.slice(2);
const load = (file) => import(pathToFileURL(`${modules}/${file}`));
const { read, write } = await load('ktx-parse/dist/index.mjs');
const { ZSTDDecoder } = await load('zstddec/dist/zstddec.mjs');

const file = readFileSync(path);
const container = read(file);
const zstd = new ZSTDDecoder();
await zstd.init();
const [level] = container.levels;
const raw = zstd.decode(level.levelData, level.uncompressedByteLength);
const { levels, globalData, ...rest } = container;
const rewritten = write(container, { keepWriter: true });
console.log(JSON.stringify({
  ...rest,
  levels: levels.length,
  globalData,
  words: Array.from(new Uint32Array(raw.buffer, raw.byteOffset, raw.byteLength / 4)),
  sameBytes: Buffer.compare(Buffer.from(rewritten), file) === 0,
}));
