// Embeddings: the certificate, the sphere, and caching.
import assert from 'node:assert/strict';
import { readFile } from 'node:fs/promises';
import path from 'node:path';
import test from 'node:test';
import { daemon, samples, assertProblem } from './support/daemon.mjs';
import * as shapes from './support/shapes.mjs';
import { coversOnce, readSphere } from './support/sphere.mjs';

test('an embedding is certified, and its sphere confirms it', async (t) => {
  const d = await daemon(t);
  for (const file of ['dog.obj', 'giraffe.off', 'elephant.ply']) {
    const mesh = await d.mesh(path.join(samples, file));
    const embedding = await d.made('/v1/embeddings', { mesh: mesh.id });
    assert.equal(embedding.mesh, mesh.id);
    assert.equal(embedding.method, 'newton');
    assert.equal(embedding.certificate.valid, true);
    assert.equal(embedding.certificate.flipped, 0);
    assert.equal(embedding.certificate.degenerate, 0);
    assert.equal(embedding.certificate.degree, 1);
    assert.equal(embedding.certificate.exact, true);
    const { symmetric_dirichlet: energy, stretch_efficiency } = embedding.distortion;
    assert.ok(energy.mean >= 1 && energy.mean < 20, `${file}: ${energy.mean}`);
    assert.ok(energy.median <= energy.p99 && energy.p99 <= energy.max);
    assert.equal(energy.histogram.edges.length, energy.histogram.counts.length + 1);
    assert.ok(stretch_efficiency > 0 && stretch_efficiency <= 1);
    assert.ok(embedding.timings_ms.total > 0);

    const sphere = await d.get(`${embedding.url}/sphere.ply`);
    assert.equal(sphere.status, 200);
    const { vertices, triangles } = readSphere(sphere.bytes);
    const source = shapes.parse(await readFile(path.join(samples, file), 'utf8'));
    assert.equal(vertices.length, source.positions.length);
    assert.equal(triangles.length, source.triangles.length);
    for (const v of vertices) assert.deepEqual(v.at, source.positions[v.source], 'the very doubles of the file');
    coversOnce({ vertices, triangles }, file);
  }
});

test('the second request costs nothing', async (t) => {
  const d = await daemon(t);
  const mesh = await d.mesh(path.join(samples, 'dog.obj'));
  const first = await d.make('/v1/embeddings', { mesh: mesh.id });
  assert.equal(first.status, 202);
  assert.equal(first.job.kind, 'embedding');
  const second = await d.make('/v1/embeddings', { mesh: mesh.id, method: 'newton', options: {} });
  assert.equal(second.status, 200, 'defaults that are spelled out name the same embedding');
  assert.deepEqual(second.resource, first.resource);
  assert.deepEqual((await d.get(first.resource.url)).json, first.resource);
  const list = Object.values((await d.get('/v1/embeddings')).json).find(Array.isArray);
  assert.deepEqual(
    list.map((e) => e.id),
    [first.resource.id],
  );
});

test('a result is listed as soon as its job has succeeded', async (t) => {
  const d = await daemon(t);
  for (let i = 0; i < 20; i++) {
    const mesh = (await d.upload(shapes.obj(shapes.ball(1, ([x, y, z]) => [x, y, z * (1 + i / 50)])))).json;
    let job = (await d.post('/v1/embeddings', { mesh: mesh.id })).json;
    while (job.state !== 'succeeded') {
      assert.ok(['queued', 'running'].includes(job.state), JSON.stringify(job));
      job = (await d.get(job.url)).json;
    }
    const [newest] = (await d.get('/v1/embeddings', { query: { limit: 1 } })).json.embeddings;
    assert.deepEqual([newest.url, newest.mesh], [job.result, mesh.id]);
    assert.deepEqual((await d.get(job.result)).json, newest);
  }
});

test('the smallest and the strangest meshes embed', async (t) => {
  const d = await daemon(t);
  for (const text of [
    shapes.tetrahedron,
    shapes.cube,
    shapes.obj(shapes.ball(1)),
    shapes.obj(shapes.ball(3, ([x, y, z]) => [x, 1e-3 * y, 50 * z])),
  ]) {
    const { json: mesh } = await d.upload(text);
    const embedding = await d.made('/v1/embeddings', { mesh: mesh.id });
    assert.equal(embedding.certificate.flipped, 0);
    assert.equal(embedding.certificate.degree, 1);
  }
});

test('wrong requests are refused by name', async (t) => {
  const d = await daemon(t);
  const mesh = await d.mesh(path.join(samples, 'dog.obj'));
  const refused = async (body, ...statuses) => {
    const reply = await d.post('/v1/embeddings', body);
    assert.ok(statuses.includes(reply.status), `${JSON.stringify(body)}: ${reply.status} ${reply.bytes}`);
    assert.equal(reply.type.split(';')[0], 'application/problem+json');
    return reply.json;
  };
  await refused({}, 400, 422);
  await refused({ mesh: 12 }, 400, 422);
  await refused({ mesh: mesh.id, method: 'magic' }, 400, 422);
  const unknown = await refused({ mesh: mesh.id, colour: 'red' }, 400, 422);
  assert.match(unknown.detail, /colour/);
  const option = await refused({ mesh: mesh.id, options: { wobble: 1 } }, 400, 422);
  assert.match(option.detail, /wobble/);
  await refused({ mesh: mesh.id, options: { energy_weight: -3 } }, 400, 422);
  assertProblem(await d.post('/v1/embeddings', { mesh: '0'.repeat(64) }), 404, 'not-found');
});
