// Kills the daemon (kill -9) under load, repeatedly, at random instants and at every named point of the code.
// Afterwards no accepted job is lost or ends twice, no object is incomplete, and --check-data passes.
//
// ORB_KILLS (20) is the number of kills. Named points need a build with ORB_FAULTS (the presets faults and asan); with
// others, all kills are at random instants. ORB_SEED chooses the instants.
import assert from 'node:assert/strict';
import { execFile } from 'node:child_process';
import { createHash } from 'node:crypto';
import { readdirSync, readFileSync } from 'node:fs';
import { mkdtemp, rm } from 'node:fs/promises';
import { tmpdir } from 'node:os';
import path from 'node:path';
import test from 'node:test';
import { promisify } from 'node:util';
import { binaries, Daemon, daemon, patience, root, slow } from './support/daemon.mjs';
import * as shapes from './support/shapes.mjs';

const kills = Number(process.env.ORB_KILLS ?? 20);
const faults = process.env.ORB_FAULTS === '1';
const run = promisify(execFile);
const sleep = (ms) => new Promise((resolve) => setTimeout(resolve, ms));

let seed = Number(process.env.ORB_SEED ?? 1);
function random() {
  seed = (Math.imul(seed, 1664525) + 1013904223) >>> 0;
  return seed / 2 ** 32;
}
const pick = (list) => list[Math.floor(random() * list.length)];

/** Every FAULT_POINT("…") of the server. */
function pointsOf(folder) {
  return readdirSync(folder, { withFileTypes: true }).flatMap((entry) => {
    const at = path.join(folder, entry.name);
    if (entry.isDirectory()) return pointsOf(at);
    return at.endsWith('.c')
      ? [...readFileSync(at, 'utf8').matchAll(/FAULT_POINT\("([^"]+)"\)/g)].map((m) => m[1])
      : [];
  });
}
// This load reaches none of these: webhooks, S3, copies between stores, and checks and conversions in a separate process.
const elsewhere = ['check-begun', 'convert-begun', 'publish-uploaded', 'transfer', 'webhook-answered'];
const points = [...new Set(pointsOf(path.join(root, 'server')))]
  .filter((name) => !elsewhere.includes(name) && !name.startsWith('move-'))
  .sort();

let made = 0;
function newMesh() {
  const n = ++made;
  return shapes.obj(shapes.ball(1, ([x, y, z]) => [x * (1 + 0.1 * Math.sin(n)), y, z + 0.001 * n]));
}

/** Records what the daemon accepted, to check the daemon against it. */
class Ledger {
  meshes = new Map(); // url → SHA-256 of its file
  jobs = new Map(); // url → job of a 202 whose end is not yet known
  ends = new Map(); // url → state seen
  gone = new Set(); // urls of deleted meshes and embeddings
  asked = new Set(); // urls whose deletion was requested: until the answer, they may exist or not

  async upload(d) {
    const text = newMesh();
    const reply = await d.upload(text, { name: 'm' });
    assert.ok([200, 201].includes(reply.status), reply.bytes.toString());
    this.meshes.set(reply.json.url, createHash('sha256').update(text).digest('hex'));
    return reply.json;
  }

  async ask(d, target, body) {
    const reply = await d.post(target, body);
    assert.ok([200, 202].includes(reply.status), reply.bytes.toString());
    if (reply.status === 202) this.jobs.set(reply.json.url, reply.json);
    return reply;
  }

  async remove(d, url) {
    this.asked.add(url);
    const reply = await d.delete(url);
    if (reply.status === 409) return; // a job needs it
    assert.ok([204, 404].includes(reply.status), reply.bytes.toString());
    this.gone.add(url);
    this.meshes.delete(url);
  }

  /** One client: uploads, requests, reads and deletes until the daemon is gone. */
  async call(d) {
    try {
      for (;;) {
        const [a, b] = [await this.upload(d), await this.upload(d)];
        await this.ask(d, '/v1/embeddings', { mesh: a.id });
        await this.ask(d, '/v1/supermeshes', {
          shapes: [{ mesh: a.id }, { mesh: b.id }],
          align: { method: 'rotate' },
          remesh: { method: 'overlay' },
        });
        const merged = await d.get(
          `/v1/morph.glb?shapes=${a.id},${b.id}&align=rotate&remesh=overlay&profile=meshopt&wait=1`,
        );
        assert.ok([200, 503].includes(merged.status), merged.bytes.toString());
        await d.get('/v1/jobs', { query: { limit: 5 } });
        const c = await this.upload(d);
        const embedding = await this.ask(d, '/v1/embeddings', { mesh: c.id });
        const job = await d.get(embedding.json.url, { query: { wait: 1 } });
        if (job.json.state === 'succeeded') {
          await this.remove(d, job.json.result);
          await this.remove(d, c.url);
        }
      }
    } catch (error) {
      if (error instanceof assert.AssertionError) throw error; // a wrong answer, not a broken connection
    }
  }

  /** Every accepted job is known, ends well, has one result and one last event. */
  async settle(d) {
    for (const [url, accepted] of [...this.jobs]) {
      const reply = await d.get(url);
      assert.equal(reply.status, 200, `the accepted job ${url} is lost: ${reply.bytes}`);
      const end = await d.ended(reply.json);
      assert.equal(end.state, 'succeeded', `the end of the daemon is not a crash of the job: ${JSON.stringify(end)}`);
      assert.equal(end.kind, accepted.kind);
      this.jobs.delete(url);
      this.ends.set(url, end.state);
      if (!this.asked.has(end.result)) assert.equal((await d.get(end.result)).status, 200, end.result);
      const events = (await d.get(`${url}/events`)).bytes.toString();
      const last = events.match(/^event: (succeeded|failed|cancelled)$/gm) ?? [];
      assert.equal(last.length, 1, `${url} ended ${last.length} times:\n${events}`);
      const numbers = [...events.matchAll(/^id: (\d+)$/gm)].map((m) => Number(m[1]));
      assert.deepEqual(
        numbers,
        [...new Set(numbers)].sort((a, b) => a - b),
        events,
      );
    }
  }

  /** Every resource is listed once, meshes have the uploaded bytes, deleted resources are gone. */
  async audit(d) {
    for (const kind of ['meshes', 'embeddings', 'supermeshes', 'jobs']) {
      const ids = [];
      for (let token = null, first = true; first || token; first = false) {
        const { json } = await d.get(`/v1/${kind}`, { query: { limit: 1000, ...(token && { page_token: token }) } });
        ids.push(...json[kind].map((x) => x.id));
        token = json.next_page_token;
      }
      assert.equal(new Set(ids).size, ids.length, `${kind}: one is there twice`);
      if (kind === 'jobs')
        for (const url of this.ends.keys()) assert.ok(ids.includes(url.split('/').pop()), `${url} is not listed`);
    }
    for (const [url, sha] of this.meshes) {
      const file = await d.get(`${url}/file`);
      if (this.asked.has(url) && file.status === 404) continue;
      assert.equal(file.status, 200, `the accepted mesh ${url} is lost`);
      assert.equal(createHash('sha256').update(file.bytes).digest('hex'), sha, 'its bytes are others');
    }
    for (const url of this.gone) assert.equal((await d.get(url)).status, 404, `${url} was deleted and is back`);
  }
}

async function checkData(d) {
  const { stdout } = await run(binaries.daemon, ['--check-data', '--data', d.data]).catch((error) =>
    assert.fail(`--check-data: ${error.stdout}${error.stderr}`),
  );
  assert.match(stdout, / 0 wrong/);
}

const gone = (d) => d.child.exitCode !== null || d.child.signalCode !== null;

/** Waits until the daemon dies, and kills it after `ms`. Returns whether the named point killed it. */
async function dies(d, ms) {
  const timer = sleep(ms).then(() => false);
  const byPoint = await Promise.race([d.exited.then(() => true), timer]);
  if (!byPoint) await d.stop('SIGKILL');
  assert.equal((await d.exited).signal, 'SIGKILL', `it died of something else\n${d.log}`);
  return byPoint;
}

test(`${kills} kills under load lose nothing`, async (t) => {
  const hit = new Map(points.map((name) => [name, 0]));
  const began = Date.now();
  let done = 0;
  let random_kills = 0;
  let accepted = 0;
  let uploads = 0;
  let slowest = 0;
  while (done < kills) {
    const data = await mkdtemp(path.join(tmpdir(), 'orbmorph-crash-'));
    const d = new Daemon(data, ['--workers', '2'], {});
    t.after(() => d.child?.kill('SIGKILL'));
    const ledger = new Ledger();
    const life = Math.min(50, kills - done); // then a new folder, so that starts stay quick
    for (let i = 0; i < life; i++, done++) {
      // The first kill in a new folder comes while the schema is made. Then kills alternate: at an instant after all
      // waiting jobs have ended, and at a named point or any instant, also during recovery. So no job runs alone in
      // three crashes in a row.
      const least = Math.min(...[...hit].filter(([name]) => name !== 'migrate').map(([, n]) => n)); // the points seen least come first
      const point =
        faults && i === 0
          ? 'migrate'
          : faults && i % 2 === 1
            ? pick(points.filter((name) => hit.get(name) === least && name !== 'migrate'))
            : null;
      const nth = 1 + Math.floor(random() * (hit.get(point) > 0 ? 8 : 2));
      d.env = point ? { ORBMORPH_FAULT: `kill:${point}:${nth}` } : {};
      try {
        await d.start();
      } catch (error) {
        if (!point || !/exit SIGKILL/.test(error.message)) throw error;
        hit.set(point, hit.get(point) + 1); // it died during the start
        continue;
      }
      slowest = Math.max(slowest, d.start_cpu_ms);
      if (i % 2 === 0) await ledger.settle(d);
      const load = Promise.all([ledger.call(d), ledger.call(d)]);
      const byPoint = await dies(d, point ? 1500 : random() * (slow ? 600 : 400));
      await load;
      if (byPoint && point) hit.set(point, hit.get(point) + 1);
      else random_kills++;
      if (i % 5 === 4) await checkData(d);
    }
    d.env = {};
    await d.start();
    await ledger.settle(d);
    await ledger.audit(d);
    const { code } = await d.stop();
    assert.equal(code, 0, d.log);
    await checkData(d);
    accepted += ledger.ends.size;
    uploads += ledger.meshes.size + ledger.gone.size;
    await rm(data, { recursive: true, force: true });
  }
  const named = [...hit].map(([name, n]) => `${name} ${n}`).join(', ');
  t.diagnostic(
    `${done} kills in ${((Date.now() - began) / 1000).toFixed(0)} s: ${random_kills} at random instants, ` +
      `${done - random_kills} at named points (${faults ? named : 'not in this build'}); ${accepted} accepted jobs, ${uploads} meshes, ` +
      `none lost; slowest start ${slowest} ms of processor time`,
  );
  assert.ok(slowest < 10_000, `a start took ${slowest} ms of processor time`);
  if (faults && kills >= 10 * points.length)
    for (const [name, n] of hit) assert.ok(n > 0, `the point ${name} was never reached`);
});

test('20 kills of the daemon under 200 jobs: each of them succeeds', async (t) => {
  const [count, times] = slow ? [60, 6] : [200, 20];
  const d = await daemon(t, { args: ['--workers', '2'] });
  d.killed = true;
  const meshes = [];
  for (let i = 0; i < count; i++) meshes.push((await d.upload(newMesh(), { name: `m${i}` })).json);
  const jobs = await Promise.all(
    meshes.map(async ({ id }) => {
      const reply = await d.post('/v1/embeddings', { mesh: id });
      assert.equal(reply.status, 202, reply.bytes.toString());
      return reply.json;
    }),
  );
  for (let kill = 0; kill < times; kill++) {
    await sleep(100 * random());
    await d.stop('SIGKILL');
    await d.start();
  }
  for (const job of jobs) {
    const reply = await d.get(job.url);
    assert.equal(reply.status, 200, `${job.url} is lost`);
    const end = await d.ended(reply.json);
    assert.equal(end.state, 'succeeded', JSON.stringify(end));
  }
});

test('a job that crashes the daemon three times fails, and other jobs go on', {
  skip: !faults && 'needs a build with ORB_FAULTS',
}, async (t) => {
  // in a separate process the job would end only that process: scenario.isolate
  const d = await daemon(t, { args: ['--workers', '2', '--isolate', 'off'] });
  const ledger = new Ledger();
  const mesh = await ledger.upload(d);
  const key = (await d.made('/v1/embeddings', { mesh: mesh.id })).id;
  await d.delete(`/v1/embeddings/${key}`);
  d.killed = true;
  await d.stop();
  d.env = { ORBMORPH_FAULT: `kill:${key}:1+` };
  await d.start();
  const others = [];
  for (let i = 0; i < 3; i++) others.push(await ledger.upload(d));
  await ledger.ask(d, '/v1/embeddings', { mesh: mesh.id }).catch(() => {});
  let deaths = 0;
  let end;
  for (const late = Date.now() + 300_000 * patience; !end && deaths < 12; ) {
    assert.ok(Date.now() < late, `${deaths} deaths, and neither another nor an end`);
    for (const other of others) await ledger.ask(d, '/v1/embeddings', { mesh: other.id }).catch(() => {});
    const { json } = await d.get('/v1/jobs').catch(() => ({}));
    end = json?.jobs.find((job) => job.state === 'failed');
    if (!end) await Promise.race([d.exited, sleep(500)]);
    while (gone(d)) {
      deaths++;
      await d.start().catch((error) => assert.match(error.message, /exit SIGKILL/)); // it died again before it could report that
    }
  }
  assert.equal(end?.problem.type, '/problems/crashed');
  assert.ok(deaths >= 3 && deaths < 12, `${deaths} deaths`);
  for (const other of others) await d.made('/v1/embeddings', { mesh: other.id });
  d.killed = true;
  await d.stop();
  d.env = {};
  await d.start();
  await d.made('/v1/embeddings', { mesh: mesh.id }); // a caller may ask again if the cause is gone
});
