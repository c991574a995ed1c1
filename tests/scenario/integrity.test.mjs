// Stored bytes that have changed: the daemon computes no result from them, and uploading the file again restores them.
import assert from 'node:assert/strict';
import { readdirSync, readFileSync, writeFileSync } from 'node:fs';
import path from 'node:path';
import test from 'node:test';
import { assertProblem, daemon } from './support/daemon.mjs';
import { flip, object } from './support/objects.mjs';
import * as shapes from './support/shapes.mjs';

/** Changes one digit of a stored mesh, so that it is still a mesh of the same size. */
function alter(d, id) {
  const file = path.join(d.data, 'objects/mesh', id.slice(0, 2), id);
  const bytes = readFileSync(file);
  const at = bytes.indexOf('1');
  bytes[at] ^= 1;
  writeFileSync(file, bytes);
}

for (const isolate of ['on', 'off'])
  test(`a mesh whose bytes changed on the disk is refused, and healed by an upload (isolate ${isolate})`, async (t) => {
    const d = await daemon(t, { args: ['--isolate', isolate] });
    const text = shapes.obj(shapes.egg(2));
    const { json: mesh } = await d.upload(text);
    alter(d, mesh.id);
    const made = await d.make('/v1/embeddings', { mesh: mesh.id });
    assert.equal(made.problem?.type, '/problems/corrupt', JSON.stringify(made));
    const again = await d.upload(text);
    assert.equal(again.status, 200, again.bytes.toString());
    assert.equal((await d.get(`${mesh.url}/file`)).bytes.toString(), text);
    assert.equal((await d.made('/v1/embeddings', { mesh: mesh.id })).certificate.valid, true);
    assert.match(d.log, /was lost or altered and is restored/);
    assert.equal(await quarantined(d), 1);
  });

const quarantined = async (d) =>
  Number(/^orbmorph_objects_quarantined_total (\d+)$/m.exec((await d.get('/metrics')).bytes.toString())[1]);

test('a flipped bit is found when an object is first served after a start', async (t) => {
  const d = await daemon(t); // its scrub reads the same objects at the same time
  const texts = [shapes.obj(shapes.egg(2)), shapes.obj(shapes.bean(2))];
  const meshes = [(await d.upload(texts[0])).json, (await d.upload(texts[1])).json];
  const request = { shapes: meshes.map(({ id }) => ({ mesh: id })), align: { method: 'rotate' } };
  const morph = await d.made('/v1/supermeshes', request);
  const [embedding] = (await d.get('/v1/embeddings')).json.embeddings;
  const made = [
    ['asset', morph.asset, morph.url],
    ['places', `${morph.url}/places`, morph.url],
    ['spheres', `${morph.url}/spheres/1.ply`, morph.url],
    ['quantized', `${morph.asset}?profile=quantized`, morph.url],
    ['sphere', embedding.sphere, embedding.url],
  ];
  const right = new Map();
  for (const [, url] of made) right.set(url, (await d.get(url)).bytes);
  assert.equal(await quarantined(d), 0);

  // Sending a mesh again restores it.
  await d.stop();
  const bad = flip(object(d.data, 'mesh', meshes[0].id));
  await d.start();
  for (let turn = 0; turn < 2; turn++) assertProblem(await d.get(`${meshes[0].url}/file`), 500, 'internal');
  assert.equal(await quarantined(d), 1, 'counted once');
  const [aside] = readdirSync(path.join(d.data, 'quarantine'));
  assert.ok(aside.startsWith(`mesh-${meshes[0].id}-`), aside);
  assert.deepEqual(readFileSync(path.join(d.data, 'quarantine', aside)), bad, 'nothing is deleted');
  assert.match(d.log, /"level":"error","message":"a stored file does not match its hash and was moved to /);
  assert.equal((await d.get(`${meshes[1].url}/file`)).bytes.toString(), texts[1], 'no other is');
  assert.equal((await d.upload(texts[0])).status, 200);
  assert.equal((await d.get(`${meshes[0].url}/file`)).bytes.toString(), texts[0]);

  // Each kind of derived object: a damaged one is never served; the daemon makes a profile again by itself, all others
  // at the next request.
  for (const [kind, url, resource] of made) {
    await d.stop();
    flip(object(d.data, kind, resource.split('/').pop()));
    await d.start();
    const reply = await d.get(url);
    if (kind === 'quantized') assert.deepEqual(reply.bytes, right.get(url), kind);
    else assertProblem(reply, 404, 'not-found');
    assert.equal(await quarantined(d), 1, kind);
    if (kind === 'quantized') continue;
    assertProblem(await d.get(resource), 404, 'not-found');
    if (kind === 'sphere') await d.made('/v1/embeddings', { mesh: embedding.mesh });
    else await d.made('/v1/supermeshes', request);
    assert.deepEqual((await d.get(url)).bytes, right.get(url), kind);
    for (const [, other] of made) assert.equal((await d.get(other)).status, 200, other);
  }
});

test('the daemon does not start on a damaged catalogue, and says what to do', async (t) => {
  const d = await daemon(t);
  for (let k = 0; k < 30; k++)
    assert.equal((await d.upload(shapes.obj(shapes.ball(1, (p) => [p[0] + k, p[1], p[2]])))).status, 201);
  await d.stop();
  const file = path.join(d.data, 'catalogue.sqlite');
  const bytes = readFileSync(file);
  const page = bytes.readUInt16BE(16);
  const row = bytes.lastIndexOf('"vertices":'); // in the description of a mesh
  const start = row - (row % page);
  assert.ok(start > 0);
  const whole = readFileSync(file);
  bytes.fill(0xa5, start, start + 64); // the head of its page
  writeFileSync(file, bytes);
  await assert.rejects(d.start(), /the daemon did not start/);
  assert.match(d.log, /the catalogue \S*catalogue.sqlite is damaged: .*orbmorphd restore/);
  writeFileSync(file, whole);
  await d.start();
});

test('the daemon does not start on a catalogue of a newer program', async (t) => {
  const d = await daemon(t);
  await d.stop();
  const file = path.join(d.data, 'catalogue.sqlite');
  const bytes = readFileSync(file);
  const own = bytes.readUInt32BE(60); // user_version, at this place of a file of SQLite
  assert.ok(own > 0 && own < 999);
  bytes.writeUInt32BE(999, 60);
  writeFileSync(file, bytes);
  await assert.rejects(d.start(), /the daemon did not start: exit 78/);
  assert.match(d.log, /schema 999.*install a newer version/);
  assert.equal(readFileSync(file).readUInt32BE(60), 999);
  bytes.writeUInt32BE(own, 60);
  writeFileSync(file, bytes);
  await d.start();
});
