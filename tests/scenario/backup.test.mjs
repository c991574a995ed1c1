// Backs up a data folder that a daemon serves, and checks what is restored.
import assert from 'node:assert/strict';
import { spawn, spawnSync } from 'node:child_process';
import {
  closeSync,
  existsSync,
  linkSync,
  mkdirSync,
  openSync,
  readdirSync,
  readFileSync,
  rmSync,
  statSync,
  writeFileSync,
  writeSync,
} from 'node:fs';
import path from 'node:path';
import test from 'node:test';
import { mesh, sha256, trap, watching } from './support/backup.mjs';
import { folder, runProgram } from './support/cli.mjs';
import { assertProblem, binaries, Daemon, daemon, endless, until } from './support/daemon.mjs';
import { object } from './support/objects.mjs';
import * as shapes from './support/shapes.mjs';

const run = (...args) => runProgram(binaries.daemon, args);

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
  writeFileSync(bad, bytes);
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

/** Changes one byte where it lies, as a disk that fails does: neither the inode, the size nor the time change. */
function rot(file) {
  const bytes = readFileSync(file);
  const at = bytes.length >> 1;
  const time = `${file}.time`; // of the file, to the nanosecond
  assert.equal(spawnSync('touch', ['-r', file, time]).status, 0);
  const fd = openSync(file, 'r+');
  writeSync(fd, Buffer.from([bytes[at] ^ 1]), 0, 1, at);
  closeSync(fd);
  assert.equal(spawnSync('touch', ['-r', time, file]).status, 0);
  rmSync(time);
}

test('a backup is a copy, and each backup verifies all that it keeps', async (t) => {
  const d = await daemon(t, { args: ['--scrub-rate', '0'] });
  const place = await folder(t);
  const [backup, fresh] = [path.join(place, 'backup'), path.join(place, 'new')];
  const again = () => run('backup', backup, '--data', d.data);
  const [a, b, c] = (await Promise.all([0, 1, 2].map((k) => d.upload(mesh(k))))).map((reply) => reply.json);
  const copy = ({ id }) => object(backup, 'mesh', id);
  const kept = (m, k) => assert.equal(readFileSync(copy(m), 'utf8'), mesh(k));
  assert.equal((await again()).code, 0);

  // A byte of the service flips: the backup has its own.
  rot(object(d.data, 'mesh', a.id));
  kept(a, 0);
  assert.equal((await again()).code, 0);
  kept(a, 0);

  // A byte of the backup flips: the next one finds it, and copies the object again.
  rot(copy(b));
  const mended = await again();
  assert.equal(mended.code, 0, mended.out + mended.err);
  assert.match(mended.out, new RegExp(`^mesh ${b.id}: its object in the backup was damaged and is copied again$`, 'm'));
  assert.match(mended.out, /^3 objects in the backup: 1 new, 0 deleted that the last backup had, 0 damaged/m);
  kept(b, 1);

  // A backup of hard links, as earlier versions made them, becomes one of copies.
  rmSync(copy(c));
  linkSync(object(d.data, 'mesh', c.id), copy(c));
  assert.equal((await again()).code, 0);
  rot(object(d.data, 'mesh', c.id));
  kept(c, 2);

  // Both flip: no backup calls that healthy.
  rot(copy(c));
  const lost = await again();
  assert.equal(lost.code, 1);
  assert.match(lost.out, new RegExp(`^mesh ${c.id}: its object does not match its hash$`, 'm'));
  rot(copy(c));
  assert.equal((await run('restore', backup, '--data', fresh)).code, 0);
});

/** No program takes a folder for data while a restore into it has not ended. */
async function refuses(t, data, ...commands) {
  const why =
    /a restore into \S+ has not ended: run orbmorphd restore again until it ends, or name another folder with/;
  const d = new Daemon(data, [], {});
  t.after(() => d.child.kill('SIGKILL'));
  await assert.rejects(d.start(), /exit 78/);
  assert.match(d.log, why);
  for (const words of commands) {
    const { code, err } = await run(...words, '--data', data);
    assert.equal(code, 78, words.join(' '));
    assert.match(err, why);
  }
  assert.equal(existsSync(path.join(data, 'catalogue.sqlite')), false);
}

test('no daemon starts on what a killed restore has left, and another restore completes it', async (t) => {
  const watch = watching(t);
  const d = await daemon(t);
  const place = await folder(t);
  const [backup, fresh, aside] = ['backup', 'new', 'aside'].map((name) => path.join(place, name));
  const ids = [];
  for (let k = 0; k < 24; k++) ids.push((await d.upload(mesh(k))).json.id);
  await d.made('/v1/embeddings', { mesh: ids[0] });
  assert.equal((await run('backup', backup, '--data', d.data)).code, 0);
  const count = () => readdirSync(path.join(fresh, 'objects/mesh'), { recursive: true }).filter((f) => f.length > 64);

  // Killed after its first step, and while it writes the catalogue.
  mkdirSync(fresh);
  const begun = path.join(fresh, 'catalogue.new');
  writeFileSync(begun, '');
  await refuses(t, fresh, ['--check-data'], ['--gc'], ['token', 'add', 'x', '--scope', 'read']);
  const whole = readFileSync(path.join(backup, 'catalogue.sqlite'));
  writeFileSync(begun, whole.subarray(0, whole.length / 2));
  for (const tail of ['wal', 'journal']) writeFileSync(`${begun}-${tail}`, whole.subarray(whole.length / 2));
  await refuses(t, fresh);

  // Killed before the first object, in the middle, before the last one. Each goes on where the one before was killed.
  for (const k of [0, 11, 23]) {
    const put_back = trap(object(backup, 'mesh', ids[k]), aside);
    const restore = watch.run('restore', backup, '--data', fresh);
    const last = k ? object(fresh, 'mesh', ids[k - 1]) : path.join(fresh, 'objects/alignment');
    await restore.signal('SIGKILL', () => existsSync(last));
    assert.equal(await restore.ended, 'SIGKILL', restore.text);
    put_back();
    assert.equal(count().length, k);
    await refuses(t, fresh);
  }
  const other = path.join(fresh, 'notes.txt');
  writeFileSync(other, 'of somebody');
  assert.match((await run('restore', backup, '--data', fresh)).err, /is not empty/);
  rmSync(other);

  // The backup is a later one now, without a mesh that has been restored.
  assert.equal((await d.delete(`/v1/meshes/${ids[1]}`)).status, 204);
  assert.equal((await run('backup', backup, '--data', d.data)).code, 0);
  const all = await files(d);
  const complete = async (data) => {
    const check = await run('--check-data', '--data', data);
    assert.match(check.out, /: 0 wrong, 0 objects without a row/);
    const served = await serve(t, data);
    assert.deepEqual(await files(served), all);
    await served.stop();
  };
  const restored = await run('restore', backup, '--data', fresh);
  assert.equal(restored.code, 0, restored.err);
  assert.match(restored.out, /^24 objects restored, 0 damaged or missing$/m);
  await complete(fresh);

  // Killed as soon as a catalogue is there: the new one, or that of a complete restore.
  for (const name of ['catalogue.new', 'catalogue.sqlite']) {
    const data = path.join(place, `at-${name}`);
    const restore = watch.run('restore', backup, '--data', data);
    await restore.signal('SIGKILL', () => existsSync(path.join(data, name)));
    await restore.ended;
    if (!existsSync(path.join(data, 'catalogue.sqlite'))) {
      await refuses(t, data);
      assert.equal((await run('restore', backup, '--data', data)).code, 0);
    }
    await complete(data);
  }
});

test('each backup under load, also over kill -9, is restored with all that was acknowledged', async (t) => {
  const watch = watching(t);
  const args = ['--workers', '1', '--derived-bytes', '1M', '--scrub-rate', '0', '--drain-seconds', '0'];
  const d = await daemon(t, { args });
  const place = await folder(t);
  const [backup, aside] = ['backup', 'aside'].map((name) => path.join(place, name));
  const words = ['backup', backup, '--data', d.data];
  const evicted = () => d.log.match(/evicted a derived/g)?.length ?? 0;
  const load = watch.load(d);
  let backups = 0;
  let last; // when the last successful backup was made
  const check = async () => {
    load.rests = true;
    const fresh = path.join(place, `new-${backups++}`);
    const restored = await run('restore', backup, '--data', fresh);
    assert.equal(restored.code, 0, restored.out + restored.err);
    const { out } = await run('--check-data', '--data', fresh);
    assert.match(out, /: 0 wrong, 0 objects without a row/);
    const served = await serve(t, fresh, '--drain-seconds', '0');
    assert.ok((await load.check(served, last)) > 0);
    await served.stop();
    load.rests = false;
  };
  const runs = async () => {
    const { deleted, made } = load;
    await load.until(() => load.deleted > deleted + 1 && load.made > made + 1, 'the load runs');
  };
  const succeeds = async (one) => {
    assert.equal(await one.ended, 0, one.text);
    last = { since: one.since, done: performance.now() };
    await check();
  };
  const begun = path.join(backup, 'catalogue.new');

  await runs();
  await succeeds(watch.run(...words));

  // The daemon dies while a backup copies the catalogue, and while it brings objects. The next life of the daemon deletes
  // and evicts before the backup goes on.
  for (const moment of ['catalogue', 'objects']) {
    for (let halted = false, tries = 0; !halted; tries++) {
      assert.ok(tries < 10, 'a backup takes long enough to be stopped');
      await runs();
      const victim = await load.upload(mesh(10_000 + backups));
      const brought = object(backup, 'mesh', victim.id);
      for (let k = 0; k < 5; k++) await load.upload(mesh(20_000 + 100 * backups + k));
      const one = watch.run(...words);
      halted = await one.stop(() => existsSync(begun) && (moment === 'catalogue' || existsSync(brought)));
      if (halted) {
        d.killed = true;
        await d.stop('SIGKILL');
        await d.start();
        d.killed = false;
        const before = { deleted: load.deleted, made: load.made, evicted: evicted() };
        await load.delete(victim.url);
        await load.until(
          () => load.deleted > before.deleted + 1 && load.made > before.made && evicted() > before.evicted,
          'the new daemon deletes, ends a job and evicts',
        );
        assert.ok(existsSync(object(d.data, 'mesh', victim.id)), 'no object is deleted while a backup runs');
        one.child.kill('SIGCONT');
      }
      await succeeds(one);
    }
  }

  // The backup dies: the folder still is the one before.
  const [brought, awaited] = [await load.upload(mesh(30_000)), await load.upload(mesh(30_001))];
  const put_back = trap(object(d.data, 'mesh', awaited.id), aside);
  const killed = watch.run(...words);
  await killed.signal('SIGKILL', () => existsSync(object(backup, 'mesh', brought.id)));
  assert.equal(await killed.ended, 'SIGKILL', killed.text);
  put_back();
  await check();
  await runs();
  await succeeds(watch.run(...words));
  await load.end();
  await d.stop();
  assert.match((await run('--check-data', '--data', d.data)).out, /: 0 wrong/);
});
