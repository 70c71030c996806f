// What Khronos' validator has to say about a .glb. Usage: gltf_validator.mjs FILE
import fs from 'fs';
import { createRequire } from 'module';
const validator = createRequire(process.env.ELYS_NODE_MODULES + '/')('gltf-validator');
const report = await validator.validateBytes(new Uint8Array(fs.readFileSync(process.argv[2])), { maxIssues: 50 });
console.log(JSON.stringify(report));
