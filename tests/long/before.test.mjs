// Attacks by what every version has: the API, --check-data and --gc, the data folder and the processes or threads that
// run jobs. So before.sh drives an old daemon with these tests, where scenarios read counters and records that it lacks.
// A test fails where the attack succeeds. The first needs root and Linux on x86-64 (hurt.py).
import assert from 'node:assert/strict';
import { spawn } from 'node:child_process';
import { readdirSync, readFileSync, statSync, truncateSync } from 'node:fs';
import path from 'node:path';
import test from 'node:test';
import { setTimeout as sleep } from 'node:timers/promises';
import { runProgram } from '../scenario/support/cli.mjs';
import { binaries, daemon, endless, until } from '../scenario/support/daemon.mjs';
import { flip, object } from '../scenario/support/objects.mjs';
import { workers } from '../scenario/support/processes.mjs';
import * as shapes from '../scenario/support/shapes.mjs';

const mesh = (k) => shapes.obj(shapes.ball(1, ([x, y, z]) => [x + k, y, z]));
const scrubs = ['--scrub-rate', '1G', '--scrub-seconds', '1']; // where the daemon has a scrub

/** The thread of a process that computes most within half a second. */
async function busiest(pid) {
  const ticks = () =>
    new Map(
      readdirSync(`/proc/${pid}/task`).map((thread) => {
        const fields = readFileSync(`/proc/${pid}/task/${thread}/stat`, 'latin1').split(') ').pop().split(' ');
        return [Number(thread), Number(fields[11]) + Number(fields[12])];
      }),
    );
  const before = ticks();
  await sleep(500);
  const spent = [...ticks()].map(([thread, now]) => ({ thread, used: now - (before.get(thread) ?? 0) }));
  return spent.sort((a, b) => b.used - a.used)[0].thread;
}

test('a job whose code reads from nowhere takes nothing else with it', async (t) => {
  const d = await daemon(t, { args: ['--workers', '2'] });
  d.killed = true; // how it ends is for this test to say
  const { json } = await d.upload(shapes.binaryPly(shapes.ball(5)));
  const reply = await d.post('/v1/embeddings', { mesh: json.id, ...endless });
  assert.equal(reply.status, 202, reply.bytes.toString());
  const job = async () => (await d.get(reply.json.url)).json;
  await until(async () => (await job()).stage === 'embed', 'the job runs', 60);
  await sleep(1000); // a process that has checked a file ends within this time
  const there = workers(d);
  assert.ok(there.length <= 1, 'only the job runs');
  const victim = there[0] ?? (await busiest(d.child.pid)); // without processes for jobs, its thread
  const hurt = spawn('python3', [new URL('hurt.py', import.meta.url).pathname], { stdio: ['pipe', 'pipe', 'inherit'] });
  hurt.stdin.end(`${victim} segv\n`);
  assert.equal((await hurt.stdout.toArray()).join(''), '0\n');
  const state = () => d.child.signalCode ?? d.child.exitCode;
  await until(async () => state() !== null || (await job()).attempt > 1, 'the job dies', 60);
  assert.equal(state(), null, 'the daemon has ended with the job');
  assert.equal((await d.upload(mesh(1))).status, 201);
  assert.equal((await d.delete(reply.json.url)).status, 200);
  assert.equal((await d.stop()).code, 0, d.log);
});

test('an asset is not served with a flipped bit', async (t) => {
  const d = await daemon(t);
  const ids = [];
  for (const shape of [shapes.egg(2), shapes.bean(2)]) ids.push((await d.upload(shapes.obj(shape))).json.id);
  const request = { shapes: ids.map((id) => ({ mesh: id })), align: { method: 'rotate' } };
  const morph = await d.made('/v1/supermeshes', request);
  const right = (await d.get(morph.asset)).bytes;
  await d.stop();
  flip(object(d.data, 'asset', morph.id));
  await d.start();
  const reply = await d.get(morph.asset);
  assert.ok(reply.status === 404 || reply.bytes.equals(right), `${reply.status}: the bytes with the flipped bit`);
  const again = await d.made('/v1/supermeshes', request);
  assert.ok((await d.get(again.asset)).bytes.equals(right), 'the same request makes it again');
});

test('sending the right bytes again mends a mesh with a flipped bit', async (t) => {
  const d = await daemon(t);
  const text = mesh(0);
  const { id } = (await d.upload(text)).json;
  await d.stop();
  flip(object(d.data, 'mesh', id));
  await d.start();
  assert.ok([200, 201].includes((await d.upload(text)).status));
  assert.equal((await d.get(`/v1/meshes/${id}/file`)).bytes.toString(), text);
});

/** Uploads 20 meshes, of which a cut WAL loses some rows; returns the texts of those. The daemon runs again. */
async function loseRows(d) {
  const texts = Array.from({ length: 20 }, (_, k) => mesh(k));
  const ids = [];
  for (const text of texts) ids.push((await d.upload(text)).json.id);
  await d.stop('SIGKILL');
  const wal = path.join(d.data, 'catalogue.sqlite-wal');
  truncateSync(wal, Math.floor(statSync(wal).size * 0.6));
  await d.start();
  const left = (await d.get('/v1/meshes?limit=500')).json.meshes.map(({ id }) => id);
  const lost = texts.filter((_, k) => !left.includes(ids[k]));
  assert.ok(lost.length > 0 && left.length > 0, `${lost.length} are lost, ${left.length} left`);
  return lost;
}

test('the daemon reports files whose rows a cut WAL lost', async (t) => {
  const d = await daemon(t, { args: scrubs });
  await loseRows(d);
  await until(() => /"level":"(warn|error)".* row/.test(d.log), 'a line of the log about them', 20);
});

test('--check-data reports such files, and --gc deletes none of them', async (t) => {
  const d = await daemon(t, { args: scrubs });
  const lost = await loseRows(d);
  assert.equal((await d.stop()).code, 0);
  const run = (what) => runProgram(binaries.daemon, [what, '--data', d.data]);
  const { out } = await run('--check-data');
  assert.equal((await run('--gc')).code, 0);
  const kept = readdirSync(d.data, { recursive: true, withFileTypes: true })
    .filter((entry) => entry.isFile())
    .map((entry) => readFileSync(path.join(entry.parentPath ?? entry.path, entry.name), 'latin1'));
  const deleted = lost.filter((text) => !kept.includes(text)).length;
  assert.equal(deleted, 0, `of ${lost.length} files; --check-data said: ${out}`);
  assert.match(out, /lost rows/);
});

test('the daemon reports a damaged file that nobody requests', async (t) => {
  const d = await daemon(t, { args: scrubs });
  const { json } = await d.upload(mesh(0));
  flip(object(d.data, 'mesh', json.id));
  await until(() => new RegExp(`"level":"(warn|error)".*${json.id}`).test(d.log), 'a line of the log about it', 20);
});
