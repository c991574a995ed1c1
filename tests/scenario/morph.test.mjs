// A morph by URL: the recipe is the URL, and the answer is the asset, whether it exists already or not.
import assert from 'node:assert/strict';
import { readFile } from 'node:fs/promises';
import path from 'node:path';
import test from 'node:test';
import { rigged } from '../samples/rigged.mjs';
import { assertProblem, daemon, endless, samples } from './support/daemon.mjs';
import { parseGlb } from './support/glb.mjs';
import * as shapes from './support/shapes.mjs';

const landmarks = JSON.parse(await readFile(path.join(samples, 'dog-giraffe.json'), 'utf8'));

// Small shapes, and a rotation instead of a search for correspondences, which takes long.
async function pair(d) {
  const ids = [];
  for (const [name, mesh] of Object.entries({ egg: shapes.egg(2), bean: shapes.bean(2) }))
    ids.push((await d.upload(shapes.obj(mesh), { name })).json.id);
  return ids.join(',');
}
async function animals(d) {
  const dog = (await d.mesh(path.join(samples, 'dog.obj'))).id;
  const giraffe = (await d.mesh(path.join(samples, 'giraffe.off'))).id;
  return `${dog},${giraffe}`;
}
const plain = (ids) => `/v1/morph.glb?shapes=${ids}&tolerance=0.05`;
const small = (ids) => `${plain(ids)}&align=rotate`;

// Large JSON is read one at a time. A request that forgot to let others read would stop all of these, and the end too.
test('a morph by a large set of landmarks leaves room for others', async (t) => {
  const d = await daemon(t);
  const ids = await pair(d);
  const large = Array.from({ length: 150 }, (_, i) => ({
    name: `${i} ${'x'.repeat(110)}`,
    at: [{ vertex: i }, { vertex: i }],
  }));
  const set = await d.post('/v1/landmarks', { landmarks: large });
  assert.equal(set.status, 201, set.bytes.toString());
  const url = (i) => `/v1/morph.glb?shapes=${ids}&landmarks=${set.json.id}&tolerance=0.0${i + 4}&wait=0`;
  for (let i = 0; i < 3; i++) assertProblem(await d.get(url(i)), 422, 'bad-landmarks'); // the egg has 66 vertices
  const others = await Promise.all(
    Array.from({ length: 16 }, () => d.post('/v1/landmarks', { landmarks: 'x'.repeat(20_000) })),
  );
  for (const other of others) assert.equal(other.status, 422, other.bytes.toString().slice(0, 300));
});

test('one request makes a morph that nobody has computed before', async (t) => {
  const d = await daemon(t);
  const url = small(await pair(d));
  const first = await d.get(url);
  assert.equal(first.status, 200, first.bytes.toString());
  assert.equal(first.type, 'model/gltf-binary');
  assert.deepEqual(parseGlb(first.bytes).gltf.meshes[0].extras.targetNames, ['bean']);
  assert.equal(first.headers.get('cache-control'), 'public, max-age=31536000, immutable');
  assert.equal(first.headers.get('accept-ranges'), 'bytes');
  const [, id] = /^<\/v1\/supermeshes\/([0-9a-f]{64})>; rel="describedby"$/.exec(first.headers.get('link'));
  const etag = first.headers.get('etag');
  assert.match(etag, /^"[0-9a-f]{32}"$/);
  assert.equal((await d.get('/v1/jobs')).json.jobs.length, 1);

  // The same bytes and ETag as the asset of the supermesh that it names.
  const asset = await d.get(`/v1/supermeshes/${id}/asset.glb`);
  assert.ok(asset.bytes.equals(first.bytes));
  assert.equal(asset.headers.get('etag'), etag);

  for (let i = 0; i < 3; i++) {
    const again = await d.get(url);
    assert.ok(again.status === 200 && again.bytes.equals(first.bytes));
  }
  assert.equal((await d.get('/v1/jobs')).json.jobs.length, 1, 'it is computed once');
  const head = await d.request('HEAD', url);
  assert.deepEqual(
    [head.status, head.bytes.length, head.headers.get('content-length')],
    [200, 0, String(first.bytes.length)],
  );
  const part = await d.get(url, { headers: { range: 'bytes=0-3' } });
  assert.deepEqual([part.status, part.bytes.toString()], [206, 'glTF']);
  assert.equal((await d.get(url, { headers: { 'if-none-match': etag } })).status, 304);
  assertProblem(await d.get(url, { headers: { range: `bytes=${first.bytes.length}-` } }), 416, 'range-not-satisfiable');
});

test('every parameter is the member that POST has', async (t) => {
  const d = await daemon(t);
  const ids = await animals(d);
  const [a, b] = ids.split(',');
  const { id } = (await d.post('/v1/landmarks', landmarks)).json;
  const both = [{ mesh: a }, { mesh: b }];
  const tolerance = 0.05;
  for (const [query, body] of [
    ['names=x,y', { shapes: both.map((s, i) => ({ ...s, name: 'xy'[i] })) }],
    [
      `names=${encodeURIComponent('Hund & Kätzchen')},y+z`,
      {
        shapes: [
          { mesh: a, name: 'Hund & Kätzchen' },
          { mesh: b, name: 'y z' },
        ],
      },
    ],
    ['landmarks=auto&align=rotate', { landmarks: 'auto', align: { method: 'rotate' } }],
    [`landmarks=${id}`, { landmarks: landmarks.landmarks }],
    [`landmarks=${id}&align=rbf`, { landmarks: landmarks.landmarks, align: { method: 'rbf' } }],
    ['align=rotate', { align: { method: 'rotate' } }],
    ['preset=fast', { embedding: { options: { preset: 'fast' } } }],
    ['remesh=subdivision', { remesh: { method: 'subdivision', tolerance } }],
    ['max_triangles=2000', { remesh: { max_triangles: 2000, tolerance } }],
    ['fit=similarity&path=rigid', { asset: { fit: 'similarity', path: 'rigid' } }],
    ['fit=auto', {}],
    ['animation=none&normals=false', { asset: { animation: 'none', normals: false } }],
    ['normals=true', { asset: { normals: true } }],
  ]) {
    // Without landmarks a search for correspondences would begin, which takes long.
    const free = /landmarks|align/.test(query);
    const align = free ? {} : { align: { method: 'rotate' } };
    const wanted = await d.made('/v1/supermeshes', { shapes: both, remesh: { tolerance }, ...align, ...body });
    const reply = await d.get(`${free ? plain(ids) : small(ids)}&${query}`);
    assert.equal(reply.status, 200, `${query}: ${reply.bytes.subarray(0, 300)}`);
    assert.ok(reply.headers.get('link').includes(wanted.id), query);
  }
});

test('what other shapes have comes by URL, too', async (t) => {
  const d = await daemon(t);
  const egg = (await d.upload(shapes.obj(shapes.egg(2)), { name: 'egg' })).json.id;
  const body = (await d.upload(rigged().bytes, { name: 'body', repair: 'largest_component' })).json.id;
  const both = [{ mesh: egg }, { mesh: body }];
  const request = { shapes: both, remesh: { tolerance: 0.05 }, align: { method: 'rotate' } };
  const transfer = ['skin', 'targets', 'texcoord'].map((what) => ({ from: 1, what }));
  const wanted = await d.made('/v1/supermeshes', { ...request, transfer });
  const url = small(`${egg},${body}`);
  const reply = await d.get(`${url}&transfer=1:skin,1:targets,1:texcoord`);
  assert.equal(reply.status, 200, reply.bytes.toString());
  assert.ok(reply.headers.get('link').includes(wanted.id));
  const { gltf } = parseGlb(reply.bytes);
  assert.equal(gltf.skins[0].joints.length, 20);
  assert.deepEqual(gltf.meshes[0].extras.targetNames, ['body', 'smile']);
  for (const list of ['', '1', 'skin', '1:', ':skin', '2:skin', '1:bones', '1:skin:64', '1:texture:8', '1:texture:'])
    assertProblem(await d.get(`${url}&transfer=${list}`), 422, 'invalid-request', list);
  for (const list of ['1:texture:1e3', '1:texture:64:64', '-1:color', '1:skin,', '1:skin,1:skin', '1:skin,0:skin'])
    assertProblem(await d.get(`${url}&transfer=${list}`), 422, 'invalid-request', list);
  const many = Array(65).fill('1:color');
  assertProblem(await d.get(`${url}&transfer=${many}`), 422, 'invalid-request');
});

test('an invalid recipe is refused', async (t) => {
  const d = await daemon(t);
  const ids = await pair(d);
  const [a, b] = ids.split(',');
  const none = '0'.repeat(64);
  for (const [query, status, type, member] of [
    ['', 400, 'bad-query', 'shapes'],
    ['shapes=', 400, 'bad-query'],
    [`shapes=${a}`, 400, 'bad-query'],
    [`shapes=${Array(17).fill(a)}`, 400, 'bad-query'],
    [`shapes=${ids}&names=x`, 400, 'bad-query', 'names'],
    [`shapes=${ids}&names=x,y,z`, 400, 'bad-query', 'names'],
    [`shapes=${ids}&tolerence=1`, 400, 'bad-query', 'tolerence'],
    [`shapes=${ids}&shapes=${ids}`, 400, 'bad-query', 'shapes'],
    [`shapes=${ids}&wait=soon`, 400, 'bad-query'],
    [`shapes=${a},${none}`, 404, 'not-found'],
    [`shapes=${a},dog`, 404, 'not-found'],
    [`shapes=${ids}&landmarks=${none}`, 404, 'not-found'],
    [`shapes=${ids}&align=pin`, 422, 'bad-landmarks'],
    [`shapes=${ids}&align=glue`, 422, 'bad-option', 'method'],
    [`shapes=${ids}&tolerance=0`, 422, 'bad-option', 'tolerance'],
    [`shapes=${ids}&tolerance=0x1`, 422, 'bad-option', 'tolerance'],
    [`shapes=${ids}&tolerance=inf`, 422, 'bad-option', 'tolerance'],
    [`shapes=${ids}&tolerance=`, 422, 'bad-option', 'tolerance'],
    [`shapes=${ids}&max_triangles=2.5`, 422, 'bad-option', 'max_triangles'],
    [`shapes=${ids}&normals=yes`, 422, 'bad-option', 'normals'],
  ]) {
    const reply = await d.get(`/v1/morph.glb?${query}`);
    assertProblem(reply, status, type, query);
    if (member) assert.equal(reply.json.parameter ?? reply.json.member, member, query);
  }
  assert.equal((await d.get('/v1/jobs')).json.jobs.length, 0);
  assert.equal(b.length, 64);
});

test('a morph that takes longer is requested again', async (t) => {
  const d = await daemon(t, { args: ['--workers', '1'] });
  const url = small(await pair(d));
  const { id } = (await d.upload(shapes.obj(shapes.egg(5)))).json;
  const other = (await d.post('/v1/embeddings', { mesh: id, ...endless })).json;
  const began = Date.now();
  const early = await d.get(`${url}&wait=1`);
  assertProblem(early, 503, 'not-ready');
  assert.ok(Date.now() - began >= 900);
  assert.ok(Number(early.headers.get('retry-after')) > 0);
  assert.equal(early.headers.get('cache-control'), 'no-store');
  assert.match(early.json.url, /^\/v1\/jobs\/[0-9a-f]{32}$/);
  assert.equal((await d.get(`${url}&wait=0`)).json.url, early.json.url, 'the same job');
  const waiting = Promise.all([d.get(url), d.get(url), d.request('HEAD', url)]);
  await d.delete(other.url);
  for (const reply of await waiting) assert.equal(reply.status, 200);
  assert.equal((await d.get(early.json.url)).json.state, 'succeeded');
});

test('the problem of the job is the answer, and a recipe that fails is not computed again at once', async (t) => {
  const d = await daemon(t);
  const ids = await animals(d);
  const place = (i) => ({ vertex: i });
  const contradiction = [{ at: [place(100), place(100)] }, { at: [place(100), place(600)] }];
  const { id } = (await d.post('/v1/landmarks', contradiction)).json;
  const url = `${plain(ids)}&landmarks=${id}`;
  const first = await d.get(url);
  assertProblem(first, 422, 'bad-landmarks');
  assert.deepEqual(first.json.landmarks, [0, 1]);
  const jobs = (await d.get('/v1/jobs')).json.jobs.length;
  assertProblem(await d.get(url), 422, 'bad-landmarks');
  assert.equal((await d.get('/v1/jobs')).json.jobs.length, jobs);
  // A cancelled job says so, and the next request starts another job.
  const slow = await d.get(`${small(ids)}&preset=quality&wait=0`);
  if (slow.status === 503) {
    await d.delete(slow.json.url);
    await d.ended((await d.get(slow.json.url)).json);
  }
  assert.equal((await d.get(`${small(ids)}&preset=quality`)).status, 200);
});

test('a recipe follows what is deleted', async (t) => {
  const d = await daemon(t);
  const ids = await pair(d);
  const url = small(ids);
  const first = await d.get(url);
  const [, id] = /supermeshes\/(\w+)/.exec(first.headers.get('link'));
  assert.equal((await d.get(url)).status, 200);
  await d.delete(`/v1/supermeshes/${id}`);
  const again = await d.get(url);
  assert.equal(again.status, 200, 'it is computed again');
  assert.ok(again.bytes.equals(first.bytes));
  await d.delete(`/v1/meshes/${ids.slice(0, 64)}`);
  assertProblem(await d.get(url), 404, 'not-found');
  // A mesh that comes back under another name gives the target another name, and so another supermesh.
  await d.upload(shapes.obj(shapes.egg(2)), { name: 'pear' });
  const renamed = await d.get(url);
  assert.equal(renamed.status, 200);
  assert.notEqual(renamed.headers.get('link'), first.headers.get('link'));
});

test('with tokens, a recipe is made for the tenant that asks', async (t) => {
  const d = await daemon(t, { args: ['--auth', 'on'] });
  assertProblem(await d.get(small(`${'0'.repeat(64)},${'1'.repeat(64)}`)), 401, 'unauthorized');
});

test('a download is named after its shapes', async (t) => {
  const d = await daemon(t);
  const url = small(await pair(d));
  const header = async (target) => (await d.get(target)).headers.get('content-disposition');
  const named = async (target) => /^inline; filename="([^"]*)"$/.exec(await header(target))[1];
  assert.equal(await named(url), 'egg-bean.glb');
  for (const [names, file] of [
    ['../../etc/passwd,x"y\\z', '_._.._etc_passwd-x_y_z.glb'],
    [`${'a'.repeat(120)},b`, `${'a'.repeat(120)}-b.glb`],
    [`${'a'.repeat(120)},${'b'.repeat(120)}`, `${'a'.repeat(120)}-${'b'.repeat(29)}.glb`],
  ])
    assert.equal(await named(`${url}&names=${encodeURIComponent(names)}`), file, names);
  // A name that ASCII cannot express is sent a second time, encoded by RFC 8187: only attr-char and %XX of UTF-8.
  for (const [names, plain, whole] of [
    ['Hund,Kätzchen', 'Hund-K_tzchen.glb', 'Hund-Kätzchen.glb'],
    ["my dog,it's 100 %", 'my_dog-it_s_100__.glb', "my dog-it's 100 %.glb"],
    ['a/b,c:d é', 'a_b-c_d__.glb', 'a_b-c_d é.glb'],
    ['犬,🦒', '_-_.glb', '犬-🦒.glb'],
    [
      `${'é'.repeat(63)},${'é'.repeat(63)}`,
      `${'_'.repeat(63)}-${'_'.repeat(11)}.glb`,
      `${'é'.repeat(63)}-${'é'.repeat(11)}.glb`,
    ],
  ]) {
    const value = await header(`${url}&names=${encodeURIComponent(names)}`);
    const [, ascii, coded] =
      /^inline; filename="([A-Za-z0-9._-]+)"; filename\*=UTF-8''((?:[A-Za-z0-9!#$&+.^_`|~-]|%[0-9A-F]{2})+)$/.exec(
        value,
      ) ?? assert.fail(value);
    assert.equal(ascii, plain);
    assert.equal(decodeURIComponent(coded), whole);
  }
  // A name that looks like the JSON around it is only a name.
  const [a, b] = /shapes=(\w+),(\w+)/.exec(url).slice(1);
  const { asset } = await d.made('/v1/supermeshes', {
    shapes: [
      { mesh: a, name: '"],"landmarks":[' },
      { mesh: b, name: '{"mesh":"' },
    ],
    align: { method: 'rotate' },
    remesh: { tolerance: 0.05 },
  });
  assert.match(await header(asset), /^inline; filename="____landmarks___-__mesh___.glb"; filename\*=/);
});
