// Meshes from a URL: POST /v1/meshes with {"url": …} is a job that downloads the file and takes it in as an upload.
import assert from 'node:assert/strict';
import test from 'node:test';
import { folder, run, runProgram } from './support/cli.mjs';
import { assertProblem, binaries, daemon, until } from './support/daemon.mjs';
import { origin } from './support/origin.mjs';
import * as shapes from './support/shapes.mjs';

// 127.0.0.2 is listed in the tests; a server on 127.0.0.1 must not be reached.
const listed = '127.0.0.2';
const allow = ['--fetch-allow', listed];
const egg = shapes.obj(shapes.egg(2));

const files = {
  '/egg.obj': (response) => response.end(egg),
  '/open.obj': (response) => response.end(shapes.obj(shapes.withoutFace(shapes.egg(1)))),
  '/text': (response) => response.end('no mesh at all'),
  '/gone': (response) => response.writeHead(404).end('no such file'),
  '/moved': (response) => response.writeHead(302, { location: '/egg.obj' }).end(),
  '/loop': (response) => response.writeHead(302, { location: '/loop' }).end(),
  '/big': (response) => response.end(Buffer.alloc(3 << 20, ' ')),
};
const serve = (t, more = {}) =>
  origin(t, (request, response) => ({ ...files, ...more })[request.url](response, request), listed);

const post = (d, body, options) => d.post('/v1/meshes', body, options);
/** The end of the job of a URL. */
async function ended(d, body) {
  const reply = await post(d, body);
  assert.equal(reply.status, 202, reply.bytes.toString());
  assert.equal(reply.headers.get('location'), reply.json.url);
  assert.equal(reply.json.kind, 'fetch');
  return d.ended(reply.json);
}
async function fails(d, url, type, status) {
  const job = await ended(d, { url });
  assert.equal(job.state, 'failed', url);
  assert.equal(job.problem.type, `/problems/${type}`, JSON.stringify(job.problem));
  assert.equal(job.problem.status, status);
  assert.equal(job.result, null);
  return job.problem;
}

test('a mesh from a URL is the mesh that an upload of the same bytes makes', async (t) => {
  const d = await daemon(t, { args: allow });
  const { url, requests } = await serve(t);
  const job = await ended(d, { url: `${url}/egg.obj`, name: 'egg', repair: 'safe' });
  assert.equal(job.state, 'succeeded', JSON.stringify(job));
  assert.equal(job.progress, 1);
  const mesh = (await d.get(job.result)).json;
  assert.equal(mesh.name, 'egg');
  const upload = await d.upload(egg, { name: 'other' });
  assert.equal(upload.status, 200, 'known');
  assert.deepEqual(upload.json, mesh);
  assert.equal((await d.get(`${mesh.url}/file`)).bytes.toString(), egg);
  assert.equal(requests.length, 1);
  assert.equal(requests[0].method, 'GET');
  for (const header of ['cookie', 'authorization', 'referer']) assert.equal(requests[0].headers[header], undefined);
  // The same through a redirect, with a wait; the tenant owns the mesh already.
  const again = await post(d, { url: `${url}/moved` }, { headers: { prefer: 'wait=60' } });
  assert.equal(again.status, 200, again.bytes.toString());
  assert.deepEqual(again.json, mesh);
  // It is a mesh like any other.
  await d.made('/v1/embeddings', { mesh: mesh.id });
  const { jobs } = (await d.get('/v1/jobs')).json;
  assert.deepEqual(
    jobs.map((j) => j.kind),
    ['embedding', 'fetch', 'fetch'],
  );
  assert.equal(jobs[2].result, job.result, 'the list knows the result');
});

test('what cannot be fetched fails with the reason', async (t) => {
  const d = await daemon(t, { args: [...allow, '--max-body', '2M', '--fetch-seconds', '2'] });
  const { url } = await serve(t, { '/never': (response) => response.write('v 0 0 0\n') });
  assert.equal((await fails(d, `${url}/gone`, 'fetch-failed', 502)).answer, 404);
  assert.match((await fails(d, `${url}/loop`, 'fetch-failed', 502)).detail, /redirects/);
  await fails(d, `${url}/big`, 'too-large', 413);
  await fails(d, `${url}/never`, 'fetch-failed', 502);
  await fails(d, `${url}/text`, 'unknown-format', 415);
  assert.equal((await fails(d, `${url}/open.obj`, 'not-closed', 422)).boundary_loops, 1);
  await fails(d, 'http://127.0.0.2:1/', 'fetch-failed', 502);
  assert.deepEqual((await d.get('/v1/meshes')).json.meshes, [], 'nothing is stored');
});

test('the problem of a job that fetched a mesh with 2,000 handles is bounded, and counts them all', async (t) => {
  const d = await daemon(t, { args: allow });
  const holed = shapes.obj(shapes.grating(40, 50));
  const { url } = await serve(t, { '/holed.obj': (response) => response.end(holed) });
  const whole = await d.upload(holed, { name: 'holed' });
  assertProblem(whole, 422, 'not-genus-zero');
  assert.equal(whole.json.loops.length, 2000);
  const problem = await fails(d, `${url}/holed.obj`, 'not-genus-zero', 422);
  assert.ok(JSON.stringify(problem).length < 33 << 10 && whole.bytes.length > 48 << 10, `${whole.bytes.length} bytes`);
  assert.deepEqual(problem.loops, whole.json.loops.slice(0, problem.loops.length));
  assert.equal(problem.loop_lengths_relative.length, problem.loops.length);
  assert.equal(problem.loops.length + problem.loops_left_out, problem.genus);
});

test('addresses that are not public are refused, also after a redirect', async (t) => {
  const secret = await origin(t);
  const port = secret.url.split(':').pop();
  const d = await daemon(t, { args: allow });
  const away = await origin(
    t,
    (request, response) => {
      response.writeHead(307, { location: decodeURIComponent(request.url.slice(1)) }).end();
    },
    listed,
  );
  for (const url of [
    secret.url,
    `http://localhost:${port}/`,
    `http://2130706433:${port}/`,
    `http://0x7f.1:${port}/`,
    `http://[::ffff:127.0.0.1]:${port}/`,
    'https://169.254.169.254/latest/meta-data/',
    'https://10.0.0.1/',
    'https://user:secret@example.org/',
    'file:///etc/passwd',
    'http://8.8.8.8/',
  ]) {
    assertProblem(await post(d, { url }), 403, 'forbidden-address', url);
    await fails(d, `${away.url}/${encodeURIComponent(url)}`, 'forbidden-address', 403);
  }
  assert.equal(secret.requests.length, 0);
  // Without --fetch-allow the listed address is not public either.
  const closed = await daemon(t);
  assertProblem(await post(closed, { url: `${away.url}/` }), 403, 'forbidden-address');
});

test('a request is read strictly', async (t) => {
  const d = await daemon(t, { args: allow });
  for (const [body, type, status] of [
    [{}, 'invalid-request', 422],
    [{ url: 7 }, 'invalid-request', 422],
    [{ url: 'no url' }, 'invalid-request', 422],
    [{ url: `https://example.org/${'a'.repeat(2048)}` }, 'invalid-request', 422],
    [{ url: 'https://example.org/', format: 'jpeg' }, 'invalid-request', 422],
    [{ url: 'https://example.org/', repair: 'magic' }, 'invalid-request', 422],
    [{ url: 'https://example.org/', name: '' }, 'invalid-request', 422],
    [{ url: 'https://example.org/', nmae: 'a' }, 'unknown-member', 422],
    [{ asset: { version: '2.0' } }, 'invalid-request', 422],
    [[], 'invalid-request', 422],
  ])
    assertProblem(await post(d, body), status, type, JSON.stringify(body));
  assertProblem(await post(d, { url: 'https://example.org/' }, { query: { name: 'a' } }), 400, 'bad-query');
  const malformed = await d.post('/v1/meshes', '{', { headers: { 'content-type': 'application/json; charset=utf-8' } });
  assertProblem(malformed, 400, 'malformed-json');
});

test('a tenant owns what it has fetched, within its quota', async (t) => {
  const d = await daemon(t, { args: [...allow, '--auth', 'on', '--fetch-seconds', '3000'] });
  const { url } = await serve(t, { '/more': (response) => response.write('# words\n'.repeat(4096)) });
  const token = async (...words) => {
    const ran = await runProgram(binaries.daemon, [
      'token',
      'add',
      ...words,
      '--scope',
      'read,write',
      '--data',
      d.data,
    ]);
    assert.equal(ran.code, 0, ran.err);
    return { authorization: `Bearer ${ran.out.trim()}` };
  };
  const [ann, bob] = [await token('ann'), await token('bob', '--quota', '100')];
  const end = async (headers, file = 'egg.obj') => {
    const { json } = await post(d, { url: `${url}/${file}` }, { headers });
    let job = json;
    while (job.finished === null) job = (await d.get(job.url, { query: { wait: 20 }, headers })).json;
    return job;
  };
  const made = await end(ann);
  assert.equal(made.state, 'succeeded');
  assertProblem(await d.get(made.url, { headers: bob }), 404, 'not-found');
  assertProblem(await d.get(made.result, { headers: bob }), 404, 'not-found');
  const refused = await end(bob);
  assert.equal(refused.problem.type, '/problems/quota-exceeded');
  const stalls = await end(bob, 'more');
  assert.equal(stalls.problem.type, '/problems/quota-exceeded', 'before the download ends');
  assert.equal(stalls.problem.quota, 100);
  assertProblem(await d.get(made.result, { headers: bob }), 404, 'not-found');
  assert.equal((await d.get(made.result, { headers: ann })).status, 200);
  assertProblem(await post(d, { url: `${url}/egg.obj` }), 401, 'unauthorized');
});

test('a download can be cancelled, delays no other job, and survives kill -9', async (t) => {
  let patient = false;
  const { url, requests } = await serve(t, {
    '/late': (response) => (patient ? response.end(egg) : response.write('v 0 0 0\n')),
  });
  const d = await daemon(t, { args: [...allow, '--workers', '1', '--fetch-seconds', '3000'] });
  const late = [];
  for (let i = 0; i < 6; i++) late.push((await post(d, { url: `${url}/late`, name: `n${i}` })).json);
  await until(() => requests.length === 4, 'four downloads'); // as many as one tenant may have
  assert.equal((await d.get(late[0].url)).json.state, 'running');
  assert.equal((await d.get(late[5].url)).json.state, 'queued');
  const mesh = (await d.upload(egg)).json;
  await d.made('/v1/embeddings', { mesh: mesh.id });
  const cancelled = await d.delete(late[0].url);
  assert.equal(cancelled.json.state, 'cancelled', cancelled.bytes.toString());
  await until(() => requests.length === 5, 'the next one begins');
  d.killed = true;
  await d.stop('SIGKILL');
  patient = true;
  await d.start();
  for (const job of late.slice(1)) {
    const end = await d.ended((await d.get(job.url)).json);
    assert.equal(end.state, 'succeeded', JSON.stringify(end));
    assert.equal(end.result, mesh.url);
    assert.equal(end.attempt, 1, 'the download does not count as a crash');
  }
  assert.equal((await d.get(late[0].url)).json.state, 'cancelled');
});

test('a stop does not wait for a server that does not answer', async (t) => {
  const { url, requests } = await serve(t, { '/never': () => {} });
  const d = await daemon(t, { args: [...allow, '--drain-seconds', '1', '--fetch-seconds', '3000'] });
  const job = (await post(d, { url: `${url}/never` })).json;
  await until(() => requests.length === 1, 'the download begins');
  const began = Date.now();
  assert.equal((await d.stop()).code, 0);
  assert.ok(Date.now() - began < 10_000, `${Date.now() - began} ms`);
  await d.start();
  assert.notEqual((await d.get(job.url)).json.state, 'failed');
});

test('the command line takes URLs where it takes files', async (t) => {
  const d = await daemon(t, { args: allow });
  const { url, requests } = await serve(t);
  const env = { ORBMORPH_SERVER: d.url };
  const cwd = await folder(t);
  const uploaded = await run(['upload', `${url}/egg.obj`, '--name', 'ovum', '--json'], { env, cwd });
  assert.equal(uploaded.code, 0, uploaded.err);
  const mesh = JSON.parse(uploaded.out);
  assert.equal(mesh.name, 'ovum');
  assert.deepEqual((await d.upload(egg, { name: 'ovum' })).json, mesh);
  assert.equal(requests.length, 1);
  const plain = await run(['upload', `${url}/moved`], { env, cwd });
  assert.equal(plain.code, 0, plain.err);
  assert.match(plain.out, new RegExp(mesh.id));
  const { id: other } = (await d.upload(shapes.obj(shapes.egg(3)), { name: 'long' })).json;
  const merged = await run(['merge', `${url}/egg.obj`, other, '-o', 'out.glb', '--json'], { env, cwd });
  assert.equal(merged.code, 0, merged.err);
  assert.deepEqual(
    JSON.parse(merged.out).shapes.map((shape) => shape.mesh),
    [mesh.id, other],
  );
  const closed = await run(['upload', `${url}/open.obj`], { env, cwd });
  assert.equal(closed.code, 1, closed.out);
  assert.match(closed.err, /not closed/i);
  const refused = await run(['upload', 'http://127.0.0.1:9/egg.obj'], { env, cwd });
  assert.equal(refused.code, 1);
  assert.match(refused.err, /forbidden-address|address/);
  // doctor deletes its uploads, and accepts only files.
  assert.equal((await run(['doctor', `${url}/egg.obj`], { env, cwd })).code, 2);
});
