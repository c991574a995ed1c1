// A full disk: writes get 507, reads still work, and everything works again once there is space. The test mounts a
// small file system in memory; it is skipped if mounting is not allowed.
import assert from 'node:assert/strict';
import { execFileSync, spawnSync } from 'node:child_process';
import { closeSync, openSync, readdirSync, statfsSync, statSync, unlinkSync, writeSync } from 'node:fs';
import http from 'node:http';
import path from 'node:path';
import test from 'node:test';
import { folder, runProgram } from './support/cli.mjs';
import { assertProblem, binaries, Daemon, daemon, until } from './support/daemon.mjs';
import { memoryDisk } from './support/disk.mjs';
import * as shapes from './support/shapes.mjs';

/** A daemon whose data folder is on a disk in memory; undefined where that cannot be mounted. */
async function daemonOnDisk(t, size, reserve, ...more) {
  const disk = memoryDisk(t, size);
  if (!disk) return undefined;
  const d = new Daemon(path.join(disk.folder, 'data'), ['--disk-reserve', reserve, ...more], {});
  t.after(async () => {
    if (d.child) await d.stop();
    disk.unmount();
  });
  return { d: await d.start(), mount: disk.folder };
}

/** Fills the file system to the last block; less than one block is left. */
function fill(file) {
  const fd = openSync(file, 'w');
  for (let size = 1 << 20; size >= 1; size = size >> 1)
    try {
      for (;;) writeSync(fd, Buffer.alloc(size));
    } catch (error) {
      assert.equal(error.code, 'ENOSPC');
    }
  closeSync(fd);
}

for (const [reserve, what] of [
  ['0', 'found when it is written'],
  ['4M', 'foreseen by the reserve'],
]) {
  test(`a full disk, ${what}`, async (t) => {
    const on = await daemonOnDisk(t, '24m', reserve);
    if (!on) return;
    const { d, mount } = on;
    const mesh = (n) => shapes.obj(shapes.ball(3, ([x, y, z]) => [x * (1 + n / 100), y, z]));
    const kept = await d.upload(mesh(0), { name: 'kept' });
    assert.equal(kept.status, 201);
    const made = await d.made('/v1/embeddings', { mesh: kept.json.id });

    fill(path.join(mount, 'ballast'));
    for (let n = 1; n <= 3; n++) assertProblem(await d.upload(mesh(n), { name: 'm' }), 507, 'storage-full');
    assert.equal((await d.get(`${kept.json.url}/file`)).bytes.toString(), mesh(0));
    assert.deepEqual((await d.get(made.url)).json, made);
    assert.equal((await d.get(`${made.url}/sphere.ply`)).status, 200);
    assert.equal((await d.get('/v1/jobs')).status, 200);
    assert.equal((await d.get('/readyz')).status, 200);
    // Without a reserve the daemon may still accept a job while the catalogue has room in its log; then the job ends,
    // well or with the reason.
    const job = await d.post('/v1/embeddings', { mesh: kept.json.id, method: 'kernel-sampling' });
    if (job.status !== 202 || reserve !== '0') assertProblem(job, 507, 'storage-full');
    await new Promise((resolve) => setTimeout(resolve, 500));

    unlinkSync(path.join(mount, 'ballast'));
    assert.equal((await d.upload(mesh(4), { name: 'm' })).status, 201);
    if (job.status === 202) {
      const end = await d.ended((await d.get(job.json.url)).json);
      assert.ok(end.state === 'succeeded' || end.problem.type === '/problems/storage-full', JSON.stringify(end));
    }
    await d.made('/v1/embeddings', { mesh: kept.json.id, method: 'kernel-sampling' });
    const { code } = await d.stop();
    assert.equal(code, 0, d.log);
    const { stdout } = spawnSync(
      'sh',
      ['-c', `"${process.env.ORBMORPHD ?? 'build/bin/orbmorphd'}" --check-data --data ${d.data}`],
      { encoding: 'utf8' },
    );
    assert.match(stdout, / 0 wrong/);
  });
}

test('a body of unknown length leaves the reserve free, too', async (t) => {
  const on = await daemonOnDisk(t, '32m', '16M');
  if (!on) return;
  const { d } = on;
  const chunks = async function* (count) {
    for (let i = 0; i < count; i++) yield Buffer.from('# nothing but words\n'.repeat(13_108)); // of a quarter of a megabyte each
  };
  const send = async (count) => {
    const reply = await fetch(`${d.url}/v1/meshes`, { method: 'POST', body: chunks(count), duplex: 'half' });
    const bytes = Buffer.from(await reply.arrayBuffer());
    return {
      status: reply.status,
      headers: reply.headers,
      type: reply.headers.get('content-type'),
      bytes,
      json: JSON.parse(bytes),
    };
  };
  assertProblem(await send(96), 507, 'storage-full'); // 24 MB, for which the disk has room
  assertProblem(await send(16), 400, 'malformed-mesh'); // 4 MB are read to the end
  assert.equal((await d.upload(shapes.tetrahedron)).status, 201);
});

/** Uploads with bodies of unknown length that send so many bytes and then stall. */
class Stalled {
  constructor(d, headers, count, bytes) {
    this.uploads = Array.from({ length: count }, () => {
      const request = http.request(`${d.url}/v1/meshes`, { method: 'POST', headers, agent: false });
      const reply = new Promise((resolve) => {
        request.on('response', async (response) => {
          const chunks = await response.toArray();
          const text = Buffer.concat(chunks);
          const answer = { status: response.statusCode, headers: new Headers(response.headers), bytes: text };
          resolve({ ...answer, type: response.headers['content-type'], json: JSON.parse(text) });
        });
        request.on('error', () => resolve(undefined));
      });
      request.flushHeaders();
      const sent = new Promise((resolve) => request.write(Buffer.alloc(bytes, '# words\n'), resolve));
      return { request, reply, sent };
    });
  }
  sent() {
    return Promise.all(this.uploads.map(({ sent }) => sent));
  }
  end() {
    for (const { request } of this.uploads) request.end();
    return Promise.all(this.uploads.map(({ reply }) => reply));
  }
  leave() {
    for (const { request } of this.uploads) request.destroy();
  }
}

/** A daemon for tenants on a disk in memory, of which some 80 MB are free beyond the reserve. */
async function tenantsOnDisk(t) {
  const forever = ['--limits', 'off', '--min-rate', '0', '--idle-seconds', '3600'];
  const on = await daemonOnDisk(t, '96m', '16M', '--auth', 'on', ...forever);
  if (!on) return undefined;
  const { d } = on;
  const add = async (name, ...more) => {
    const words = ['token', 'add', name, '--scope', 'read,write', ...more, '--data', d.data];
    return { authorization: `Bearer ${(await runProgram(binaries.daemon, words)).out.trim()}` };
  };
  const tmp = path.join(d.data, 'tmp');
  const sizeOf = (name) => statSync(path.join(tmp, name), { throwIfNoEntry: false })?.size ?? 0;
  const arriving = () => readdirSync(tmp).reduce((sum, name) => sum + sizeOf(name), 0);
  const empty = () => until(() => arriving() === 0, 'the temporary files are deleted', 60);
  const room = () => statfsSync(d.data).bavail * statfsSync(d.data).bsize - (16 << 20);
  const upload = (headers, text) => d.post('/v1/meshes', Buffer.from(text), { headers });
  return { d, add, arriving, empty, room, upload };
}
/** A mesh whose file has 8 megabytes. */
const large = (n) => shapes.obj(shapes.ball(2, ([x, y, z]) => [x * (1 + n / 100), y, z])) + '# padding\n'.repeat(8e5);

test('what a tenant sends and does not end is within its quota', async (t) => {
  const on = await tenantsOnDisk(t);
  if (!on) return;
  const { d, add, arriving, empty, upload } = on;
  const [evil, other] = [await add('evil', '--quota', '1M'), await add('other')];
  const small = shapes.obj(shapes.ball(2));
  assert.equal((await upload(evil, small)).status, 201);

  // Announced: refused before it is sent. Known: as before.
  const announced = await upload(evil, large(0));
  assertProblem(announced, 429, 'quota-exceeded');
  assert.equal(announced.json.quota, 1 << 20);
  assert.equal((await upload(evil, small)).status, 200);
  await empty();

  // Known to a tenant whose quota is full, or was lowered below it.
  const full = await add('full', '--quota', String(small.length));
  assert.equal((await upload(full, small)).status, 201);
  assert.equal((await upload(full, small)).status, 200);
  assertProblem(await upload(full, small.replace('v ', 'v  ')), 429, 'quota-exceeded');
  await runProgram(binaries.daemon, ['token', 'set', 'full', '--quota', '100', '--data', d.data]);
  assert.equal((await upload(full, small)).status, 200);
  assertProblem(await upload(full, small.replace('v ', 'v  ')), 429, 'quota-exceeded');

  // Each sends more than its quota, and keeps nothing.
  const over = new Stalled(d, evil, 2, 5 << 18);
  await over.sent();
  await empty();
  for (const reply of await over.end()) {
    assertProblem(reply, 429, 'quota-exceeded');
    assert.equal(reply.json.quota, 1 << 20);
  }

  // Each sends less, all of them more than twice the quota.
  const within = new Stalled(d, evil, 40, 3 << 18);
  await within.sent();
  await until(() => arriving() === 2 * (3 << 18), 'two of them are kept');
  assert.equal((await upload(other, large(1))).status, 201);
  const replies = await within.end();
  for (const reply of replies.filter(({ status }) => status === 503)) {
    assertProblem(reply, 503, 'unavailable');
    assert.ok(Number(reply.headers.get('retry-after')) > 0);
  }
  const ends = replies.map(({ status }) => status);
  assert.deepEqual([ends.filter((s) => s === 400).length, ends.filter((s) => s === 503).length], [2, 38], `${ends}`);
  await empty();
});

test('what a tenant sends and does not end takes half of the disk', async (t) => {
  const on = await tenantsOnDisk(t);
  if (!on) return;
  const { d, add, arriving, empty, room, upload } = on;
  const [greedy, other] = [await add('greedy'), await add('other')];
  const before = room();
  const many = new Stalled(d, greedy, 40, 3 << 20);
  await many.sent();
  await until(() => arriving() > before / 2 - (4 << 20) && arriving() <= before / 2, `its share of ${before} bytes`);
  assertProblem(await upload(greedy, large(2)), 503, 'unavailable');
  assert.equal((await upload(other, large(2))).status, 201, 'another tenant has room');
  many.leave();
  await empty();
  assert.equal((await upload(greedy, large(3))).status, 201, 'clients that are gone give it back');

  // A single file that is too large for its share.
  const one = new Stalled(d, greedy, 1, Math.floor(room() * 0.75));
  await one.sent();
  await empty();
  const [reply] = await one.end();
  assertProblem(reply, 507, 'storage-full');
  const last = new Stalled(d, greedy, 4, 1 << 20);
  await last.sent();
  const { code } = await d.stop();
  assert.equal(code, 0, d.log);
  last.leave();
});

/** A mesh whose file has a megabyte. */
const padded = (n) => shapes.obj(shapes.ball(2, ([x, y, z]) => [x * (1 + n / 100), y, z])) + '# padding\n'.repeat(1e5);
const backup = (to, data, reserve) =>
  runProgram(binaries.daemon, ['backup', to, '--data', data, '--disk-reserve', reserve]);
const restore = (from, data, reserve) =>
  runProgram(binaries.daemon, ['restore', from, '--data', data, '--disk-reserve', reserve]);
const stops = ({ code, out, err }) => {
  assert.equal(code, 1, out);
  assert.match(err, /would have less space left than disk-reserve asks for/);
};

test('a backup leaves the reserve free, and goes on where it has room', async (t) => {
  const disk = memoryDisk(t, '16m');
  if (!disk) return;
  t.after(disk.unmount);
  const mount = disk.folder;
  const d = await daemon(t);
  const [kept, made] = [path.join(mount, 'backup'), path.join(mount, 'new')];
  const free = () => statfsSync(mount).bavail * statfsSync(mount).bsize;
  for (let n = 0; n < 12; n++) assert.equal((await d.upload(padded(n))).status, 201);
  stops(await backup(kept, d.data, '64M')); // before the catalogue
  assert.ok(free() > 15 << 20, `${free()} bytes are free`);
  stops(await backup(kept, d.data, '8M'));
  assert.ok(free() >= 8 << 20 && free() < 12 << 20, `${free()} bytes are free`); // some objects are there
  const whole = await backup(kept, d.data, '1M');
  assert.match(whole.out, /12 objects in the backup/, whole.err);
  // One that finds no room leaves the previous one whole.
  assert.equal((await d.upload(padded(12))).status, 201);
  stops(await backup(kept, d.data, '14M'));
  const restored = await restore(kept, path.join(await folder(t), 'data'), '0');
  assert.match(restored.out, /12 objects restored, 0 damaged or missing/, restored.err);
  stops(await restore(kept, made, '2M'));
  assert.ok(free() >= 2 << 20, `${free()} bytes are free`);
  execFileSync('mount', ['-o', 'remount,size=32m', mount]);
  const rest = await restore(kept, made, '2M');
  assert.match(rest.out, /12 objects restored, 0 damaged or missing/, rest.err);
});

test('a backup on the disk of the service leaves room for uploads', async (t) => {
  const on = await daemonOnDisk(t, '24m', '4M');
  if (!on) return;
  const { d, mount } = on;
  for (let n = 0; n < 12; n++) assert.equal((await d.upload(padded(n))).status, 201);
  stops(await backup(path.join(mount, 'backup'), d.data, '4M'));
  assert.equal((await d.upload(padded(12))).status, 201);
});
