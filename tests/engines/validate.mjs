// node validate.mjs NODE_MODULES FILE.glb: prints what Khronos' glTF validator finds, as JSON.
import { readFile } from 'node:fs/promises';
import { createRequire } from 'node:module';

const [modules, path] = process.argv.slice(2);
const validator = createRequire(modules + '/')('gltf-validator');
const report = await validator.validateBytes(new Uint8Array(await readFile(path)), { maxIssues: 10000 });
console.log(JSON.stringify(report.issues));
