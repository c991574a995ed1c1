// The profiles of the assets that the fixture writes: the Khronos validator accepts them, and the data that three.js
// decodes are within the stated bounds of the float asset.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import fs from 'node:fs';
import os from 'node:os';
import path from 'node:path';
import { after, before, test } from 'node:test';

let validator;
let three;
let GLTFLoader;
let MeshoptDecoder;
try {
  validator = (await import('gltf-validator')).default;
  three = await import('three');
  globalThis.self ??= globalThis;
  globalThis.createImageBitmap ??= async () => ({ width: 1, height: 1, close() {} });
  ({ GLTFLoader } = await import('three/addons/loaders/GLTFLoader.js'));
  ({ MeshoptDecoder } = await import('three/addons/libs/meshopt_decoder.module.js'));
} catch {
  console.log('the npm packages are missing: npm ci in tests/');
  process.exit(0);
}

const names = ['two', 'six', 'dressed', 'colours', 'rigid', 'bare', 'painted', 'painted-adaptive'];
const profiles = ['quantized', 'meshopt'];

let folder;
before(() => {
  folder = fs.mkdtempSync(path.join(os.tmpdir(), 'orbmorph-profile-'));
  execFileSync(process.env.ORB_ASSET_FIXTURE, [folder], { stdio: 'inherit' });
});
after(() => fs.rmSync(folder, { recursive: true, force: true }));

const bytesOf = (name) => fs.readFileSync(path.join(folder, `${name}.glb`));
const boundsOf = (name) => JSON.parse(fs.readFileSync(path.join(folder, `${name}.json`), 'utf8'));
const jsonOf = (bytes) => JSON.parse(bytes.subarray(20, 20 + bytes.readUInt32LE(12)).toString('utf8'));

async function load(name) {
  const bytes = bytesOf(name);
  const loader = new GLTFLoader().setMeshoptDecoder(MeshoptDecoder);
  const gltf = await loader.parseAsync(bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.length), '');
  gltf.scene.updateMatrixWorld(true);
  const meshes = [];
  gltf.scene.traverse((object) => object.isMesh && meshes.push(object));
  return meshes;
}

const vector = (attribute, i) => Array.from({ length: attribute.itemSize }, (_, c) => attribute.getComponent(i, c));
const distance = (a, b) => Math.hypot(...a.map((x, c) => x - b[c]));
const add = (a, b, w) => a.map((x, c) => x + w * b[c]);
function degrees(a, b) {
  const cross = [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  return (Math.atan2(Math.hypot(...cross), a[0] * b[0] + a[1] * b[1] + a[2] * b[2]) * 180) / Math.PI;
}

// Every vertex: its place on the base and each target, its normals, and the attributes that do not morph.
function vertices(mesh) {
  const { attributes, morphAttributes } = mesh.geometry;
  const place = (p) => new three.Vector3(...p).applyMatrix4(mesh.matrixWorld).toArray();
  const step = mesh.matrixWorld.elements[0];
  return Array.from({ length: attributes.position.count }, (_, i) => ({
    at: place(vector(attributes.position, i)),
    moves: morphAttributes.position.map((delta) => vector(delta, i).map((x) => x * step)),
    normal: attributes.normal && vector(attributes.normal, i),
    turns: (morphAttributes.normal ?? []).map((delta) => vector(delta, i)),
    fixed: ['uv', 'color'].flatMap((name) => (attributes[name] ? vector(attributes[name], i) : [])),
  }));
}

// Whether two vertices are the same within the bounds, at weights 0, 1/2 and 1 of each target.
function same(a, b, { position_error: far, normal_degrees: turned }) {
  if (distance(a.at, b.at) > far || distance(a.fixed, b.fixed) > 2 ** -13) return false;
  return a.moves.every((_, k) =>
    [0, 0.5, 1].every(
      (w) =>
        distance(add(a.at, a.moves[k], w), add(b.at, b.moves[k], w)) <= far &&
        (!a.normal || degrees(add(a.normal, a.turns[k], w), add(b.normal, b.turns[k], w)) <= turned + 1e-5),
    ),
  );
}

const triangles = (mesh, name) => {
  const index = mesh.geometry.index.array;
  return Array.from({ length: index.length / 3 }, (_, t) => {
    const [a, b, c] = [0, 1, 2].map((k) => name(index[3 * t + k]));
    return a < b && a < c ? [a, b, c].join() : b < c ? [b, c, a].join() : [c, a, b].join();
  }).sort();
};

for (const name of names) {
  for (const profile of profiles) {
    test(`${name}, ${profile}: the Khronos validator reports nothing`, async () => {
      const bytes = bytesOf(`${name}.${profile}`);
      const report = await validator.validateBytes(new Uint8Array(bytes), { maxIssues: 100 });
      assert.deepEqual(
        report.issues.messages.filter((m) => m.severity < 2),
        [],
      );
      const { extensionsUsed, extensionsRequired } = jsonOf(bytes);
      const expected = ['KHR_mesh_quantization', ...(profile === 'meshopt' ? ['EXT_meshopt_compression'] : [])];
      assert.deepEqual([extensionsUsed, extensionsRequired], [expected, expected]);
    });

    // In the overlay, some vertices are closer together than the bounds.
    if (name === 'painted') continue;
    test(`${name}, ${profile}: three.js decodes it within the bounds`, async () => {
      const bounds = boundsOf(`${name}.${profile}`);
      assert.ok(bounds.normal_degrees < 1);
      const [floats, decoded] = [await load(name), await load(`${name}.${profile}`)];
      assert.equal(decoded.length, floats.length);
      for (const [m, mesh] of decoded.entries()) {
        const [wanted, got] = [vertices(floats[m]), vertices(mesh)];
        // Half the diagonal of a cell of the grid, and what float32 arithmetic adds.
        assert.ok(bounds.position_error < mesh.matrixWorld.elements[0], 'the bound is half a step');
        assert.equal(got.length, wanted.length);
        const free = new Set(wanted.keys());
        const names = got.map((vertex) => {
          const found = [...free].find((i) => same(wanted[i], vertex, bounds));
          assert.notEqual(found, undefined, 'a vertex is beyond the bounds');
          free.delete(found);
          return [wanted[found].at, ...wanted[found].moves].flat().join(' ');
        });
        assert.deepEqual(
          triangles(mesh, (i) => names[i]),
          triangles(floats[m], (i) => [wanted[i].at, ...wanted[i].moves].flat().join(' ')),
        );
      }
    });
  }
}
