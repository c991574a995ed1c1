// Processes of jobs and checks die at ORB_DEATHS (200) random moments, in each of six ways, while 64 clients upload
// meshes and have them embedded. No connection is dropped, every accepted job ends, and every result is there. ORB_SEED
// chooses the moments.
//
// Each further attempt, each job or upload that fails, and each line of the log about a death needs a death of its own,
// in the way that the line names. A death in a process whose job is known (by the mesh that it has open) counts for no
// other job. Some deaths have no effect: their process has sent its result, or waits for more files.
//
// The ways: the process itself reads from nowhere (SIGSEGV), reads across a word that must not be (SIGBUS), ends by itself,
// or loops for ever, until its time limit (tests/long/hurt.py changes its next instruction); the kernel kills it because its
// control group has no memory; it gets SIGKILL. Needs root.
import assert from 'node:assert/strict';
import { spawn } from 'node:child_process';
import { readdirSync, readlinkSync } from 'node:fs';
import { mkdtemp, rm } from 'node:fs/promises';
import os from 'node:os';
import path from 'node:path';
import readline from 'node:readline';
import { setTimeout as sleep } from 'node:timers/promises';
import { runProgram } from '../scenario/support/cli.mjs';
import { binaries, Daemon } from '../scenario/support/daemon.mjs';
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
const died = []; // {way, at, mesh}
const hurtBefore = new Set(); // processes: a second death would hide the first
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

/** The mesh that the process of a job has open. Undefined: it has no input yet, or checks files, or has ended. */
function meshOf(pid) {
  try {
    for (const fd of readdirSync(`/proc/${pid}/fd`)) {
      const [, mesh] = /\/objects\/mesh\/..\/([0-9a-f]{64})$/.exec(readlinkSync(`/proc/${pid}/fd/${fd}`)) ?? [];
      if (mesh) return mesh;
    }
  } catch {
    // it has ended, or closed this file
  }
}

let stop = false;
let made = 0;
const jobs = [];
const accepted = new Set(); // meshes
const refused = []; // {file, type, at}
const OWN_DEATH = ['/problems/job-crashed', '/problems/timeout'];

/** One client. A request that gets no answer rejects, and the run fails. */
async function client() {
  while (!stop) {
    const n = ++made;
    const levels = n % 8 ? 3 : 5; // every eighth job runs long enough to die in the middle of its work
    const file = shapes.obj(shapes.ball(levels, ([x, y, z]) => [x * (1 + 0.1 * Math.sin(n)), y, z + 0.001 * n]));
    const mesh = await d.upload(file, { name: `m${n}` });
    if (mesh.status !== 201) {
      assert.ok(OWN_DEATH.includes(mesh.json?.type), `${mesh.status} ${mesh.bytes}`);
      refused.push({ file, type: mesh.json.type, at: Date.now() });
      continue;
    }
    accepted.add(mesh.json.id);
    const reply = await d.post('/v1/embeddings', { mesh: mesh.json.id });
    assert.equal(reply.status, 202, reply.bytes.toString());
    jobs.push({ ...(await d.ended(reply.json, { seconds: 300 })), mesh: mesh.json.id });
  }
}

const began = Date.now();
const busy = Array.from({ length: clients }, client);
const failed = Promise.all(busy).then(() => new Promise(() => {})); // rejects as soon as one of them does
for (let n = 0; n < deaths; ) {
  await Promise.race([sleep(20 + 300 * random()), failed]);
  assert.ok(Date.now() - began < 3_600_000, `only ${n} deaths within an hour`);
  const find = () =>
    workers(d)
      .filter((pid) => !hurtBefore.has(pid))
      .map((pid) => ({ pid, mesh: meshOf(pid) }))
      .filter(({ mesh }) => mesh || n % 2 === 0); // most check files: every second death waits for one that runs a job
  let there = find();
  for (const since = Date.now(); n % 2 && !there.length; there = find()) {
    assert.ok(Date.now() - since < 600_000, 'no process has had a mesh open for ten minutes');
    await Promise.race([sleep(5), failed]);
  }
  if (!there.length) continue;
  const { pid, mesh } = there[Math.floor(random() * there.length)];
  const death = { way: ways[Math.floor(n / 2) % ways.length], mesh, at: Date.now() };
  if (!(await Promise.race([kill(pid, death.way), failed]))) continue;
  hurtBefore.add(pid);
  n = died.push(death);
}
stop = true;
hurt.stdin.end();
await Promise.all(busy);

for (const job of jobs) assert.ok(OWN_DEATH.includes(job.problem?.type ?? OWN_DEATH[0]), JSON.stringify(job));
for (const job of jobs.filter(({ state }) => state === 'succeeded'))
  assert.equal((await d.get(job.result)).status, 200, job.result);
for (const job of jobs) assert.equal((await d.get(job.url)).json.state, job.state);
assert.equal((await d.get('/readyz')).status, 200);
const spent = ((Date.now() - began) / 1000).toFixed(0);
// No file that was refused is at fault.
for (const upload of refused) {
  const again = await d.upload(upload.file);
  assert.equal(again.status, 201, again.bytes.toString());
  upload.mesh = again.json.id;
}
const records = (await runProgram(binaries.daemon, ['crash', 'list', '--data', data])).out;
const { code } = await d.stop();
assert.equal(code, 0, log);
await rm(data, { recursive: true, force: true });

/** The ways to die that a text of the log or of a problem may stand for. */
function waysOf(text) {
  const [, why] = /(was killed by signal \d+|exited with status \d+|ended for an unknown reason)/.exec(text) ?? [];
  const of = {
    'was killed by signal 7': ['bus'],
    'was killed by signal 9': ['SIGKILL', 'oom'],
    'was killed by signal 11': ['segv'],
    'exited with status 3': ['exit'],
    'ended for an unknown reason': ways.filter((way) => way !== 'loop'),
  };
  assert.ok(of[why], `no death of this test: ${text}`);
  return of[why];
}

// What the log says of each job and each file.
const lines = log
  .split('\n')
  .filter((line) => line.startsWith('{'))
  .map((line) => JSON.parse(line));
const ofJob = new Map(jobs.map(({ id }) => [id, { deaths: [], done: 0, failed: [] }]));
const ofFile = new Map(
  [...accepted, ...refused.map(({ mesh }) => mesh)].map((mesh) => [mesh, { alone: 0, behind: 0 }]),
);
const effects = []; // {ways, at, mesh, of}; mesh: of a job
for (const { level, message, job, time } of lines) {
  const at = Date.parse(time);
  const [, alone] = /^the process that checked mesh (\w+) /.exec(message) ?? [];
  const [, behind] = /^a process that checked several meshes, the last of them (\w+), /.exec(message) ?? [];
  if (/^the process of the job /.test(message)) {
    assert.ok(ofJob.has(job), `a death of no job: ${message}`);
    ofJob.get(job).deaths.push(message);
    effects.push({ ways: waysOf(message), at, mesh: jobs.find(({ id }) => id === job).mesh, of: message });
  } else if (alone ?? behind) {
    assert.ok(ofFile.has(alone ?? behind), `a death of no file: ${message}`);
    ofFile.get(alone ?? behind)[alone ? 'alone' : 'behind']++;
    effects.push({ ways: waysOf(message), at, of: message });
  } else if (message === 'embedding job done') {
    ofJob.get(job).done++;
  } else if (message === 'embedding job did not succeed') {
    ofJob.get(job).failed.push(at);
  } else {
    assert.notEqual(level, 'error', message);
  }
}

// A job repeats exactly the attempts whose process died, and fails by the third death, or by the limit of its time.
for (const job of jobs) {
  const { deaths, done, failed } = ofJob.get(job.id);
  const text = `${JSON.stringify(job)}: ${deaths.join('; ')}; ${done} done, ${failed.length} not`;
  const crashed = job.problem?.type === '/problems/job-crashed';
  const late = job.problem?.type === '/problems/timeout';
  assert.equal(deaths.length, job.attempt - (crashed ? 0 : 1), text);
  assert.equal(done, job.state === 'succeeded' ? 1 : 0, text);
  assert.equal(failed.length, deaths.length + (late ? 1 : 0), text);
  if (crashed) assert.ok(job.problem.detail.includes(deaths.at(-1).replace('the process of the job ', '')), text);
  if (late) effects.push({ ways: ['loop'], at: failed.at(-1), mesh: job.mesh, of: text });
}
// An upload fails by the death of a process that checks its file alone, or by the limit of its time.
for (const mesh of accepted) assert.equal(ofFile.get(mesh).alone, 0, mesh);
for (const { mesh, type, at } of refused) {
  const crashed = type === '/problems/job-crashed';
  assert.equal(ofFile.get(mesh).alone, crashed ? 1 : 0, `${mesh} ${type}`);
  if (!crashed) effects.push({ ways: ['loop'], at, of: `the upload of ${mesh}` });
}
for (const [mesh, { behind }] of ofFile) assert.ok(behind <= 1, mesh);
// No count of crashes that outlives the jobs is of more deaths than those of its job, or file.
assert.ok(
  records.split('\n').every((line) => !line || / crashes=\d+ .*mesh=\w/.test(line)),
  records,
);
for (const [, key, count, mesh] of records.matchAll(/^(\w+) crashes=(\d+) .*?mesh=(\w+)/gm)) {
  const own =
    key === mesh ? ofFile.get(mesh)?.alone : ofJob.get(jobs.find((job) => job.mesh === mesh)?.id)?.deaths.length;
  assert.ok(Number(count) <= own, `${key} of ${mesh} has ${count} crashes, ${own} in the log`);
}

// One death for each effect (a matching by augmenting paths), of the process of that job if one is known.
const known = died.filter(({ mesh }) => mesh);
const unknown = died.filter(({ mesh }) => !mesh);
const fits = (effect, death) =>
  effect.ways.includes(death.way) && death.at <= effect.at && (!death.mesh || death.mesh === effect.mesh);
function give(effect, tried) {
  for (const death of [...known, ...unknown]) {
    if (tried.has(death) || !fits(effect, death)) continue;
    tried.add(death);
    if (death.effect && !give(death.effect, tried)) continue;
    death.effect = effect;
    return true;
  }
  return false;
}
for (const effect of effects) assert.ok(give(effect, new Set()), `no death is left for: ${effect.of}`);
for (const { mesh, way, effect } of known)
  if (!effect)
    assert.equal(jobs.find((job) => job.mesh === mesh).state, 'succeeded', `${way} without an effect: ${mesh}`);

const again = jobs.reduce((sum, job) => sum + job.attempt - 1, 0);
const unfinished = jobs.filter((job) => job.state !== 'succeeded').length;
const counts = ways.map((way) => `${way} ${died.filter((death) => death.way === way).length}`).join(', ');
console.log(
  `${deaths} deaths in ${spent} s (${counts}) under ${clients} clients: ${jobs.length} jobs and ${accepted.size} uploads ` +
    `accepted, none lost, no connection dropped; ${again} attempts were repeated, ${unfinished} jobs and ${refused.length} ` +
    `uploads failed with their process; ${known.length} deaths were in the process of a known job, ` +
    `${known.filter(({ effect }) => effect).length} of them have an effect, all on that job; ` +
    `${effects.length} effects in all, each of a death of its own`,
);
