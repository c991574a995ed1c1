// Checks the assets that the fixture writes with the Khronos validator and with three.js.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import fs from 'node:fs';
import os from 'node:os';
import path from 'node:path';
import { after, before, test } from 'node:test';

let validator;
let three;
let GLTFLoader;
try {
  validator = (await import('gltf-validator')).default;
  three = await import('three');
  globalThis.self ??= globalThis;
  // The tests ignore pictures; the loader only needs decoding to succeed.
  globalThis.createImageBitmap ??= async () => ({ width: 1, height: 1, close() {} });
  ({ GLTFLoader } = await import('three/addons/loaders/GLTFLoader.js'));
} catch {
  console.log('the npm packages are missing: npm ci in tests/');
  process.exit(0);
}

// The version of the algorithms, as the public header states it.
const [, engine] = fs
  .readFileSync(new URL('../../core/include/orbmorph/status.h', import.meta.url), 'utf8')
  .match(/#define ORB_ENGINE "(.*)"/);

let folder;
before(() => {
  folder = fs.mkdtempSync(path.join(os.tmpdir(), 'orbmorph-asset-'));
  execFileSync(process.env.ORB_ASSET_FIXTURE, [folder], { stdio: 'inherit' });
});
after(() => fs.rmSync(folder, { recursive: true, force: true }));

const bytesOf = (name) => fs.readFileSync(path.join(folder, `${name}.glb`));
const factsOf = (name) => JSON.parse(fs.readFileSync(path.join(folder, `${name}.json`), 'utf8'));
function jsonOf(bytes) {
  return JSON.parse(bytes.subarray(20, 20 + bytes.readUInt32LE(12)).toString('utf8'));
}

async function load(name) {
  const bytes = bytesOf(name);
  const buffer = bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.length);
  const gltf = await new GLTFLoader().parseAsync(buffer, '');
  const meshes = [];
  gltf.scene.traverse((object) => object.isMesh && meshes.push(object));
  return { gltf, meshes };
}

// Positions of all vertices as three.js morphs them, with one target at full weight (−1: only the base).
function shown(mesh, target) {
  mesh.morphTargetInfluences.fill(0);
  if (target >= 0) mesh.morphTargetInfluences[target] = 1;
  const point = new three.Vector3();
  const out = [];
  for (let i = 0; i < mesh.geometry.attributes.position.count; i++) {
    mesh.getVertexPosition(i, point);
    out.push(point.toArray());
  }
  return out;
}

// Finds the supermesh vertex of each file vertex by its position on the first shape; every other shape must agree.
function match(mesh, facts) {
  const numberOf = new Map();
  const count = facts.shapes[0].length / 3;
  for (let v = 0; v < count; v++) {
    numberOf.set(
      facts.shapes[0]
        .slice(3 * v, 3 * v + 3)
        .map((x) => Math.fround(x) + 0)
        .join(),
      v,
    );
  }
  const numbers = shown(mesh, -1).map((p) => numberOf.get(p.map((x) => x + 0).join()));
  assert.ok(
    numbers.every((v) => v !== undefined),
    'a base position is not a vertex of the first shape',
  );
  for (let s = 1; s < facts.shapes.length; s++) {
    shown(mesh, s - 1).forEach((p, i) => {
      for (let c = 0; c < 3; c++) {
        const wanted = facts.shapes[s][3 * numbers[i] + c];
        assert.ok(Math.abs(p[c] - wanted) <= 2 ** -22 * Math.max(1, Math.abs(wanted)), `shape ${s}: ${p[c]} ${wanted}`);
      }
    });
  }
  return numbers;
}

// The corners of a triangle, starting with the lowest number.
function canonical([a, b, c]) {
  return a < b && a < c ? [a, b, c].join() : b < c ? [b, c, a].join() : [c, a, b].join();
}

for (const name of ['two', 'six', 'dressed', 'colours', 'rigid', 'bare', 'painted', 'painted-adaptive']) {
  test(`${name}: the Khronos validator reports nothing`, async () => {
    const report = await validator.validateBytes(new Uint8Array(bytesOf(name)), { maxIssues: 100 });
    const serious = report.issues.messages.filter((m) => m.severity < 2);
    assert.deepEqual(serious, []);
    assert.equal(report.issues.numErrors, 0);
    assert.equal(report.issues.numWarnings, 0);
  });
}

for (const name of ['two', 'six', 'dressed', 'colours', 'rigid', 'bare']) {
  test(`${name}: three.js shows each shape at its weight`, async () => {
    const { meshes } = await load(name);
    const facts = factsOf(name);
    const triangles = [];
    for (const mesh of meshes) {
      const numbers = match(mesh, facts);
      const index = mesh.geometry.index.array;
      for (let i = 0; i < index.length; i += 3) {
        triangles.push(canonical([numbers[index[i]], numbers[index[i + 1]], numbers[index[i + 2]]]));
      }
    }
    assert.deepEqual(triangles.sort(), facts.triangles.map(canonical).sort());
  });

  test(`${name}: every target has the same attributes, and bounds are correct`, () => {
    const json = jsonOf(bytesOf(name));
    assert.equal(json.meshes.length, 1);
    assert.equal(json.nodes.length, 1);
    assert.equal(json.asset.generator, engine);
    for (const primitive of json.meshes[0].primitives) {
      assert.equal(primitive.mode, 4);
      const kinds = primitive.targets.map((t) => Object.keys(t).sort().join());
      assert.equal(new Set(kinds).size, 1);
      for (const target of primitive.targets) {
        assert.ok(json.accessors[target.POSITION].min && json.accessors[target.POSITION].max);
      }
    }
    for (const accessor of json.accessors) assert.ok(accessor.count > 0);
    assert.equal(json.meshes[0].extras.targetNames.length, json.meshes[0].primitives[0].targets.length);
  });
}

test('the animation shows every shape alone, as three.js plays it', async () => {
  const { gltf, meshes } = await load('six');
  const [clip] = gltf.animations;
  const mixer = new three.AnimationMixer(gltf.scene);
  mixer.clipAction(clip).play();
  const alone = new Set();
  for (const time of clip.tracks[0].times) {
    mixer.setTime(Math.min(time, clip.duration - 1e-6));
    const weights = [...meshes[0].morphTargetInfluences];
    const total = weights.reduce((a, b) => a + b, 0);
    assert.ok(total < 1 + 1e-3 && weights.every((w) => w >= 0));
    const at = weights.findIndex((w) => Math.abs(w - 1) < 1e-3);
    if (at >= 0 || total < 1e-3) alone.add(at);
  }
  assert.deepEqual([...alone].sort(), [-1, 0, 1, 2, 3, 4]);
});

test('names are preserved, whatever characters they contain', async () => {
  const { meshes } = await load('six');
  assert.deepEqual(Object.keys(meshes[0].morphTargetDictionary), ['zwei', 'trois', 'four "quoted"', 'five\\', 'six']);
});

test('a note in the asset reports more targets than a client must support', () => {
  assert.match(jsonOf(bytesOf('six')).meshes[0].extras.note ?? '', /8 morphed attributes/);
  assert.equal(jsonOf(bytesOf('two')).meshes[0].extras.note, undefined);
});

test('split vertices have the same bits on every shape and weld back to the supermesh', () => {
  const bytes = bytesOf('dressed');
  const json = jsonOf(bytes);
  const binary = bytes.subarray(28 + bytes.readUInt32LE(12));
  const raw = (accessor, i) => {
    const view = json.bufferViews[json.accessors[accessor].bufferView];
    return binary.subarray((view.byteOffset ?? 0) + 12 * i, (view.byteOffset ?? 0) + 12 * i + 12).toString('hex');
  };
  const distinct = new Set();
  let vertices = 0;
  for (const primitive of json.meshes[0].primitives) {
    for (let i = 0; i < json.accessors[primitive.attributes.POSITION].count; i++, vertices++) {
      const parts = [primitive.attributes, ...primitive.targets].map((a) => raw(a.POSITION, i));
      distinct.add(parts.join());
    }
  }
  assert.equal(distinct.size, factsOf('dressed').shapes[0].length / 3);
  assert.ok(vertices > distinct.size);
});

test('the asset has the materials, image, colours and texture coordinates of the first shape', async () => {
  const json = jsonOf(bytesOf('dressed'));
  assert.equal(json.meshes[0].primitives.length, 2);
  assert.deepEqual(
    json.materials.map((m) => m.name),
    ['paint 0', 'paint 1'],
  );
  assert.equal(json.materials[0].pbrMetallicRoughness.baseColorTexture, undefined);
  assert.equal(json.materials[1].pbrMetallicRoughness.baseColorTexture.index, 0);
  const { meshes } = await load('dressed');
  for (const mesh of meshes) {
    const { position, uv, color } = mesh.geometry.attributes;
    const index = mesh.geometry.index.array;
    const facts = factsOf('dressed');
    const numbers = match(mesh, facts);
    for (let i = 0; i < position.count; i++) {
      assert.ok(color.getX(i) >= 0 && color.getX(i) <= 1);
      assert.ok(numbers[i] >= 0);
    }
    // No triangle crosses the seam: the coordinates go around once in 24 columns.
    for (let i = 0; i < index.length; i += 3) {
      const u = [0, 1, 2].map((k) => uv.getX(index[i + k]));
      assert.ok(Math.max(...u) - Math.min(...u) < 1.01 / 24);
    }
  }
  const colours = await load('colours');
  assert.equal(colours.meshes[0].geometry.morphAttributes.color.length, 1);
});
