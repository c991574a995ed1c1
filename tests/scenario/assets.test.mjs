// The asset as clients receive it: caching, ranges, the Khronos validator, three.js.
import assert from 'node:assert/strict';
import { readFile } from 'node:fs/promises';
import path from 'node:path';
import test from 'node:test';
import validator from 'gltf-validator';
import { GLTFLoader } from 'three/examples/jsm/loaders/GLTFLoader.js';
import { daemon, samples, assertProblem } from './support/daemon.mjs';
import { farthest } from './support/distance.mjs';
import * as shapes from './support/shapes.mjs';

async function makeAsset(d) {
  const landmarks = JSON.parse(await readFile(path.join(samples, 'dog-giraffe.json'), 'utf8')).landmarks;
  const [dog, giraffe] = [await d.mesh(path.join(samples, 'dog.obj')), await d.mesh(path.join(samples, 'giraffe.off'))];
  return d.made('/v1/supermeshes', {
    shapes: [
      { mesh: dog.id, name: 'dog' },
      { mesh: giraffe.id, name: 'giraffe' },
    ],
    landmarks,
  });
}

test('with auth = off no file is for shared caches, as with a token', async (t) => {
  const d = await daemon(t, { args: ['--auth', 'off'] });
  const { url, asset } = await makeAsset(d);
  const [embedding] = (await d.get('/v1/embeddings')).json.embeddings;
  const [mesh] = (await d.get('/v1/meshes')).json.meshes;
  for (const file of [asset, `${asset}?profile=meshopt`, `${url}/places`, `${url}/spheres/0.ply`, embedding.sphere]) {
    const { status, headers } = await d.get(file);
    assert.deepEqual([status, headers.get('cache-control')], [200, 'private, max-age=31536000, immutable'], file);
    const again = await d.get(file, { headers: { 'if-none-match': headers.get('etag') } });
    assert.deepEqual([again.status, again.headers.get('cache-control')], [304, headers.get('cache-control')], file);
  }
  assert.equal((await d.get(`${mesh.url}/file`)).headers.get('cache-control'), 'private, max-age=31536000, immutable');
});

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
  for (const [range, from, to] of [
    ['bytes=0-99', 0, 99],
    ['bytes=100-', 100, n - 1],
    ['bytes=-50', n - 50, n - 1],
    [`bytes=10-${n + 999}`, 10, n - 1],
  ]) {
    const part = await d.get(supermesh.asset, headers(range));
    assert.equal(part.status, 206, range);
    assert.equal(part.headers.get('content-range'), `bytes ${from}-${to}/${n}`);
    assert.ok(part.bytes.equals(whole.bytes.subarray(from, to + 1)), range);
  }
  const beyond = await d.get(supermesh.asset, headers(`bytes=${n}-`));
  assert.equal(beyond.status, 416);
  assert.equal(beyond.headers.get('content-range'), `bytes */${n}`);
  // Requests for several ranges, or for something that is not a range of bytes, get the whole asset, as RFC 9110
  // allows.
  for (const range of [
    'bytes=0-1,3-4',
    'bytes=5-2',
    'bytes=',
    'bytes=-',
    'bytes=a-b',
    'lines=0-1',
    `bytes=${'9'.repeat(30)}-`,
  ]) {
    const all = await d.get(supermesh.asset, headers(range));
    assert.equal(all.status, 200, range);
    assert.ok(all.bytes.equals(whole.bytes), range);
    assert.equal(all.headers.get('content-range'), null);
  }
  assert.equal((await d.get(supermesh.asset, headers('bytes=-0'))).status, 416);
  assert.equal(
    (await d.get(supermesh.asset, headers('bytes=0-9', { 'if-range': '"other"' }))).status,
    200,
    'If-Range that does not match',
  );
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
  const at = (weight) => Array.from(position.array, (x, i) => x + weight * target.array[i]);
  const triangles = Array.from(mesh.geometry.index.array);
  for (const [weight, file] of [
    [0, 'dog.obj'],
    [1, 'giraffe.off'],
  ]) {
    const source = shapes.parse(await readFile(path.join(samples, file), 'utf8'));
    const diagonal = Math.hypot(
      ...[0, 1, 2].map(
        (k) => Math.max(...source.positions.map((p) => p[k])) - Math.min(...source.positions.map((p) => p[k])),
      ),
    );
    const off = farthest(source.positions, at(weight), triangles) / diagonal;
    assert.ok(off < 0.0011, `${file} at weight ${weight}: ${off} of the diagonal`);
    const report = supermesh.shapes[weight].hausdorff_relative;
    assert.ok(off <= report * 1.0001 + 1e-6, `${file}: ${off} where the report says ${report}`);
  }
});

test('unknown supermeshes have no asset', async (t) => {
  const d = await daemon(t);
  assertProblem(await d.get(`/v1/supermeshes/${'0'.repeat(64)}/asset.glb`), 404, 'not-found');
});
