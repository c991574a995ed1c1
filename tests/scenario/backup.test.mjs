// Backs up a data folder that a daemon serves, and checks what is restored.
import assert from 'node:assert/strict';
import { spawn } from 'node:child_process';
import { createHash } from 'node:crypto';
import { existsSync, readdirSync, readFileSync, renameSync, rmSync, statSync, writeFileSync } from 'node:fs';
import path from 'node:path';
import test from 'node:test';
import { folder, runProgram } from './support/cli.mjs';
import { assertProblem, binaries, Daemon, daemon, endless, until } from './support/daemon.mjs';
import * as shapes from './support/shapes.mjs';

const run = (...args) => runProgram(binaries.daemon, args);
const object = (data, kind, id) => path.join(data, 'objects', kind, id.slice(0, 2), id);
const mesh = (k) => shapes.obj(shapes.ball(2, ([x, y, z]) => [x * (1 + 0.3 * Math.sin(5 * y + k)), 1.5 * y, z]));
const sha256 = (bytes) => createHash('sha256').update(bytes).digest('hex');

/** Starts a daemon on a folder that another program made. */
async function serve(t, data, ...args) {
  const d = new Daemon(data, args, {});
  t.after(() => d.stop());
  return d.start();
}

/** Everything that can be downloaded, by URL. */
async function files(d) {
  const all = new Map();
  const keep = async (url) => {
    const reply = await d.get(url);
    assert.equal(reply.status, 200, `${url}: ${reply.bytes}`);
    all.set(url, sha256(reply.bytes));
  };
  for (const { id } of (await d.get('/v1/meshes?limit=500')).json.meshes) await keep(`/v1/meshes/${id}/file`);
  for (const { sphere } of (await d.get('/v1/embeddings?limit=500')).json.embeddings) await keep(sphere);
  for (const { id, asset } of (await d.get('/v1/supermeshes')).json.supermeshes) {
    for (const url of [asset, `${asset}?profile=quantized`]) await keep(url);
    for (const part of ['places', 'spheres/0.ply', 'spheres/1.ply']) await keep(`/v1/supermeshes/${id}/${part}`);
  }
  return all;
}

test('a backup under load is restored with the same bytes', async (t) => {
  const d = await daemon(t, { args: ['--workers', '1'] });
  const place = await folder(t);
  const [backup, fresh] = [path.join(place, 'backup'), path.join(place, 'new')];
  const [a, b] = [await d.upload(mesh(0)), await d.upload(mesh(1))];
  await d.made('/v1/supermeshes', { shapes: [{ mesh: a.json.id }, { mesh: b.json.id }], align: { method: 'rotate' } });
  const before = await files(d);
  const long = await d.upload(shapes.obj(shapes.egg(5)));
  const { json: job } = await d.post('/v1/embeddings', { mesh: long.json.id, ...endless });
  await until(async () => (await d.get(job.url)).json.state === 'running', 'the job runs');

  let busy = true;
  const accepted = [];
  const load = (async () => {
    for (let k = 2; busy; k++) accepted.push([(await d.upload(mesh(k))).json.id, mesh(k)]);
  })();
  await until(() => accepted.length > 2, 'uploads run');
  const first = await run('backup', backup, '--data', d.data);
  assert.equal(first.code, 0, first.out + first.err);
  busy = false;
  await load;

  // Again into the same folder: deleted entries leave, new ones arrive, all others stay.
  const [gone] = accepted.pop();
  assert.equal((await d.delete(`/v1/meshes/${gone}`)).status, 204);
  const file = object(backup, 'mesh', a.json.id);
  const inode = statSync(file).ino;
  const second = await run('backup', backup, '--data', d.data);
  assert.equal(second.code, 0, second.out + second.err);
  assert.equal(statSync(file).ino, inode);
  assert.equal(existsSync(object(backup, 'mesh', gone)), false);
  for (const [id, text] of accepted) assert.equal(readFileSync(object(backup, 'mesh', id), 'utf8'), text);
  const third = await run('backup', backup, '--data', d.data);
  assert.match(third.out, /: 0 new, 0 deleted/);
  const all = await files(d);
  for (const [url, sha] of before) assert.equal(all.get(url), sha, url);

  const restored = await run('restore', backup, '--data', fresh);
  assert.equal(restored.code, 0, restored.out + restored.err);
  assert.equal((await run('--check-data', '--data', fresh)).code, 0);
  const other = await serve(t, fresh, '--workers', '1');
  assert.deepEqual(await files(other), all);
  const resumed = (await other.get(job.url)).json;
  assert.ok(['queued', 'running'].includes(resumed.state), 'the job goes on');
  assert.ok(resumed.attempt <= 1, 'the attempt that the backup saw does not count');
  assert.equal((await other.upload(mesh(1000))).status, 201);
  for (const daemon of [d, other]) assert.equal((await daemon.delete(job.url)).status < 300, true);
});

test('a backup that is killed leaves the daemon intact, and the next one is complete', async (t) => {
  const d = await daemon(t);
  const place = await folder(t);
  const [backup, fresh] = [path.join(place, 'backup'), path.join(place, 'new')];
  for (let k = 0; k < 40; k++) assert.equal((await d.upload(mesh(k))).status, 201);
  for (const ms of [5, 15, 30, 60]) {
    const child = spawn(binaries.daemon, ['backup', backup, '--data', d.data], { stdio: 'ignore' });
    const ended = new Promise((done) => child.once('exit', done));
    await new Promise((done) => setTimeout(done, ms));
    child.kill('SIGKILL');
    await ended;
    assert.equal((await d.upload(mesh(100 + ms))).status, 201);
  }
  const { code, out, err } = await run('backup', backup, '--data', d.data);
  assert.equal(code, 0, out + err);
  assert.equal((await run('restore', backup, '--data', fresh)).code, 0);
  const check = await run('--check-data', '--data', fresh);
  assert.match(check.out, /^44 rows and 44 objects checked: 0 wrong, 0 objects without a row/m);
});

test('while a backup runs no object is deleted; afterwards objects without a row are', async (t) => {
  const d = await daemon(t);
  const [kept, gone] = [(await d.upload(mesh(0))).json, (await d.upload(mesh(1))).json];
  const holder = spawn('flock', [path.join(d.data, 'backup.lock'), 'sh', '-c', 'echo held; cat'], {
    stdio: ['pipe', 'pipe', 'inherit'],
  });
  t.after(() => holder.kill());
  await new Promise((done) => holder.stdout.once('data', done));
  for (const { url } of [kept, gone]) {
    assert.equal((await d.delete(url)).status, 204);
    assertProblem(await d.get(`${url}/file`), 404, 'not-found');
  }
  assert.equal((await d.upload(mesh(0))).status, 201, 'it comes back');
  await new Promise((done) => setTimeout(done, 1500)); // longer than a round of the daemon's housekeeping
  assert.equal(readFileSync(object(d.data, 'mesh', gone.id), 'utf8'), mesh(1));
  holder.stdin.end();
  await until(() => !existsSync(object(d.data, 'mesh', gone.id)), 'the object is deleted');
  assert.equal((await d.get(`${kept.url}/file`)).bytes.toString(), mesh(0));
  await d.stop();
  const gc = await runProgram('flock', [path.join(d.data, 'backup.lock'), binaries.daemon, '--gc', '--data', d.data]);
  assert.equal(gc.code, 1);
  assert.match(gc.out, /a backup of the data folder runs/);
});

test('a backup and a restore refuse what they would overwrite, and report damage', async (t) => {
  const d = await daemon(t);
  const place = await folder(t);
  const [backup, fresh] = [path.join(place, 'backup'), path.join(place, 'new')];
  const [a, b] = [(await d.upload(mesh(0))).json, (await d.upload(mesh(1))).json];
  assert.equal((await run('backup', backup, '--data', d.data)).code, 0);

  for (const [words, why] of [
    [['backup', d.data, '--data', d.data], /is neither empty nor a backup/],
    [['backup', backup, '--data', place], /is not a data folder/],
    [['restore', d.data, '--data', fresh], /is not a complete backup/],
    [['restore', backup, '--data', d.data], /is not empty/],
  ]) {
    const { code, err } = await run(...words);
    assert.equal(code, 1, words.join(' '));
    assert.match(err, why);
  }
  assert.equal((await run('backup')).code, 2);
  assert.equal((await d.get(`${a.url}/file`)).bytes.toString(), mesh(0));

  // A damaged object of the service does not replace the one that the backup has.
  const bad = object(d.data, 'mesh', a.id);
  const bytes = readFileSync(bad);
  bytes[bytes.length >> 1] ^= 1;
  writeFileSync(`${bad}.x`, bytes); // another file: the backup may have linked this one
  renameSync(`${bad}.x`, bad);
  const again = await run('backup', backup, '--data', d.data);
  assert.equal(again.code, 1);
  assert.match(again.out, new RegExp(`^mesh ${a.id}: its object does not match its hash$`, 'm'));
  assert.equal(readFileSync(object(backup, 'mesh', a.id), 'utf8'), mesh(0));

  // A damaged object of the backup is not restored either; all others are.
  const lost = object(backup, 'mesh', b.id);
  rmSync(lost);
  writeFileSync(lost, 'v 0 0 0\n');
  const restored = await run('restore', backup, '--data', fresh);
  assert.equal(restored.code, 1);
  assert.match(restored.out, new RegExp(`^mesh ${b.id}: its object does not match its hash$`, 'm'));
  assert.deepEqual(
    readdirSync(path.join(fresh, 'objects/mesh')).flatMap((shard) =>
      readdirSync(path.join(fresh, 'objects/mesh', shard)),
    ),
    [a.id],
  );
  const other = await serve(t, fresh);
  assert.equal((await other.get(`${a.url}/file`)).bytes.toString(), mesh(0));
  assert.equal((await other.upload(mesh(1))).status, 200, 'sending it again completes the service');
  assert.equal((await other.get(`${b.url}/file`)).bytes.toString(), mesh(1));
});
