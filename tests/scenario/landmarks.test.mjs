// Landmarks as a resource: content-addressed, owned by tenants, and named by supermeshes.
import assert from 'node:assert/strict';
import { createHash } from 'node:crypto';
import { readFile } from 'node:fs/promises';
import path from 'node:path';
import test from 'node:test';
import { runProgram } from './support/cli.mjs';
import { assertProblem, binaries, daemon, samples } from './support/daemon.mjs';

const file = JSON.parse(await readFile(path.join(samples, 'dog-giraffe.json'), 'utf8'));
const two = [{ name: 'nose', at: [{ vertex: 3 }, { vertex: 5 }] }];

test('landmarks are stored once, read, listed and deleted', async (t) => {
  const d = await daemon(t);
  const made = await d.post('/v1/landmarks', file);
  assert.equal(made.status, 201, made.bytes.toString());
  const { id, url, count, shapes } = made.json;
  assert.deepEqual([url, count, shapes], [`/v1/landmarks/${id}`, file.landmarks.length, 2]);
  assert.equal(made.headers.get('location'), url);
  // The array alone is the same list, and so is one that spells out the defaults.
  const spelled = file.landmarks.map((l) => ({ radius: 0, pass: 0, ...l, confidence: 1 }));
  for (const body of [file.landmarks, spelled, file]) {
    const again = await d.post('/v1/landmarks', body);
    assert.deepEqual([again.status, again.json.id], [200, id]);
  }
  const other = (await d.post('/v1/landmarks', two)).json;
  assert.notEqual(other.id, id);
  const got = await d.get(url);
  assert.deepEqual(
    got.json.landmarks.map((l) => ({ name: l.name, at: l.at })),
    file.landmarks.map((l) => ({ name: l.name, at: l.at })),
  );
  assert.equal((await d.get(url, { headers: { 'if-none-match': got.headers.get('etag') } })).status, 304);
  // The id is the hash of the canonical array.
  const canonical = JSON.stringify(got.json.landmarks);
  assert.equal(id, createHash('sha256').update(canonical).digest('hex'));
  const listed = (await d.get('/v1/landmarks')).json;
  assert.deepEqual(
    listed.landmarks.map((l) => [l.id, l.count]),
    [
      [other.id, 1],
      [id, file.landmarks.length],
    ],
  );
  assert.ok(
    listed.landmarks.every((l) => l.landmarks === undefined),
    'a list leaves the places out',
  );
  const page = (await d.get('/v1/landmarks?limit=1')).json;
  assert.equal((await d.get(`/v1/landmarks?limit=1&page_token=${page.next_page_token}`)).json.landmarks[0].id, id);
  assert.equal((await d.delete(url)).status, 204);
  await d.gone(url);
  assertProblem(await d.get(url), 404, 'not-found');
  assert.equal((await d.get('/v1/landmarks')).json.landmarks.length, 1);
});

test('a value that is not a list of landmarks is refused', async (t) => {
  const d = await daemon(t);
  const place = { vertex: 1 };
  for (const [body, type] of [
    [[], 'bad-landmarks'],
    ['auto', 'bad-landmarks'],
    [{ landmarks: 'auto' }, 'bad-landmarks'],
    [{ landmarks: [] }, 'bad-landmarks'],
    [[{ at: [place] }], 'bad-landmarks'],
    [[{ at: Array(17).fill(place) }], 'bad-landmarks'],
    [[{ at: [place, place] }, { at: [place, place, place] }], 'bad-landmarks'],
    [[{ at: [place, { vertex: -1 }] }], 'bad-landmarks'],
    [[{ at: [place, place], nose: 1 }], 'unknown-member'],
    [{ landmarks: two, shapes: 2 }, 'unknown-member'],
    [Array(1025).fill(two[0]), 'bad-landmarks'],
  ]) {
    const reply = await d.request('POST', '/v1/landmarks', { body: Buffer.from(JSON.stringify(body)) });
    assertProblem(reply, 422, type, JSON.stringify(body).slice(0, 80));
  }
  assert.equal((await d.get('/v1/landmarks')).json.landmarks.length, 0);
});

test('a supermesh with landmarks by id is the one with the same landmarks in place', async (t) => {
  const d = await daemon(t);
  const shapes = [];
  for (const name of ['dog.obj', 'giraffe.off']) shapes.push({ mesh: (await d.mesh(path.join(samples, name))).id });
  const { id } = (await d.post('/v1/landmarks', file)).json;
  const remesh = { tolerance: 0.02 };
  const byId = await d.made('/v1/supermeshes', { shapes, landmarks: { id }, remesh });
  const inPlace = await d.make('/v1/supermeshes', { shapes, landmarks: file.landmarks, remesh });
  assert.deepEqual([inPlace.status, inPlace.resource.id], [200, byId.id]);
  assert.equal(byId.request.align.method, 'pin');
  assert.equal(byId.landmarks.length, file.landmarks.length);
  // The supermesh does not depend on the resource.
  await d.delete(`/v1/landmarks/${id}`);
  await d.gone(`/v1/landmarks/${id}`);
  assert.equal((await d.get(byId.url)).status, 200);
  for (const [landmarks, status, type] of [
    [{ id }, 404, 'not-found'],
    [{ id: 'x' }, 404, 'not-found'],
    [{ id: 7 }, 404, 'not-found'],
    [{ id, at: [] }, 422, 'unknown-member'],
    [{ landmarks: [] }, 422, 'bad-landmarks'],
  ])
    assertProblem(await d.post('/v1/supermeshes', { shapes, landmarks }), status, type, JSON.stringify(landmarks));
  // Landmarks for three shapes do not fit two.
  const three = (await d.post('/v1/landmarks', [{ at: [{ vertex: 0 }, { vertex: 1 }, { vertex: 2 }] }])).json;
  assertProblem(await d.post('/v1/supermeshes', { shapes, landmarks: { id: three.id } }), 422, 'bad-landmarks');
});

test('tenants see their own landmarks, and quotas count them', async (t) => {
  const d = await daemon(t, { args: ['--auth', 'on'] });
  const token = async (name, ...more) => {
    const made = await runProgram(binaries.daemon, [
      ...['token', 'add', name, '--scope', 'read,write', '--data', d.data],
      ...more,
    ]);
    assert.equal(made.code, 0, made.err);
    return { headers: { authorization: `Bearer ${made.out.trim()}` } };
  };
  const ann = await token('ann');
  const bob = await token('bob');
  const poor = await token('poor', '--quota', '100');
  const made = await d.post('/v1/landmarks', file, ann);
  assert.equal(made.status, 201);
  assertProblem(await d.get(made.json.url, bob), 404, 'not-found');
  assert.equal((await d.get('/v1/landmarks', bob)).json.landmarks.length, 0);
  assert.equal((await d.post('/v1/landmarks', file, bob)).status, 201, 'as if nobody had sent them before');
  assert.equal((await d.delete(made.json.url, ann)).status, 204);
  assert.equal((await d.get(made.json.url, bob)).status, 200);
  assertProblem(await d.post('/v1/landmarks', file, poor), 429, 'quota-exceeded');
  await d.stop();
  const check = await runProgram(binaries.daemon, ['--check-data', '--data', d.data]);
  assert.equal(check.code, 0, check.out);
});

test('landmarks survive a restart, and eviction never takes them', async (t) => {
  const d = await daemon(t, { args: ['--derived-bytes', '1M'] });
  const { url } = (await d.post('/v1/landmarks', file)).json;
  await d.stop('SIGKILL');
  d.killed = true;
  await d.start();
  assert.equal((await d.get(url)).status, 200);
  await d.stop();
  const gc = await runProgram(binaries.daemon, ['--gc', '--derived-bytes', '1M', '--data', d.data]);
  assert.equal(gc.code, 0, gc.err);
  await d.start();
  assert.equal((await d.get(url)).status, 200);
});
