// The asset as clients get it: caching, ranges, the Khronos validator, three.js.
import assert from 'node:assert/strict';
import { readFile } from 'node:fs/promises';
import path from 'node:path';
import test from 'node:test';
import validator from 'gltf-validator';
import { GLTFLoader } from 'three/examples/jsm/loaders/GLTFLoader.js';
import { daemon, samples, assertProblem } from './support/daemon.mjs';
import * as shapes from './support/shapes.mjs';

async function makeAsset(d) {
  const landmarks = JSON.parse(await readFile(path.join(samples, 'dog-giraffe.json'), 'utf8')).landmarks;
  const [dog, giraffe] = [await d.mesh(path.join(samples, 'dog.obj')), await d.mesh(path.join(samples, 'giraffe.off'))];
  return d.made('/v1/supermeshes', { shapes: [{ mesh: dog.id, name: 'dog' }, { mesh: giraffe.id, name: 'giraffe' }], landmarks });
}

/** The largest distance of any vertex of `mesh` from the nearest of the points, with a grid. */
function farthest(points, mesh) {
  const cell = 0.2;
  const grid = new Map();
  const key = (x, y, z) => `${Math.floor(x / cell)},${Math.floor(y / cell)},${Math.floor(z / cell)}`;
  for (let i = 0; i < points.length; i += 3) {
    const k = key(points[i], points[i + 1], points[i + 2]);
    if (!grid.has(k)) grid.set(k, []);
    grid.get(k).push(i);
  }
  let worst = 0;
  for (const [x, y, z] of mesh.positions) {
    let least = Infinity;
    for (let a = -1; a <= 1; a++)
      for (let b = -1; b <= 1; b++)
        for (let c = -1; c <= 1; c++)
          for (const i of grid.get(key(x + a * cell, y + b * cell, z + c * cell)) ?? [])
            least = Math.min(least, Math.hypot(points[i] - x, points[i + 1] - y, points[i + 2] - z));
    worst = Math.max(worst, least);
  }
  return worst;
}

test('an asset is immutable, comes in ranges, passes the validator and loads in three.js', async (t) => {
  const d = await daemon(t);
  const supermesh = await makeAsset(d);
  const whole = await d.get(supermesh.asset);
  assert.equal(whole.status, 200);
  assert.equal(whole.headers.get('content-type'), 'model/gltf-binary');
  assert.equal(whole.headers.get('cache-control'), 'public, max-age=31536000, immutable');
  assert.equal(Number(whole.headers.get('content-length')), whole.bytes.length);
  const etag = whole.headers.get('etag');
  assert.match(etag, /^"[^"]+"$/);

  const headers = (range, more) => ({ headers: { range, ...more } });
  const n = whole.bytes.length;
  for (const [range, from, to] of [['bytes=0-99', 0, 99], ['bytes=100-', 100, n - 1], ['bytes=-50', n - 50, n - 1], [`bytes=10-${n + 999}`, 10, n - 1]]) {
    const part = await d.get(supermesh.asset, headers(range));
    assert.equal(part.status, 206, range);
    assert.equal(part.headers.get('content-range'), `bytes ${from}-${to}/${n}`);
    assert.ok(part.bytes.equals(whole.bytes.subarray(from, to + 1)), range);
  }
  const beyond = await d.get(supermesh.asset, headers(`bytes=${n}-`));
  assert.equal(beyond.status, 416);
  assert.equal(beyond.headers.get('content-range'), `bytes */${n}`);
  assert.equal((await d.get(supermesh.asset, headers('bytes=0-9', { 'if-range': '"other"' }))).status, 200, 'If-Range that does not match');
  assert.equal((await d.get(supermesh.asset, headers('bytes=0-9', { 'if-range': etag }))).status, 206);
  for (const match of [etag, `"x", ${etag}`, '*']) {
    const same = await d.get(supermesh.asset, { headers: { 'if-none-match': match } });
    assert.equal(same.status, 304, match);
    assert.equal(same.bytes.length, 0);
    assert.equal(same.headers.get('etag'), etag);
  }
  assert.equal((await d.get(supermesh.asset, { headers: { 'if-none-match': '"other"' } })).status, 200);
  const head = await d.request('HEAD', supermesh.asset);
  assert.equal(head.status, 200);
  assert.equal(head.bytes.length, 0);
  assert.equal(Number(head.headers.get('content-length')), n);

  const report = await validator.validateBytes(new Uint8Array(whole.bytes));
  assert.equal(report.issues.numErrors, 0, JSON.stringify(report.issues.messages.slice(0, 5)));
  assert.equal(report.issues.numWarnings, 0, JSON.stringify(report.issues.messages.slice(0, 5)));

  const buffer = whole.bytes.buffer.slice(whole.bytes.byteOffset, whole.bytes.byteOffset + n);
  const gltf = await new GLTFLoader().parseAsync(buffer, '');
  let mesh;
  gltf.scene.traverse((node) => (mesh ??= node.isMesh ? node : undefined));
  assert.equal(gltf.animations.length, 1);
  assert.equal(mesh.morphTargetDictionary.giraffe, 0);
  const { position } = mesh.geometry.attributes;
  const [target] = mesh.geometry.morphAttributes.position;
  assert.equal(mesh.geometry.morphTargetsRelative, true);
  const sizes = { dog: 2.6, giraffe: 3.4 };
  const at = (weight) => Array.from(position.array, (x, i) => x + weight * target.array[i]);
  for (const [weight, file, name] of [[0, 'dog.obj', 'dog'], [1, 'giraffe.off', 'giraffe']]) {
    const source = shapes.parse(await readFile(path.join(samples, file), 'utf8'));
    assert.ok(farthest(at(weight), source) < 0.03 * sizes[name], `${name} at weight ${weight}`);
  }
});

test('assets of unknown supermeshes are not there', async (t) => {
  const d = await daemon(t);
  assertProblem(await d.get(`/v1/supermeshes/${'0'.repeat(64)}/asset.glb`), 404, 'not-found');
});
