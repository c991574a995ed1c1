// Embeddings: the certificate, the sphere that goes with it, and its cache.
import assert from 'node:assert/strict';
import { readFile } from 'node:fs/promises';
import path from 'node:path';
import test from 'node:test';
import { daemon, samples, assertProblem } from './support/daemon.mjs';
import * as shapes from './support/shapes.mjs';

function readSphere(bytes) {
  const end = bytes.indexOf('end_header\n') + 11;
  const head = bytes.toString('latin1', 0, end);
  assert.match(head, /^ply\nformat binary_little_endian 1\.0\n/);
  const count = Number(/element vertex (\d+)/.exec(head)[1]), faces = Number(/element face (\d+)/.exec(head)[1]);
  const properties = [...head.matchAll(/property (?!list)(\w+) (\w+)/g)].map((m) => m.slice(1).join(' '));
  assert.deepEqual(properties, ['double x', 'double y', 'double z', 'double px', 'double py', 'double pz', 'int source']);
  assert.match(head, /property list uchar int vertex_indices/);
  const vertices = [], triangles = [];
  let at = end;
  for (let v = 0; v < count; v++, at += 52) {
    const x = Array.from({ length: 6 }, (_, k) => bytes.readDoubleLE(at + 8 * k));
    vertices.push({ at: x.slice(0, 3), on: x.slice(3), source: bytes.readInt32LE(at + 48) });
  }
  for (let f = 0; f < faces; f++, at += 13) {
    assert.equal(bytes[at], 3);
    triangles.push([0, 1, 2].map((k) => bytes.readInt32LE(at + 1 + 4 * k)));
  }
  assert.equal(at, bytes.length);
  return { vertices, triangles };
}

const determinant = ([a, b, c], [d, e, f], [g, h, i]) => a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g);

/** Twice the tangent of half the solid angle, by Oosterom and Strackee. */
function solidAngle(p, q, r) {
  const dot = (u, v) => u[0] * v[0] + u[1] * v[1] + u[2] * v[2];
  return 2 * Math.atan2(determinant(p, q, r), 1 + dot(p, q) + dot(q, r) + dot(r, p));
}

test('an embedding is certified, and its sphere bears it out', async (t) => {
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
    for (const v of vertices) {
      assert.deepEqual(v.at, source.positions[v.source], 'the very doubles of the file');
      assert.ok(Math.abs(Math.hypot(...v.on) - 1) < 1e-12);
    }
    let angle = 0;
    for (const [a, b, c] of triangles) {
      const [p, q, r] = [vertices[a].on, vertices[b].on, vertices[c].on];
      assert.ok(determinant(p, q, r) > 0, `${file}: a triangle is turned over`);
      angle += solidAngle(p, q, r);
    }
    assert.ok(Math.abs(angle - 4 * Math.PI) < 1e-6, `${file}: it covers the sphere once`);
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
  assert.deepEqual(list.map((e) => e.id), [first.resource.id]);
});

test('the smallest and the oddest meshes embed', async (t) => {
  const d = await daemon(t);
  for (const text of [shapes.tetrahedron, shapes.cube, shapes.obj(shapes.ball(1)), shapes.obj(shapes.ball(3, ([x, y, z]) => [x, 1e-3 * y, 50 * z]))]) {
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
