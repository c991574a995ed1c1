// orbmorphd migrate: a deployment moves from SQLite and files to PostgreSQL and S3 and back; the move is killed on the
// way and meets damage. Runs under tests/tools/with_postgresql.sh and tests/tools/with_s3.sh.
import assert from 'node:assert/strict';
import { execFileSync, spawn } from 'node:child_process';
import { createHash } from 'node:crypto';
import { existsSync, mkdirSync, readdirSync, readFileSync, writeFileSync } from 'node:fs';
import path from 'node:path';
import test from 'node:test';
import { list, s3 } from '../tools/s3.mjs';
import { folder, runProgram } from './support/cli.mjs';
import { Daemon, endless, until } from './support/daemon.mjs';
import { busy, s3Proxy } from './support/s3_proxy.mjs';
import * as shapes from './support/shapes.mjs';

const [bucket, program] = [process.env.ORB_S3, process.env.ORB_DAEMON];
assert.ok(process.env.ORB_POSTGRESQL && bucket && program, 'to be run by with_postgresql.sh and with_s3.sh');

const run = (...args) => runProgram(program, args);
const sql = (text) =>
  execFileSync('psql', ['-X', '-qAt', '-v', 'ON_ERROR_STOP=1', '-d', process.env.ORB_POSTGRESQL, '-c', text], {
    encoding: 'utf8',
  }).trim();
const newCatalogue = (name) => execFileSync(process.env.ORB_NEW_CATALOGUE, [name], { encoding: 'utf8' });
const schema = (url) => /search_path%3D(\w+)/.exec(url)[1];
const sha256 = (bytes) => createHash('sha256').update(bytes).digest('hex');
const mesh = (k) => shapes.obj(shapes.ball(1, ([x, y, z]) => [x * (1 + 0.3 * Math.sin(5 * y + k)), 1.5 * y, z]));

/** A place for a deployment: a data folder, and the options that name the other stores. */
function place(top, name, { postgresql = false, inS3 = false } = {}) {
  const prefix = `${path.basename(top)}-${name}`;
  const where = {
    catalogue: postgresql && newCatalogue(path.join(top, name)),
    objects: inS3 && `s3://objects/${prefix}?endpoint=${bucket}`,
  };
  const set = Object.entries(where).filter(([, value]) => value);
  return {
    ...where,
    prefix,
    data: path.join(top, name),
    to: ['--data', path.join(top, name), ...set.flatMap(([option, value]) => [`--${option}`, value])],
    from: ['--from-data', path.join(top, name), ...set.flatMap(([option, value]) => [`--from-${option}`, value])],
  };
}
const migrate = (from, to) => run('migrate', ...from.from, ...to.to, '--log-format', 'text');

/** A daemon on a place. */
async function serve(t, at, ...args) {
  const d = new Daemon(at.data, [...at.to.slice(2), ...args], {});
  d.program = [program];
  t.after(() => d.stop());
  return d.start();
}

async function refused(result, why, code = 78) {
  const { out, err, code: status } = await result;
  assert.equal(status, code, out + err);
  assert.match(out + err, why);
}

/** The output of the commands that list tokens, keys and webhooks. */
async function listed(at) {
  const all = {};
  for (const what of ['token', 'key', 'webhook']) {
    const { out, err, code } = await run(what, 'list', ...at.to);
    assert.equal(code, 0, err);
    assert.match(out, /ann/, what);
    all[what] = out;
  }
  const { out, code } = await run('webhook', 'secret', '--tenant', 'ann', ...at.to); // depends on the catalogue's secret
  assert.equal(code, 0);
  return { ...all, secret: out };
}

const as = (token) => ({ headers: { authorization: `Bearer ${token}` } });

/** Everything that callers see: every list, description, file and event, by URL. Files by their hash. */
async function seen(d, tokens) {
  const all = {};
  for (const [name, token] of Object.entries(tokens)) {
    const get = async (url) => {
      const reply = await d.get(url, as(token));
      assert.equal(reply.status, 200, `${url}: ${reply.bytes}`);
      all[`${name} ${url}`] = reply.json ?? sha256(reply.bytes);
      return reply.json;
    };
    const { meshes } = await get('/v1/meshes?limit=500');
    for (const { id } of meshes) await get(`/v1/meshes/${id}/file`);
    for (const { url, sphere } of (await get('/v1/embeddings?limit=500')).embeddings) {
      await get(url);
      await get(sphere);
    }
    for (const { url, asset } of (await get('/v1/supermeshes')).supermeshes) {
      await get(url);
      for (const file of [asset, `${asset}?profile=quantized`, `${url}/places`, `${url}/spheres/1.ply`])
        await get(file);
    }
    await get(`/v1/supermeshes?mesh=${meshes.at(-1).id}`); // the rows that triggers make
    for (const { id } of (await get('/v1/jobs?limit=100')).jobs) {
      await get(`/v1/jobs/${id}`);
      await get(`/v1/jobs/${id}/events`);
    }
  }
  return all;
}

/** A deployment with two tenants, tokens, a key, webhooks and jobs that ended. */
async function fill(t, at, meshes) {
  const allow = ['--webhook-allow', '127.0.0.0/8'];
  const d = await serve(t, at, '--auth', 'on', ...allow);
  const admin = async (...args) => {
    const { out, err, code } = await run(...args, ...at.to);
    assert.equal(code, 0, err);
    return out.trim();
  };
  const tokens = {
    ann: await admin('token', 'add', 'ann', '--scope', 'read,write', '--quota', '1G', '--priority', '3'),
    bob: await admin('token', 'add', 'bob', '--scope', 'read,write'),
    all: await admin('token', 'add', 'all', '--scope', 'read,write,admin'),
  };
  await admin('key', 'add', 'page', '--tenant', 'ann');
  await admin('webhook', 'add', 'nobody', '--url', 'http://127.0.0.1:9/', '--tenant', 'ann');
  const ids = [];
  for (let k = 0; k < meshes; k++) {
    const reply = await d.post('/v1/meshes', Buffer.from(mesh(k)), {
      ...as(tokens.ann),
      query: { name: `nr ${k} é "` },
    });
    assert.equal(reply.status, 201);
    ids.push(reply.json.id);
  }
  assert.equal((await d.post('/v1/meshes', Buffer.from(mesh(0)), as(tokens.bob))).status, 201);
  const gone = (await d.post('/v1/meshes', Buffer.from(mesh(999)), as(tokens.bob))).json;
  assert.equal((await d.delete(gone.url, as(tokens.bob))).status, 204);
  const request = { shapes: [{ mesh: ids[1] }, { mesh: ids[0] }], align: { method: 'rotate' } };
  const job = await d.post('/v1/supermeshes', request, as(tokens.ann));
  assert.equal(job.status, 202);
  const end = () => d.get(job.json.url, { ...as(tokens.ann), query: { wait: 20 } });
  assert.equal((await until(async () => (await end()).json.finished && end(), 'the job ends')).json.state, 'succeeded');
  return { d, tokens, ids, admin, allow };
}

test('there and back: the same ids and bytes, also after a kill', async (t) => {
  const top = await folder(t);
  const old = place(top, 'old');
  const cluster = place(top, 'cluster', { postgresql: true, inS3: true });
  const back = place(top, 'back');
  const { d, tokens, ids, allow } = await fill(t, old, 70);
  const first = await seen(d, tokens);
  assert.ok(Object.keys(first).length > 150);
  await refused(migrate(old, cluster), /in use by another process/, 1);
  await d.stop();

  // The move is killed once the first objects exist.
  const child = spawn(program, ['migrate', ...old.from, ...cluster.to], { stdio: ['ignore', 'pipe', 'inherit'] });
  const ended = new Promise((done) => child.once('exit', (_, signal) => done(signal)));
  let printed = '';
  for await (const chunk of child.stdout) {
    printed += chunk;
    if (/objects: \d+ copied/.test(printed)) child.kill('SIGKILL');
  }
  assert.equal(await ended, 'SIGKILL', printed);
  assert.match(printed, /^copying\n/);
  await refused(run('--listen', '127.0.0.1:0', ...cluster.to), /migrate has filled .* in part: run it again/);
  const other = path.join(top, 'other'); // another node, with a folder of its own
  await refused(run('--listen', '127.0.0.1:0', ...cluster.to, '--data', other), /migrate has filled .* in part/);

  // Rows that the source deletes meanwhile do not reach the target, and changed rows change there too.
  const again = await serve(t, old, '--auth', 'on', ...allow);
  assert.equal((await again.delete(`/v1/meshes/${ids[60]}`, as(tokens.ann))).status, 204);
  const late = await again.post('/v1/meshes', Buffer.from(mesh(1000)), as(tokens.bob));
  assert.equal(late.status, 201);
  const second = await seen(again, tokens);
  await again.stop();
  const names = await listed(old);
  const { out, err, code } = await migrate(old, cluster);
  assert.equal(code, 0, out + err);
  assert.match(out, /^going on\n/);
  const [, copied, there] = /^\d+ objects: (\d+) copied \(\d+ bytes\), (\d+) were there$/m.exec(out).map(Number);
  assert.ok(there >= 60 && copied >= 1, out);
  assert.match(out, /1 objects removed/);
  assert.equal((await list(bucket, 'objects', `${cluster.prefix}/mesh/`)).length, 70);
  await refused(migrate(old, cluster), /whole copy of this deployment already/);

  const moved = await serve(t, cluster, '--auth', 'on', ...allow);
  assert.deepEqual(await seen(moved, tokens), second);
  assert.deepEqual(await listed(cluster), names);
  const waiting = sql(`SELECT count(*) FROM ${schema(cluster.catalogue)}.delivery WHERE state=0`);
  assert.equal(waiting, '1', 'the outbox goes on');
  assert.equal((await moved.delete(`/v1/meshes/${ids[59]}`, as(tokens.ann))).status, 204);
  const more = await moved.post('/v1/meshes', Buffer.from(mesh(1001)), as(tokens.ann));
  assert.equal(more.status, 201, 'numbers of rows go on');
  const third = await seen(moved, tokens);
  const last = await listed(cluster);
  await refused(migrate(cluster, back), /in use by another process/, 1);
  await moved.stop();

  const returned = await migrate(cluster, back);
  assert.equal(returned.code, 0, returned.out + returned.err);
  const check = await run('--check-data', ...back.to);
  assert.match(check.out, /: 0 wrong, 0 objects without a row/);
  const home = await serve(t, back, '--auth', 'on', ...allow);
  assert.deepEqual(await seen(home, tokens), third);
  assert.deepEqual(await listed(back), last);
  assert.equal((await home.post('/v1/meshes', Buffer.from(mesh(1002)), as(tokens.bob))).status, 201);
});

test('jobs that waited or ran when the daemon was killed go on', async (t) => {
  const top = await folder(t);
  const shared = { postgresql: true, inS3: true };
  const places = [place(top, 'from'), place(top, 'one', shared), place(top, 'two', shared), place(top, 'back')];
  places.push(place(top, 'three', shared));
  const d = await serve(t, places[0], '--workers', '1');
  const { id } = (await d.upload(shapes.obj(shapes.egg(5)))).json;
  const long = (await d.post('/v1/embeddings', { mesh: id, ...endless })).json;
  await until(async () => (await d.get(long.url)).json.state === 'running', 'the first job runs');
  // It waits for the embeddings of its shapes, which wait for the only worker.
  const request = { shapes: [], align: { method: 'rotate' } };
  for (const k of [1, 2]) request.shapes.push({ mesh: (await d.upload(mesh(k))).json.id });
  const waiting = (await d.post('/v1/supermeshes', request)).json;
  assert.equal(waiting.state, 'queued');
  await d.stop('SIGKILL');
  for (let k = 1; k < places.length; k++) {
    const { code, out, err } = await migrate(places[k - 1], places[k]);
    assert.equal(code, 0, out + err);
    const next = await serve(t, places[k], '--workers', '1');
    const state = async (job) => (await next.get(job.url)).json.state;
    await until(async () => (await state(long)) === 'running', 'the first job runs again');
    assert.equal(await state(waiting), 'queued');
    if (k === places.length - 1) {
      assert.ok((await next.delete(long.url)).status < 300);
      assert.equal((await next.ended(waiting)).state, 'succeeded');
      assert.equal(await state(long), 'cancelled');
    }
    await next.stop('SIGKILL');
  }
});

test('while S3 is unreachable, the move waits', async (t) => {
  const top = await folder(t);
  const [from, to] = [place(top, 'from'), place(top, 'to')];
  const d = await serve(t, from);
  for (let k = 0; k < 20; k++) assert.equal((await d.upload(mesh(k))).status, 201);
  await d.stop();
  // A request is tried four times before S3 counts as unreachable.
  let asked = 0;
  const proxy = await s3Proxy(t, bucket, () => (++asked > 10 && asked <= 45 ? busy : undefined));
  to.to.push('--objects', `s3://objects/${to.prefix}?endpoint=${proxy.url}`);
  const { code, out, err } = await migrate(from, to);
  assert.equal(code, 0, out + err);
  assert.match(err, /S3 is unreachable[\s\S]*S3 is back/);
  assert.equal((await list(bucket, 'objects', `${to.prefix}/mesh/`)).length, 20);
});

test('a flipped bit in the source is named, not copied', async (t) => {
  const top = await folder(t);
  const from = place(top, 'from', { inS3: true });
  const to = place(top, 'to', { postgresql: true });
  const d = await serve(t, from);
  const [{ json: a }, { json: b }] = [await d.upload(mesh(1)), await d.upload(mesh(2))];
  await d.stop();
  const key = (await list(bucket, 'objects', `${from.prefix}/mesh/`)).find((name) => name.endsWith(a.id));
  const good = Buffer.from(mesh(1));
  const bad = Buffer.from(good);
  bad[bad.length >> 1] ^= 1;
  // An object altered as a disk would alter it, beside the right hash; and as an attacker with the keys would, with the
  // hash of the wrong bytes.
  for (const meta of [sha256(good), sha256(bad)]) {
    assert.ok((await s3(bucket, 'PUT', `objects/${key}`, bad, { sha256: meta })).ok);
    await refused(migrate(from, to), new RegExp(`^mesh ${a.id}: its object does not match its hash$`, 'm'), 1);
    assert.ok(!existsSync(path.join(to.data, 'objects/mesh', a.id.slice(0, 2), a.id)));
    assert.ok(existsSync(path.join(to.data, 'objects/mesh', b.id.slice(0, 2), b.id)), 'all else is copied');
    const kept = await s3(bucket, 'GET', `objects/${key}`);
    assert.ok(Buffer.from(await kept.arrayBuffer()).equals(bad), 'the source stays as it is');
    await refused(run('--listen', '127.0.0.1:0', ...to.to), /in part: run it again/);
  }
  assert.ok((await s3(bucket, 'DELETE', `objects/${key}`)).ok);
  await refused(migrate(from, to), new RegExp(`^mesh ${a.id}: its object is missing$`, 'm'), 1);
  assert.ok((await s3(bucket, 'PUT', `objects/${key}`, good, { sha256: sha256(good) })).ok);
  // A bit flips in an object that an earlier run has copied.
  const file = path.join(to.data, 'objects/mesh', b.id.slice(0, 2), b.id);
  writeFileSync(file, bad);
  const healed = await migrate(from, to);
  assert.equal(healed.code, 0, healed.out + healed.err);
  assert.match(healed.out, /2 objects: 2 copied/);
  assert.equal(readFileSync(file, 'utf8'), mesh(2));
  const there = await serve(t, to);
  for (const [k, { id }] of [a, b].entries())
    assert.equal((await there.get(`/v1/meshes/${id}/file`)).bytes.toString(), mesh(k + 1));
  await there.stop();

  // In files.
  const home = place(top, 'home');
  const again = { ...to, from: to.from };
  const stored = path.join(to.data, 'objects/mesh', a.id.slice(0, 2), a.id);
  writeFileSync(stored, bad);
  await refused(migrate(again, home), new RegExp(`^mesh ${a.id}: its object does not match`, 'm'), 1);
  await refused(run('--listen', '127.0.0.1:0', ...home.to), /in part: run it again/);
});

test('a target of others, a schema of the future and wrong options are refused, and nothing is written', async (t) => {
  const top = await folder(t);
  const [from, other, cluster] = [
    place(top, 'from'),
    place(top, 'other'),
    place(top, 'cluster', { postgresql: true, inS3: true }),
  ];
  for (const at of [from, other, cluster]) {
    const d = await serve(t, at);
    assert.equal((await d.upload(mesh(at === other ? 1 : 2))).status, 201);
    if (at !== cluster) await d.stop();
    else
      await refused(
        run('migrate', ...from.from, '--data', path.join(top, 'busy'), '--catalogue', at.catalogue),
        /another orbmorphd uses it/,
        1,
      );
    await d.stop();
  }
  const rows = () => sql(`SELECT count(*) FROM ${schema(cluster.catalogue)}.resource`);
  const fresh = (name, catalogue, objects) => ({
    data: path.join(top, name),
    to: [
      '--data',
      path.join(top, name),
      ...(catalogue ? ['--catalogue', catalogue] : []),
      ...(objects ? ['--objects', objects] : []),
    ],
  });
  await refused(migrate(from, other), /catalogue of the target belongs to another deployment/);
  await refused(migrate(from, cluster), /data folder of the target belongs to another deployment/);
  await refused(migrate(from, fresh('x1', cluster.catalogue)), /catalogue of the target belongs to another/);
  await refused(migrate(from, fresh('x2', null, cluster.objects)), /bucket of the target belongs to another/);
  await refused(migrate(cluster, fresh('x3', null, cluster.objects)), /bucket of the target is that of the source/);
  await refused(migrate(from, fresh('x4', null, `s3://nowhere?endpoint=${bucket}`)), /bucket nowhere does not exist/);
  await refused(migrate(from, from), /also the data folder of the source/);
  await refused(migrate({ from: ['--from-data', path.join(top, 'none')] }, fresh('x5')), /none is not a data folder/);
  mkdirSync(path.join(top, 'empty'));
  await refused(migrate({ from: ['--from-data', path.join(top, 'empty')] }, fresh('x5')), /empty is not a data folder/);
  await refused(migrate({ from: ['--from-data', cluster.data] }, fresh('x5')), /name its URL with --from-catalogue/);
  await refused(
    migrate({ from: ['--from-data', cluster.data, '--from-catalogue', cluster.catalogue] }, fresh('x5')),
    /name their bucket with --from-objects/,
  );
  await refused(
    migrate({ from: [...from.from, '--from-objects', cluster.objects] }, fresh('x5')),
    /omit --from-objects/,
  );
  const empty = newCatalogue('nothing');
  await refused(
    migrate({ from: ['--from-data', path.join(top, 'empty'), '--from-catalogue', empty] }, fresh('x5')),
    /source has no catalogue/,
  );
  await refused(run('migrate', ...other.to), /--from-data is missing/, 2);
  await refused(run('migrate', '--from-data'), /--from-data needs a value/, 2);
  await refused(
    run('migrate', '--from-data', from.data, '--from-catalogue', 'mysql://x', ...other.to),
    /postgresql:/,
    2,
  );
  sql(`UPDATE ${schema(cluster.catalogue)}.catalogue SET schema=999`);
  await refused(migrate(cluster, fresh('x5')), /schema 999.*install a newer version/);
  assert.equal(rows(), '1');
  for (const name of ['x1', 'x2', 'x3', 'x4', 'x5'])
    assert.deepEqual(
      readdirSync(path.join(top, name)).filter((file) => file !== 'lock'),
      [],
      name,
    );
  assert.equal((await run('--check-data', ...other.to)).code, 0);
});
