// The spheres after the alignment: certified, the same surfaces, landmarks at one place.
import assert from 'node:assert/strict';
import { execFile } from 'node:child_process';
import { readFile, readdir, truncate } from 'node:fs/promises';
import path from 'node:path';
import test from 'node:test';
import { promisify } from 'node:util';
import { assertProblem, binaries, daemon, samples } from './support/daemon.mjs';
import * as shapes from './support/shapes.mjs';
import { coversOnce, readSphere } from './support/sphere.mjs';

const cross = ([a, b, c], [d, e, f]) => [b * f - c * e, c * d - a * f, a * e - b * d];
const minus = (p, q) => p.map((x, k) => x - q[k]);
const areaOf = (list) => list.reduce((sum, [p, q, r]) => sum + Math.hypot(...cross(minus(q, p), minus(r, p))) / 2, 0);

async function spheresOf(d, supermesh) {
  const all = [];
  for (const [k, shape] of supermesh.shapes.entries()) {
    assert.equal(shape.sphere, `${supermesh.url}/spheres/${k}.ply`);
    const reply = await d.get(shape.sphere);
    assert.equal(reply.status, 200);
    assert.match(reply.headers.get('cache-control'), /immutable/);
    assert.equal(Number(reply.headers.get('content-length')), reply.bytes.length);
    all.push({ ...readSphere(reply.bytes), bytes: reply.bytes });
  }
  return all;
}

/** The sphere's surface is the file's surface: it has the same vertices and the same area. */
function isSurfaceOf(sphere, source, what) {
  const met = new Set();
  for (const v of sphere.vertices) {
    if (v.source < 0) continue;
    assert.deepEqual(v.at, source.positions[v.source], `${what}: the very doubles of the file`);
    met.add(v.source);
  }
  assert.equal(met.size, source.positions.length, what);
  const wanted = areaOf(source.triangles.map((t) => t.map((v) => source.positions[v])));
  const area = areaOf(sphere.triangles.map((t) => t.map((v) => sphere.vertices[v].at)));
  assert.ok(Math.abs(area / wanted - 1) < 1e-9, `${what}: area ${area} of ${wanted}`);
}

const vertexAt = (sphere, p) => sphere.vertices.filter((v) => Math.hypot(...minus(v.at, p)) < 1e-12);

test('two animals: landmarks share their point of the sphere', async (t) => {
  const d = await daemon(t);
  const files = ['dog.obj', 'giraffe.off'];
  const meshes = [];
  const sources = [];
  for (const file of files) {
    meshes.push(await d.mesh(path.join(samples, file)));
    sources.push(shapes.parse(await readFile(path.join(samples, file), 'utf8')));
  }
  const { landmarks } = JSON.parse(await readFile(path.join(samples, 'dog-giraffe.json'), 'utf8'));
  const pair = meshes.map((m) => ({ mesh: m.id }));
  for (const align of ['pin', 'rbf', 'rotate']) {
    const supermesh = await d.made('/v1/supermeshes', { shapes: pair, landmarks, align: { method: align } });
    const spheres = await spheresOf(d, supermesh);
    spheres.forEach((sphere, s) => {
      coversOnce(sphere, `${align} ${files[s]}`);
      isSurfaceOf(sphere, sources[s], `${align} ${files[s]}`);
    });
    if (align === 'rotate') continue; // rotations alone cannot make them meet
    for (const { name, at } of landmarks) {
      const [a, b] = at.map((place, s) => spheres[s].vertices.find((v) => v.source === place.vertex).on);
      assert.deepEqual(a, b, `${align}: ${name} is at one point of the sphere`);
    }
  }
});

test('landmarks inside triangles become vertices; each shape has its sphere and no more', async (t) => {
  const d = await daemon(t);
  const sources = [shapes.egg(3), shapes.bean(3), shapes.egg(2)];
  const list = [];
  for (const m of sources) list.push({ mesh: (await d.upload(shapes.obj(m))).json.id });
  const tips = [0, 1, 2].map((axis) => ({
    at: sources.map((m) => ({ vertex: m.points.findIndex((p) => Math.abs(p[axis] - 1) < 1e-12) })),
  }));
  const weights = [0.25, 0.15, 0.6];
  const landmarks = [...tips, { at: sources.map(() => ({ triangle: 47, barycentric: weights })) }];
  const supermesh = await d.made('/v1/supermeshes', { shapes: list, landmarks });
  const spheres = await spheresOf(d, supermesh);
  const inside = spheres.map((sphere, s) => {
    coversOnce(sphere, `shape ${s}`);
    isSurfaceOf(sphere, sources[s], `shape ${s}`);
    const corners = sources[s].triangles[47].map((v) => sources[s].positions[v]);
    const there = vertexAt(
      sphere,
      [0, 1, 2].map((k) => corners.reduce((sum, p, c) => sum + weights[c] * p[k], 0)),
    );
    assert.equal(there.length, 1);
    assert.equal(there[0].source, -1, 'put in by the alignment');
    return there[0].on;
  });
  assert.deepEqual(inside[1], inside[0]);
  assert.deepEqual(inside[2], inside[0]);

  const { sphere } = supermesh.shapes[1];
  const part = await d.get(sphere, { headers: { range: 'bytes=4-9' } });
  assert.equal(part.status, 206);
  assert.deepEqual(part.bytes, spheres[1].bytes.subarray(4, 10));
  assert.equal(part.headers.get('content-range'), `bytes 4-9/${spheres[1].bytes.length}`);
  const last = await d.get(sphere, { headers: { range: 'bytes=-5' } });
  assert.deepEqual(last.bytes, spheres[1].bytes.subarray(-5));
  assert.equal((await d.get(sphere, { headers: { range: `bytes=${spheres[1].bytes.length}-` } })).status, 416);
  assert.equal((await d.get(sphere, { headers: { 'if-none-match': part.headers.get('etag') } })).status, 304);
  for (const k of ['3', '15', '16', '00', '-1', 'x'])
    assertProblem(await d.get(`${supermesh.url}/spheres/${k}.ply`), 404, 'not-found', k);
  assertProblem(await d.post(sphere, {}), 405, 'method-not-allowed');
  assert.equal((await d.delete(supermesh.url)).status, 204);
  assertProblem(await d.get(sphere), 404, 'not-found');
});

test('--check-data checks the aligned spheres, too', async (t) => {
  const d = await daemon(t);
  const list = [];
  for (const m of [shapes.egg(2), shapes.bean(2)]) list.push({ mesh: (await d.upload(shapes.obj(m))).json.id });
  const supermesh = await d.made('/v1/supermeshes', { shapes: list });
  await d.stop();
  const check = () => promisify(execFile)(binaries.daemon, ['--data', d.data, '--check-data']);
  await check();
  const folder = path.join(d.data, 'objects/spheres');
  const found = (await readdir(folder, { recursive: true })).filter((name) => name.endsWith(supermesh.id));
  assert.equal(found.length, 1);
  await truncate(path.join(folder, found[0]), 1000);
  const { stdout, code } = await check().catch((error) => error);
  assert.notEqual(code, 0);
  assert.match(stdout, new RegExp(`${supermesh.id}.*aligned spheres`));
  await d.start();
  assert.ok([404, 500].includes((await d.get(supermesh.shapes[0].sphere)).status));
});
