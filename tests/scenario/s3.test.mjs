// Objects in S3: what the daemon refuses at its start, what it keeps in its cache, and what happens when S3 goes away.
// Runs under tests/tools/with_s3.sh. The other scenarios run there in the same way as with files.
import assert from 'node:assert/strict';
import { execFileSync, spawnSync } from 'node:child_process';
import { existsSync } from 'node:fs';
import { mkdir, mkdtemp, readdir, readFile, rm } from 'node:fs/promises';
import { tmpdir } from 'node:os';
import path from 'node:path';
import test from 'node:test';
import { list, s3 } from '../tools/s3.mjs';
import { runProgram } from './support/cli.mjs';
import { assertProblem, Daemon, daemon, root, samples, until } from './support/daemon.mjs';
import { workers } from './support/processes.mjs';
import { apart, busy, denied, flipped, half, late, lost, s3Proxy, short } from './support/s3_proxy.mjs';
import { bean, egg, obj, tetrahedron } from './support/shapes.mjs';

const server = process.env.ORB_S3;
const program = process.env.ORB_DAEMON; // starts a daemon with objects in files
assert.ok(server && program, 'to be run by tests/tools/with_s3.sh');
let pid = Number(process.env.ORB_S3_PID);

const at = (bucket) => `s3://${bucket}?endpoint=${server}`;

async function folder(t) {
  const data = await mkdtemp(path.join(tmpdir(), 'orbmorph-test-'));
  t.after(() => rm(data, { recursive: true, force: true }));
  return data;
}

const start = (data, args, env = {}) =>
  spawnSync(program, ['--listen', '127.0.0.1:0', '--data', data, '--log-format', 'text', ...args], {
    encoding: 'utf8',
    timeout: 60_000,
    env: { ...process.env, ...env },
  });

function refused(result, why) {
  assert.equal(result.status, 78, result.stderr);
  assert.match(result.stderr, why);
  assert.equal(result.stdout, '');
}

/** A daemon whose objects are in a bucket with this prefix, and a function that empties its cache. */
async function stored(t, prefix, ...args) {
  const d = await daemon(t, { args: ['--objects', at(`objects/${prefix}`), ...args] });
  const empty = () => rm(path.join(d.data, 'cache'), { recursive: true }).then(() => mkdir(path.join(d.data, 'cache')));
  return { d, empty };
}

/** The same behind a proxy that answers as `decide` says. */
async function troubled(t, prefix, decide) {
  const proxy = await s3Proxy(t, server, decide);
  // The scrub also reads objects: `decide` would act on its requests instead of the test's own.
  const args = ['--scrub-rate', '0', '--objects', `s3://objects/${prefix}?endpoint=${proxy.url}&part_mib=5`];
  const d = await daemon(t, { args });
  const empty = () => rm(path.join(d.data, 'cache'), { recursive: true }).then(() => mkdir(path.join(d.data, 'cache')));
  return { d, empty, proxy };
}

const keyOf = async (prefix, kind, id) => {
  const keys = await list(server, 'objects', `${prefix}/${kind}/`);
  return keys.find((key) => key.endsWith(id));
};

test('a missing bucket, wrong keys and a bucket of others are refused, and nothing is written', async (t) => {
  const data = await folder(t);
  refused(start(data, ['--objects', at('nowhere')]), /bucket nowhere does not exist/);
  refused(
    start(data, ['--objects', at('objects/new')], { AWS_SECRET_ACCESS_KEY: 'wrong-secret' }),
    /refuses.*SignatureDoesNotMatch/,
  );
  refused(start(data, ['--objects', at('objects/new')], { AWS_ACCESS_KEY_ID: 'other:nobody' }), /refuses/);
  refused(start(data, ['--objects', at('objects/new')], { AWS_ACCESS_KEY_ID: '' }), /set AWS_ACCESS_KEY_ID/);
  for (const url of ['s3://x', 'http://a', 's3://bucket?endpoint=ftp://x', 's3://bucket?colour=red']) {
    assert.equal(start(data, ['--objects', url]).status, 2, url);
  }
  const { d } = await stored(t, 'owned');
  assert.equal((await d.upload(tetrahedron)).status, 201);
  refused(start(data, ['--objects', at('objects/owned')]), /belongs to another deployment/);
  assert.ok(!existsSync(path.join(data, 'catalogue.sqlite')));
  assert.deepEqual(await list(server, 'objects', 'new'), []);
  await d.stop();
  refused(start(d.data, []), /are in S3: name their bucket/);
  refused(start(d.data, ['--objects', at('objects/new')]), /none of the objects/);
  for (const command of ['backup', 'restore']) {
    const copy = spawnSync(program, [command, data, '--data', d.data], { encoding: 'utf8' });
    assert.equal(copy.status, 2);
    assert.match(copy.stderr, /versions in the bucket/);
  }
  assert.deepEqual(await list(server, 'objects', 'new'), []);

  const files = await new Daemon(await folder(t), [], {});
  files.program = [program];
  await files.start();
  assert.equal((await files.upload(tetrahedron)).status, 201);
  await files.stop();
  refused(start(files.data, ['--objects', at('objects/new')]), /are files: start without --objects/);
});

test('keys that may read but not write are refused, and nothing is written', async (t) => {
  const data = await folder(t);
  const reads = ({ method }) => (['GET', 'HEAD'].includes(method) ? undefined : denied);
  const proxy = await s3Proxy(t, server, reads);
  const objects = (prefix) => ['--objects', `s3://objects/${prefix}?endpoint=${proxy.url}`];
  const run = (...args) => runProgram(program, ['--listen', '127.0.0.1:0', ...args, '--log-format', 'text']);
  const first = await run('--data', data, ...objects('unwritten'));
  assert.equal(first.code, 78, first.err);
  assert.match(first.err, /refuses to write to the bucket objects: it answered 403 AccessDenied/);
  assert.deepEqual(await list(server, 'objects', 'unwritten'), []);
  assert.ok(!existsSync(path.join(data, 'catalogue.sqlite')));
  // Also where the bucket is this deployment's already, and its keys have been replaced.
  const { d } = await stored(t, 'replaced');
  await d.stop();
  const later = await run('--data', d.data, ...objects('replaced'));
  assert.equal(later.code, 78, later.err);
  proxy.decide = () => undefined;
  assert.equal(await (await s3(server, 'GET', 'objects?uploads=')).text().then((text) => /<Upload>/.test(text)), false);
});

test('what was stored is served after the cache was emptied, whole and in ranges', async (t) => {
  const { d, empty } = await stored(t, 'served');
  const { id } = await d.mesh(path.join(samples, 'dog.obj'));
  const embedding = await d.made('/v1/embeddings', { mesh: id });
  const sphere = `/v1/embeddings/${embedding.id}/sphere.ply`;
  const first = await d.get(sphere);
  assert.equal(first.status, 200);
  assert.ok(await keyOf('served', 'mesh', id));
  assert.ok(await keyOf('served', 'sphere', embedding.id));
  await d.stop();
  await empty();
  await d.start();
  assert.ok((await d.get(sphere)).bytes.equals(first.bytes));
  const part = await d.get(sphere, { headers: { range: 'bytes=100-199' } });
  assert.equal(part.status, 206);
  assert.ok(part.bytes.equals(first.bytes.subarray(100, 200)));
  await empty(); // also while the daemon runs
  assert.ok((await d.get(sphere)).bytes.equals(first.bytes));
  assert.equal((await d.delete(`/v1/embeddings/${embedding.id}`)).status, 204);
  assert.equal(await keyOf('served', 'sphere', embedding.id), undefined);
  await d.stop();
  const check = spawnSync(program, ['--check-data', '--data', d.data, '--objects', at('objects/served')], {
    encoding: 'utf8',
  });
  assert.equal(check.status, 0, check.stdout + check.stderr);
  assert.match(check.stdout, /1 rows and 1 objects checked: 0 wrong, 0 objects without a row/);
});

test('places and spheres of a supermesh are one object, and those that are two are served as well', async (t) => {
  const { d, empty } = await stored(t, 'joined');
  const shapes = [];
  for (const shape of [egg(2), bean(2)]) shapes.push({ mesh: (await d.upload(obj(shape))).json.id });
  const request = { shapes, align: { method: 'rotate' } };
  const { id } = await d.made('/v1/supermeshes', request);
  const url = `/v1/supermeshes/${id}`;
  const served = async () => {
    const files = {};
    for (const part of ['asset.glb', 'places', 'spheres/0.ply', 'spheres/1.ply']) {
      const reply = await d.get(`${url}/${part}`);
      assert.equal(reply.status, 200, `${part}: ${reply.bytes}`);
      files[part] = [reply.bytes, reply.headers.get('etag'), reply.headers.get('content-disposition')];
    }
    return files;
  };
  const joined = await served();
  assert.equal((await list(server, 'objects', 'joined/places/')).length, 0);
  assert.equal((await list(server, 'objects', 'joined/spheres/')).length, 1);
  const places = joined.places[0];
  const part = await d.get(`${url}/places`, { headers: { range: 'bytes=4-19', 'accept-encoding': 'zstd' } });
  assert.equal(part.status, 206);
  assert.ok(part.bytes.equals(places.subarray(4, 20)));
  assert.equal(part.headers.get('content-range'), `bytes 4-19/${places.length}`);
  assert.equal((await d.get(`${url}/places`, { headers: { 'if-none-match': joined.places[1] } })).status, 304);
  assertProblem(await d.get(`${url}/spheres/2.ply`), 404, 'not-found');
  await d.stop();
  await empty();

  // A daemon with files makes the same bytes, places as an object of its own; a bucket may have such pairs.
  const files = await daemon(t, { program: [program] });
  for (const shape of [egg(2), bean(2)]) await files.upload(obj(shape));
  assert.equal((await files.made('/v1/supermeshes', request)).id, id);
  const kind = (name) => readFile(path.join(files.data, 'objects', name, id.slice(0, 2), id));
  assert.ok((await kind('places')).equals(places));
  assert.ok((await files.get(`${url}/places`)).bytes.equals(places));
  const { createHash } = await import('node:crypto');
  for (const name of ['places', 'spheres']) {
    const bytes = await kind(name);
    const meta = { sha256: createHash('sha256').update(bytes).digest('hex') };
    assert.ok((await s3(server, 'PUT', `objects/joined/${name}/${id.slice(0, 2)}/${id}`, bytes, meta)).ok);
  }
  const sha = createHash('sha256').update(places).digest('hex');
  execFileSync('sqlite3', [path.join(d.data, 'catalogue.sqlite'), `UPDATE resource SET places='${sha}' WHERE kind=2`]);
  await d.start();
  assert.deepEqual(await served(), joined);
  await d.stop();
  const check = spawnSync(program, ['--check-data', '--data', d.data, '--objects', at('objects/joined')], {
    encoding: 'utf8',
  });
  assert.match(check.stdout, /: 0 wrong, 0 objects without a row/, check.stdout + check.stderr);
  await d.start();
  assert.equal((await d.delete(url)).status, 204);
  for (const name of ['asset', 'places', 'spheres'])
    assert.equal((await list(server, 'objects', `joined/${name}/`)).length, 0, name);
});

test('a damaged object in the bucket is found, and made again', async (t) => {
  const { d, empty } = await stored(t, 'damaged');
  const { id } = await d.mesh(path.join(samples, 'dog.obj'));
  const request = { mesh: id };
  const embedding = await d.made('/v1/embeddings', request);
  const sphere = `/v1/embeddings/${embedding.id}/sphere.ply`;
  const { bytes } = await d.get(sphere);
  const key = await keyOf('damaged', 'sphere', embedding.id);
  // The object changes as on a damaged disk of S3: the hash beside it stays.
  const meta = { sha256: (await s3(server, 'GET', `objects/${key}`)).headers.get('x-amz-meta-sha256') };
  assert.match(meta.sha256, /^[0-9a-f]{64}$/);
  const altered = Buffer.from(bytes);
  altered[altered.length >> 1] ^= 1;
  assert.ok((await s3(server, 'PUT', `objects/${key}`, altered, meta)).ok);
  assert.ok((await d.get(sphere)).bytes.equals(bytes)); // from the cache
  await empty();
  assert.notEqual((await d.get(sphere)).status, 200);
  assert.match(d.log, /object in S3 does not match its hash/);
  assert.equal((await readdir(path.join(d.data, 'quarantine'))).length, 1);
  await until(async () => (await d.get(`/v1/embeddings/${embedding.id}`)).status === 404, 'the row is deleted');
  await d.made('/v1/embeddings', request);
  assert.ok((await d.get(sphere)).bytes.equals(bytes));

  // The object changes as by an attacker who can write to the bucket: with the hash of the wrong bytes.
  await d.stop();
  await empty();
  const { createHash } = await import('node:crypto');
  const wrong = { sha256: createHash('sha256').update(altered).digest('hex') };
  assert.ok((await s3(server, 'PUT', `objects/${key}`, altered, wrong)).ok);
  await d.start();
  assert.notEqual((await d.get(sphere)).status, 200);
  await until(async () => (await d.get(`/v1/embeddings/${embedding.id}`)).status === 404, 'the row is deleted');
});

test('an object without its hash is not served, and stays: something else may answer in the place of S3', async (t) => {
  const { d, empty } = await stored(t, 'bare');
  const { id } = (await d.upload(tetrahedron)).json;
  const key = await keyOf('bare', 'mesh', id);
  const whole = await (await s3(server, 'GET', `objects/${key}`)).text();
  assert.ok((await s3(server, 'PUT', `objects/${key}`, '<html>Come back later</html>')).ok);
  await empty();
  assertProblem(await d.get(`/v1/meshes/${id}/file`), 500, 'internal');
  assert.match(d.log, /without its hash/);
  assert.equal(await keyOf('bare', 'mesh', id), key);
  const meta = { sha256: (await import('node:crypto')).createHash('sha256').update(whole).digest('hex') };
  assert.ok((await s3(server, 'PUT', `objects/${key}`, whole, meta)).ok);
  assert.equal((await d.get(`/v1/meshes/${id}/file`)).bytes.toString(), whole);
});

test('while S3 is unreachable, requests get 503, the cache is served and jobs wait', async (t) => {
  const { d, empty } = await stored(t, 'away');
  const dog = await d.mesh(path.join(samples, 'dog.obj'));
  const embedding = await d.made('/v1/embeddings', { mesh: dog.id });
  const sphere = `/v1/embeddings/${embedding.id}/sphere.ply`;
  const { bytes } = await d.get(sphere);
  process.kill(pid, 'SIGKILL');
  const reply = await d.upload(tetrahedron);
  assertProblem(reply, 503, 'unavailable');
  assert.ok(Number(reply.headers.get('retry-after')) > 0);
  const ready = await d.get('/readyz');
  assertProblem(ready, 503, 'unavailable');
  assert.match(ready.json.detail, /S3/);
  assert.ok((await d.get(sphere)).bytes.equals(bytes));
  const job = await d.post('/v1/embeddings', { mesh: dog.id, method: 'kernel-sampling' });
  assert.equal(job.status, 202);
  await empty();
  const lost = await d.get(sphere);
  assertProblem(lost, 503, 'unavailable');

  pid = Number(execFileSync(process.env.ORB_S3_START, { encoding: 'utf8' }));
  await until(async () => (await d.get('/readyz')).status === 200, 'S3 is back', 60);
  assert.match(d.log, /S3 is back/);
  assert.ok((await d.get(sphere)).bytes.equals(bytes));
  assert.equal((await d.upload(tetrahedron)).status, 201);
  await until(async () => (await d.get(`/v1/jobs/${job.json.id}`)).json.state === 'succeeded', 'the job ends');
});

/** The document describes the redirect, with its headers. */
async function documented(reply, target) {
  const document = JSON.parse(await readFile(path.join(root, 'api/openapi.json'), 'utf8'));
  const { $ref } = document.paths[target].get.responses[reply.status];
  const { headers, content } = document.components.responses[$ref.split('/').pop()];
  assert.equal(content, undefined);
  assert.equal((await reply.arrayBuffer()).byteLength, 0);
  const plain = /^(date|connection|content-length|keep-alive|x-content-type-options)$/;
  const names = Object.keys(headers).map((name) => name.toLowerCase());
  for (const [name] of reply.headers) assert.ok(plain.test(name) || names.includes(name), `${target}: ${name}`);
  for (const name of ['location', 'cache-control', 'x-request-id']) assert.ok(reply.headers.has(name), name);
}

test('assets=redirect sends the caller to S3', async (t) => {
  const { d } = await stored(t, 'redirect', '--assets', 'redirect');
  const shapes = [];
  for (const name of ['dog.obj', 'giraffe.off']) shapes.push({ mesh: (await d.mesh(path.join(samples, name))).id });
  const { id } = await d.made('/v1/supermeshes', { shapes });
  const asset = new URL(`/v1/supermeshes/${id}/asset.glb`, d.url);
  const reply = await fetch(asset, { redirect: 'manual' });
  assert.equal(reply.status, 307);
  await documented(reply, '/v1/supermeshes/{id}/asset.glb');
  const morph = new URL('/v1/morph.glb', d.url);
  morph.searchParams.set('shapes', shapes.map(({ mesh }) => mesh).join(','));
  const same = await fetch(morph, { redirect: 'manual' });
  assert.equal(same.status, 307);
  await documented(same, '/v1/morph.glb');
  const to = reply.headers.get('location');
  assert.equal(new URL(same.headers.get('location')).pathname, new URL(to).pathname);
  assert.ok(to.startsWith(`${server}/objects/redirect/asset/`));
  const bytes = await fetch(to);
  assert.equal(bytes.status, 200);
  assert.equal(bytes.headers.get('content-type'), 'model/gltf-binary');
  assert.equal(
    Buffer.from(await bytes.arrayBuffer())
      .subarray(0, 4)
      .toString(),
    'glTF',
  );
  assert.equal((await fetch(to.replace(/Signature=../, 'Signature=00'))).status, 403);
});

test('the cache stays within its bound', async (t) => {
  const { d } = await stored(t, 'bound', '--cache-bytes', '1M');
  const most = 1 << 20;
  for (let i = 0; i < 8; i++) {
    assert.equal((await d.upload(Buffer.from(`# ${i}${' '.repeat(300_000)}\n${tetrahedron}`))).status, 201);
  }
  let bytes = 0;
  for (const entry of await readdir(path.join(d.data, 'cache'), { recursive: true, withFileTypes: true })) {
    if (entry.isFile())
      bytes += (await import('node:fs')).statSync(path.join(entry.parentPath ?? entry.path, entry.name)).size;
  }
  assert.ok(bytes > 300_000 && bytes <= most, `${bytes}`);
  assert.equal((await list(server, 'objects', 'bound/mesh/')).length, 8);
});

test('each request that fails is tried again: 503, lost answers, half a body, wrong bytes', async (t) => {
  // Each request fails three times in a row, each time in a different way.
  const ways = { GET: [half, busy, late], PUT: [busy, lost, late], HEAD: [lost, busy, late], DELETE: [lost] };
  const { d, empty, proxy } = await troubled(t, 'troubled', ({ method, path, tries }) =>
    path.endsWith('orbmorph-owner') ? undefined : ways[method]?.[tries - 1],
  );
  const dog = await d.mesh(path.join(samples, 'dog.obj'));
  const embedding = await d.made('/v1/embeddings', { mesh: dog.id });
  const sphere = `/v1/embeddings/${embedding.id}/sphere.ply`;
  const { bytes } = await d.get(sphere);
  await empty();
  assert.ok((await d.get(sphere)).bytes.equals(bytes));
  assert.equal((await d.delete(`/v1/embeddings/${embedding.id}`)).status, 204);
  assert.equal(await keyOf('troubled', 'sphere', embedding.id), undefined);
  for (const way of [busy, lost, half])
    assert.ok(
      proxy.seen.some(({ how }) => how === way),
      way,
    );
  assert.doesNotMatch(d.log, /S3 is unreachable/);

  // Bytes that are damaged only in transit: the daemon reads them again, and the object stays.
  for (const way of [short, flipped]) {
    const name = way === short ? 'one' : 'two';
    const { id } = (await d.upload(Buffer.from(`${tetrahedron}# ${name}\n`))).json;
    await empty();
    let wrong = 0;
    proxy.decide = ({ method }) => (method === 'GET' && wrong++ < 2 ? way : undefined);
    assert.equal((await d.get(`/v1/meshes/${id}/file`)).bytes.toString(), `${tetrahedron}# ${name}\n`);
    assert.ok(wrong >= 3);
    assert.ok(await keyOf('troubled', 'mesh', id));
  }
  assert.ok(!existsSync(path.join(d.data, 'quarantine')));
});

test('S3 that sends headers and body apart does not wait for the acknowledgement of the first', async (t) => {
  const { d, empty, proxy } = await troubled(t, 'apart', ({ method }) => (method === 'GET' ? apart : undefined));
  const urls = [];
  for (let i = 0; i < 40; i++)
    urls.push((await d.upload(Buffer.from(`# ${i}${' '.repeat(600)}\n${tetrahedron}`))).json.url);
  // Linux delays an acknowledgement by 40 ms at least, and that of the first packets of a connection not at all. A busy
  // machine may run the daemon as late without that, so there are several rounds. A connection that opens anew makes
  // one answer fast, so one is not enough.
  const fast = () => proxy.waits.slice(20).filter((ms) => ms < 35).length;
  for (let round = 0; round < 10 && fast() < 3; round++) {
    await empty();
    proxy.waits.length = 0;
    for (const url of urls) assert.equal((await d.get(`${url}/file`)).status, 200);
  }
  assert.ok(fast() >= 3, `${proxy.waits.map((ms) => ms.toFixed(0))} ms`);
});

test('a job that could not read its input runs again, also if S3 is back before it has failed', async (t) => {
  const { d, empty, proxy } = await troubled(t, 'back', () => undefined);
  const shapes = [];
  for (const name of ['dog.obj', 'giraffe.off']) shapes.push({ mesh: (await d.mesh(path.join(samples, name))).id });
  for (const { mesh } of shapes) await d.made('/v1/embeddings', { mesh });
  await empty();
  await until(() => workers(d).length === 0, 'the processes that checked the files end', 20);
  let stopped;
  let fails = 4; // as often as the daemon tries
  proxy.decide = ({ method, path: at }) => {
    if (method !== 'GET' || !/sphere/.test(at) || !fails) return;
    fails--;
    if (!stopped) [stopped] = workers(d);
    process.kill(stopped, 'SIGSTOP'); // so that it ends after S3 is back
    return busy;
  };
  const job = (await d.post('/v1/supermeshes', { shapes, align: { method: 'rotate' } })).json;
  await until(() => /S3 is back/.test(d.log), 'S3 is back', 60);
  assert.equal(fails, 0);
  process.kill(stopped, 'SIGCONT');
  const done = await d.ended(job);
  assert.equal(done.state, 'succeeded', JSON.stringify(done.problem));
});

test('a large object goes in parts, each tried again, and is put together once', async (t) => {
  const part = 5 << 20;
  const { d, empty, proxy } = await troubled(t, 'large', ({ method, query, tries }) => {
    if (/partNumber=2/.test(query)) return tries === 1 ? busy : tries === 2 ? lost : undefined;
    return method === 'POST' && /^uploadId=/.test(query) && tries === 1 ? late : undefined; // it has assembled it
  });
  const body = Buffer.concat([Buffer.alloc(part + 1000, '# padding\n'), Buffer.from(`\n${tetrahedron}`)]);
  const reply = await d.upload(body);
  assert.equal(reply.status, 201, reply.bytes.toString());
  const parts = proxy.seen.filter(({ method, query }) => method === 'PUT' && /partNumber=/.test(query));
  assert.deepEqual(
    parts.map(({ query, how }) => [/partNumber=(\d)/.exec(query)[1], how]),
    [
      ['1', 'pass'],
      ['2', busy],
      ['2', lost],
      ['2', 'pass'],
    ],
  );
  await empty();
  assert.ok((await d.get(`/v1/meshes/${reply.json.id}/file`)).bytes.equals(body));
  assert.doesNotMatch(d.log, /S3 is unreachable/);

  // S3 that keeps failing: the upload is refused, nothing of it stays, and it works later.
  proxy.decide = ({ query }) => (/partNumber=2/.test(query) ? busy : undefined);
  const other = Buffer.concat([body, Buffer.from('# other\n')]);
  assertProblem(await d.upload(other), 503, 'unavailable');
  proxy.decide = () => undefined;
  await until(async () => (await d.get('/readyz')).status === 200, 'S3 is back', 60);
  assert.equal((await list(server, 'objects', 'large/mesh/')).length, 1);
  assert.equal((await d.upload(other)).status, 201);
  assert.equal((await list(server, 'objects', 'large/mesh/')).length, 2);
});

test('S3 that does not answer at the start is not a wrong configuration: systemd starts the daemon again', async (t) => {
  const data = await folder(t);
  const proxy = await s3Proxy(t, server, () => busy);
  for (const [endpoint, why] of [
    ['http://127.0.0.1:1', /S3 at 127\.0\.0\.1:1 does not answer: .*[Cc]onnect/],
    [proxy.url, /S3 at 127\.0\.0\.1:\d+ does not answer: it answered 503 SlowDown/],
  ]) {
    const args = ['--listen', '127.0.0.1:0', '--data', data, '--objects', `s3://objects/start?endpoint=${endpoint}`];
    const { code, out, err } = await runProgram(program, [...args, '--log-format', 'text']);
    assert.equal(code, 1, err);
    assert.match(err, why);
    assert.equal(out, '');
    assert.ok(!existsSync(path.join(data, 'catalogue.sqlite')));
  }
});
