// Processes of jobs and checks die at ORB_DEATHS (200) random moments, in each of six ways, while 64 clients upload
// meshes and have them embedded. No connection is dropped, no other job counts an attempt, every accepted job ends, and
// every result is there. ORB_SEED chooses the moments.
//
// The ways: the process itself reads from nowhere (SIGSEGV), reads across a word that must not be (SIGBUS), ends by itself,
// or loops for ever, until its time limit (tests/long/hurt.py changes its next instruction); the kernel kills it because its
// control group has no memory; it gets SIGKILL. Needs root.
import assert from 'node:assert/strict';
import { spawn } from 'node:child_process';
import { mkdtemp, rm } from 'node:fs/promises';
import os from 'node:os';
import path from 'node:path';
import readline from 'node:readline';
import { setTimeout as sleep } from 'node:timers/promises';
import { Daemon } from '../scenario/support/daemon.mjs';
import { workers } from '../scenario/support/processes.mjs';
import * as shapes from '../scenario/support/shapes.mjs';

const deaths = Number(process.env.ORB_DEATHS ?? 200);
const clients = 64;
let seed = Number(process.env.ORB_SEED ?? 1);
function random() {
  seed = (Math.imul(seed, 1664525) + 1013904223) >>> 0;
  return seed / 2 ** 32;
}

const data = await mkdtemp(path.join(os.tmpdir(), 'orbmorph-deaths-'));
const d = await new Daemon(data, ['--workers', '2', '--job-seconds', '4', '--check-seconds', '4'], {}).start();
let log = '';
d.child.stderr.on('data', (chunk) => (log += chunk));

const ways = ['segv', 'bus', 'SIGKILL', 'oom', 'loop', 'exit'];
const died = Object.fromEntries(ways.map((way) => [way, 0]));
const hurt = spawn('python3', [new URL('hurt.py', import.meta.url).pathname], { stdio: ['pipe', 'pipe', 'ignore'] });
const answers = readline.createInterface({ input: hurt.stdout })[Symbol.asyncIterator]();
/** Makes a process die, or loop forever; false if it has ended meanwhile. */
async function kill(pid, way) {
  if (way !== 'SIGKILL') {
    hurt.stdin.write(`${pid} ${way}\n`);
    const { value, done } = await answers.next();
    assert.ok(!done, 'hurt.py ended');
    return value === '0';
  }
  try {
    return process.kill(pid, way);
  } catch (error) {
    assert.equal(error.code, 'ESRCH');
    return false;
  }
}

let stop = false;
let made = 0;
const jobs = [];
const uploads = { fine: 0, refused: 0 };
const OWN_DEATH = ['/problems/job-crashed', '/problems/timeout', '/problems/no-memory'];

/** One client. A request that gets no answer rejects, and the run fails. */
async function client() {
  while (!stop) {
    const n = ++made;
    const file = shapes.obj(shapes.ball(3, ([x, y, z]) => [x * (1 + 0.1 * Math.sin(n)), y, z + 0.001 * n]));
    const mesh = await d.upload(file, { name: `m${n}` });
    if (mesh.status !== 201) {
      assert.ok(OWN_DEATH.includes(mesh.json?.type), `${mesh.status} ${mesh.bytes}`);
      uploads.refused++;
      continue;
    }
    uploads.fine++;
    const reply = await d.post('/v1/embeddings', { mesh: mesh.json.id });
    assert.equal(reply.status, 202, reply.bytes.toString());
    jobs.push(await d.ended(reply.json, { seconds: 300 }));
  }
}

const began = Date.now();
const busy = Array.from({ length: clients }, client);
const failed = Promise.all(busy).then(() => new Promise(() => {})); // rejects as soon as one of them does
for (let n = 0; n < deaths; ) {
  await Promise.race([sleep(20 + 300 * random()), failed]);
  const there = workers(d);
  const way = ways[n % ways.length];
  if (there.length && (await Promise.race([kill(there[Math.floor(random() * there.length)], way), failed]))) {
    died[way]++;
    n++;
  }
  assert.ok(Date.now() - began < 3_600_000, `only ${n} deaths within an hour`);
}
stop = true;
hurt.stdin.end();
await Promise.all(busy);

// Each death takes at most one attempt of one job, or one upload.
const again = jobs.reduce((sum, job) => sum + job.attempt - 1, 0);
const unfinished = jobs.filter((job) => job.state !== 'succeeded');
for (const job of unfinished) assert.ok(OWN_DEATH.includes(job.problem?.type), JSON.stringify(job));
assert.ok(jobs.every((job) => job.state !== 'cancelled'));
assert.ok(
  again + unfinished.length + uploads.refused <= deaths,
  `${again} further attempts, ${unfinished.length} failed jobs and ${uploads.refused} failed uploads of ${deaths} deaths`,
);
for (const job of jobs.filter(({ state }) => state === 'succeeded'))
  assert.equal((await d.get(job.result)).status, 200, job.result);
for (const job of jobs) assert.equal((await d.get(job.url)).json.state, job.state);
assert.equal((await d.get('/readyz')).status, 200);
const { code } = await d.stop();
assert.equal(code, 0, log);
await rm(data, { recursive: true, force: true });
console.log(
  `${deaths} deaths in ${((Date.now() - began) / 1000).toFixed(0)} s (${ways.map((way) => `${way} ${died[way]}`).join(', ')}) ` +
    `under ${clients} clients: ${jobs.length} jobs and ${uploads.fine} uploads accepted, none lost, no connection dropped; ` +
    `${again} attempts were repeated, ${unfinished.length} jobs and ${uploads.refused} uploads failed with their process`,
);
