// Several nodes on one catalogue in PostgreSQL and one bucket of S3: what one accepts, others run and show; what happens
// to jobs when a node is killed or paused, when PostgreSQL or S3 goes away, and when connections are cut.
// Runs under tests/tools/with_postgresql.sh and with_s3.sh.
//
// ORB_ROUNDS (20) is the number of rounds of chaos, ORB_SEED (1) draws what happens in them.
import assert from 'node:assert/strict';
import { execFileSync, spawnSync } from 'node:child_process';
import { createHash } from 'node:crypto';
import { existsSync } from 'node:fs';
import path from 'node:path';
import test from 'node:test';
import { list } from '../tools/s3.mjs';
import { folder, runProgram } from './support/cli.mjs';
import { Cluster, LEASE } from './support/cluster.mjs';
import { Collector } from './support/collector.mjs';
import { assertProblem, daemon, endless, samples, until } from './support/daemon.mjs';
import { haproxy, lacksHaproxy } from './support/haproxy.mjs';
import { origin } from './support/origin.mjs';
import { busy, half, late, lost, pass, s3Proxy } from './support/s3_proxy.mjs';
import * as shapes from './support/shapes.mjs';

const rounds = Number(process.env.ORB_ROUNDS ?? 20);
const sleep = (ms) => new Promise((resolve) => setTimeout(resolve, ms));
const postgresql = (what) => execFileSync(process.env.ORB_POSTGRESQL_DO, [what], { stdio: 'ignore' });
let s3 = Number(process.env.ORB_S3_PID);

let seed = Number(process.env.ORB_SEED ?? 1);
function random(below) {
  seed = (Math.imul(seed, 1664525) + 1013904223) >>> 0;
  return Math.floor((seed / 2 ** 32) * below);
}

let meshes = 0;
function newMesh() {
  const n = ++meshes;
  return shapes.obj(shapes.ball(1, ([x, y, z]) => [x * (1 + 0.1 * Math.sin(n)), y, z + 0.001 * n]));
}

/** The events of a stream after a number, until `enough` is true of one. */
async function eventsOf(node, job, after, enough) {
  const over = new AbortController();
  const response = await fetch(new URL(`${job.url}/events`, node.url), {
    headers: after ? { 'last-event-id': `${after}` } : {},
    signal: over.signal,
  });
  assert.equal(response.status, 200);
  const events = [];
  let text = '';
  for await (const part of response.body.pipeThrough(new TextDecoderStream())) {
    text += part;
    for (let end; (end = text.indexOf('\n\n')) >= 0; text = text.slice(end + 2)) {
      const found = /^id: (\d+)\nevent: (\w+)\ndata: (.*)$/m.exec(text.slice(0, end));
      if (!found) continue;
      events.push({ number: Number(found[1]), type: found[2], job: JSON.parse(found[3]) });
      if (enough(events.at(-1))) {
        over.abort();
        return events;
      }
    }
  }
  return events;
}

/** Only nodes that watched a job remember its last stage. */
function sameEnd(one, other) {
  assert.deepEqual({ ...one, stage: null }, { ...other, stage: null });
}

const slowJob = async (node, scale = 1) =>
  (
    await node.post('/v1/embeddings', {
      mesh: (await node.upload(shapes.obj(shapes.ball(4, ([x, y, z]) => [x * scale, y, z])))).json.id,
      ...endless,
    })
  ).json;

test('what one node accepts, others run and show', async (t) => {
  const c = new Cluster(t);
  const traces = await Collector.start(t);
  const a = await c.node('--role', 'serve', '--traces', traces.url);
  const b = await c.node('--role', 'serve', '--traces', traces.url);
  const { id } = await a.mesh(path.join(samples, 'dog.obj'));
  assert.equal((await b.get(`/v1/meshes/${id}`)).status, 200);
  const reply = await a.post('/v1/embeddings', { mesh: id });
  assert.equal(reply.status, 202);
  const twice = await b.post('/v1/embeddings', { mesh: id });
  assert.equal(twice.status, 202);
  assert.equal(twice.json.id, reply.json.id); // one flight per key
  const w = await c.node('--role', 'work', '--metrics-listen', '127.0.0.1:0', '--traces', traces.url);
  for (const health of ['/livez', '/readyz']) assert.equal((await w.get(health)).status, 200);
  for (const other of ['/v1/meshes', '/', '/openapi.json', '/v1/morph.glb'])
    assertProblem(await w.get(other), 404, 'not-found', other);
  assertProblem(await w.post('/v1/embeddings', {}), 404, 'not-found');
  const [here, there] = await Promise.all([a.ended(reply.json), b.ended(reply.json)]);
  assert.equal(here.state, 'succeeded');
  sameEnd(there, here);
  const spheres = await Promise.all([a, b].map((node) => node.get(`${here.result}/sphere.ply`)));
  assert.equal(spheres[0].status, 200);
  assert.ok(spheres[0].bytes.equals(spheres[1].bytes));

  // A supermesh waits for an embedding that it lacks; any node sends its events, and each continues where the previous
  // one ended.
  const other = await b.upload(newMesh());
  const trace = '4bf92f3577b34da6a3ce929d0e0e4736';
  const merged = await b.post(
    '/v1/supermeshes',
    { shapes: [{ mesh: id }, { mesh: other.json.id }] },
    { headers: { traceparent: `00-${trace}-00f067aa0ba902b7-01` } },
  );
  assert.equal(merged.status, 202, merged.bytes.toString());
  const first = await eventsOf(a, merged.json, 0, (event) => event.type === 'progress');
  const rest = await eventsOf(b, merged.json, first.at(-1).number, () => false);
  assert.ok(rest.every((event, i) => event.number > (i ? rest[i - 1] : first.at(-1)).number));
  assert.equal(rest.at(-1).type, 'succeeded');
  sameEnd((await a.get(merged.json.url)).json, rest.at(-1).job);
  assert.equal(
    (await a.get(`${merged.json.url}/events`, { headers: { 'last-event-id': `${rest.at(-1).number}` } })).status,
    204,
  );

  // Two nodes took part in the job, and one trace has both.
  const of = (span) => span.trace === trace;
  const names = ['POST /v1/supermeshes', 'embedding job', 'supermesh job'];
  await until(() => names.every((name) => traces.named(name, of).length > 0), 'the spans of request and jobs');
  const [asked] = traces.named('POST /v1/supermeshes', of);
  const [ran] = traces.named('supermesh job', of);
  assert.equal(ran.parent, asked.id);
  assert.deepEqual(
    [asked, ran].map(({ resource }) => resource['orbmorph.role']),
    ['serve', 'work'],
  );
  assert.ok(traces.named('remesh', of).every(({ parent }) => parent === ran.id));
  assert.equal(traces.named('embedding job', of)[0].parent, asked.id);

  // The node that has done the work counts it; nodes that only serve the result do not.
  const done = async (node) =>
    /^orbmorph_jobs_ended_total\{state="succeeded"\} (\d+)$/m.exec((await node.get('/metrics')).bytes)[1];
  assert.ok(Number(await done(w)) >= 3);
  const merges = async (node) =>
    /^orbmorph_job_seconds_count\{kind="supermesh"\} (\d+)$/m.exec((await node.get('/metrics')).bytes)[1];
  assert.deepEqual([await merges(a), await merges(b), await merges(w)], ['0', '0', '1']);

  // A resource deleted on one node is gone on all.
  const gone = rest.at(-1).job.result;
  assert.equal((await a.get(gone)).status, 200);
  assert.equal((await b.delete(gone)).status, 204);
  await until(async () => (await a.get(gone)).status === 404, 'it is gone', 10);
  assert.match(await c.check(), / 0 wrong, 0 objects without a row/);
  if (lacksHaproxy) t.diagnostic(lacksHaproxy);
  else await behindHaproxy(t, [a, b]);
});

test('the same requests give the same ids and bytes as one daemon on SQLite and files', async (t) => {
  const c = new Cluster(t);
  const alone = await daemon(t, { program: [process.env.ORB_DAEMON] });
  const nodes = [await c.node('--workers', '1'), await c.node('--role', 'serve')];
  const pair = [shapes.obj(shapes.egg(3)), shapes.binaryPly(shapes.bean(3))];
  const results = [];
  for (const [one, other] of [[alone, alone], nodes]) {
    const found = [];
    const keep = async (target) => {
      const reply = await one.get(target);
      assert.equal(reply.status, 200, target);
      found.push([target, createHash('sha256').update(reply.bytes).digest('hex')]);
    };
    const meshes = [];
    for (const bytes of pair) meshes.push((await other.upload(bytes)).json);
    for (const { url } of meshes) await keep(`${url}/file`);
    for (const { id } of meshes) {
      const { url } = await other.made('/v1/embeddings', { mesh: id });
      await keep(`${url}/sphere.ply`);
    }
    for (const remesh of ['overlay', 'adaptive']) {
      const wanted = { shapes: meshes.map(({ id }) => ({ mesh: id })), remesh: { method: remesh } };
      const { url } = await other.made('/v1/supermeshes', wanted);
      await keep(`${url}/asset.glb`);
      await keep(`${url}/asset.glb?profile=quantized`);
    }
    results.push(found);
  }
  assert.deepEqual(results[1], results[0]);
});

test('a node of a newer version does not start beside older ones', async (t) => {
  const c = new Cluster(t);
  const a = await c.node('--role', 'serve');
  c.sql('UPDATE catalogue SET schema=schema-1'); // as if that node were of an older version
  const older = c.sql('SELECT schema FROM catalogue');
  await assert.rejects(c.node('--role', 'serve'), /the daemon did not start: exit 78/);
  const newer = c.nodes.pop();
  assert.match(newer.log, /has the older schema \d+, and daemons that need it run/);
  assert.equal(c.sql('SELECT schema FROM catalogue'), older);
  assert.equal((await a.upload(newMesh())).status, 201);
  c.sql('UPDATE catalogue SET schema=schema+1');
});

test('a node with another catalogue than the owner of its bucket is refused, and nothing is written', async (t) => {
  const c = new Cluster(t);
  await (await c.node()).upload(newMesh());
  const other = new Cluster(t);
  const tables = () => other.sql('SELECT count(*) FROM information_schema.tables WHERE table_schema=current_schema()');
  const refused = async (why, catalogue = other.catalogue, bucket = c.bucket) => {
    const data = await folder(t);
    const args = ['--listen', '127.0.0.1:0', '--data', data, '--catalogue', catalogue, '--objects', bucket];
    const { status, stderr, stdout } = spawnSync(process.env.ORB_DAEMON, args, { encoding: 'utf8', timeout: 60_000 });
    assert.equal(status, 78, stderr);
    assert.match(stderr, why);
    assert.equal(stdout, '');
    for (const name of ['catalogue.postgresql', 'objects.s3', 'catalogue.sqlite'])
      assert.ok(!existsSync(path.join(data, name)), name);
  };
  await refused(/belongs to another deployment: the database of --catalogue has no catalogue/);
  assert.equal(tables(), '0');
  // A catalogue of its own, of an older version: it is not migrated.
  await (await other.node('--role', 'serve')).stop();
  const older = other.sql('UPDATE catalogue SET schema=schema-1 RETURNING schema');
  await refused(/belongs to another catalogue/);
  assert.equal(other.sql('SELECT schema FROM catalogue'), older);
  // A wrong prefix: objects would be in two places.
  await refused(/has none of the objects of this catalogue/, c.catalogue, c.bucket.replace('?', 'x?'));
  assert.deepEqual(await list(process.env.ORB_S3, 'objects', `${/objects\/(.*)\?/.exec(c.bucket)[1]}x/`), []);
  assert.match(await c.check(), /^1 rows and 1 objects checked: 0 wrong, 0 objects without a row/);
});

test('one --gc or --check-data works on a catalogue at a time', async (t) => {
  const c = new Cluster(t);
  const proxy = await s3Proxy(t, process.env.ORB_S3, () => pass);
  await (await c.node('--role', 'serve')).upload(newMesh());
  let release;
  let came;
  const held = new Promise((resolve) => (release = resolve));
  t.after(() => release(pass));
  const works = new Promise((resolve) => (came = resolve));
  proxy.decide = ({ method, path: at }) => {
    if (method !== 'GET' || !/mesh/.test(at)) return pass;
    came();
    return held;
  };
  const run = async (command, endpoint) => {
    const objects = c.bucket.replace(process.env.ORB_S3, endpoint);
    const args = [command, '--data', await folder(t), '--catalogue', c.catalogue, '--objects', objects];
    return runProgram(process.env.ORB_DAEMON, args);
  };
  const first = run('--check-data', proxy.url);
  await works;
  for (const command of ['--gc', '--check-data']) {
    const { code, out } = await run(command, process.env.ORB_S3);
    assert.equal(code, 1, out);
    assert.match(out, /another --gc or --check-data works on this catalogue/);
  }
  release(pass);
  assert.match((await first).out, /^1 rows and 1 objects checked: 0 wrong/);
  assert.equal((await run('--gc', process.env.ORB_S3)).code, 0);
});

/** Clients of haproxy do not miss a node that is killed. */
async function behindHaproxy(t, [a, b]) {
  const p = await haproxy(
    t,
    [a, b].map(({ url }) => url),
  );
  const asked = [];
  for (let i = 0; i < 4; i++) asked.push((await p.get('/v1/meshes')).status);
  assert.deepEqual(asked, [200, 200, 200, 200]);
  const job = await slowJob(p);
  const seen = await eventsOf(p, job, 0, () => true);
  a.killed = true;
  await a.stop('SIGKILL');
  const mesh = await p.upload(newMesh());
  assert.equal(mesh.status, 201);
  const rest = eventsOf(p, job, seen.at(-1).number, ({ type }) => type === 'cancelled');
  assert.equal((await p.get(job.url)).json.state, 'running');
  assert.equal((await p.delete(job.url)).json.state, 'cancelled');
  const events = await rest;
  assert.ok(events.every(({ number }) => number > seen.at(-1).number));
  assert.equal(events.at(-1).type, 'cancelled');
  const made = await p.made('/v1/embeddings', { mesh: mesh.json.id });
  assert.equal((await p.get(`/v1/embeddings/${made.id}/sphere.ply`)).status, 200);
}

test('what a client may ask holds over all nodes together', { skip: lacksHaproxy }, async (t) => {
  const c = new Cluster(t);
  const nodes = [await c.node('--role', 'serve'), await c.node('--role', 'serve')];
  const p = await haproxy(
    t,
    nodes.map(({ url }) => url),
  );
  const served = async (node) => {
    const { bytes } = await node.get('/metrics');
    return Number(/^orbmorph_http_responses_total\{class="2xx"\} (\d+)/m.exec(bytes.toString())[1]);
  };
  const count = { 200: 0, 429: 0 };
  const began = Date.now();
  while (Date.now() - began < 8000 && !count[429]) {
    const replies = await Promise.all(Array.from({ length: 20 }, () => p.get('/livez')));
    for (const { status } of replies) count[status]++;
  }
  // 1,000 in ten seconds. A machine that is too slow to ask so often tells nothing.
  if (!count[429]) return t.skip(`${count[200]} requests in 8 s`);
  assert.ok(count[200] > 900 && count[200] <= 1000, `${count[200]} requests were served`);
  const each = await Promise.all(nodes.map(served));
  assert.ok(
    each.every((n) => n > 100),
    `${each}`,
  );
});

test('any node cancels a job; a node that is killed loses its jobs to others', async (t) => {
  const c = new Cluster(t);
  const a = await c.node('--role', 'serve');
  const b = await c.node('--role', 'serve');
  const first = await c.node('--role', 'work', '--workers', '1');
  const jobs = [await slowJob(a), await slowJob(a, 1.1)];
  const running = await until(async () => {
    const all = await Promise.all(jobs.map(async (job) => (await b.get(job.url)).json));
    return all.find((job) => job.state === 'running');
  }, 'one runs');
  const queued = jobs.find((job) => job.id !== running.id);
  assert.equal((await b.delete(queued.url)).json.state, 'cancelled');
  await until(async () => (await a.get(queued.url)).json.state === 'cancelled', 'the other node knows', 10);

  first.killed = true;
  await first.stop('SIGKILL');
  const second = await c.node('--role', 'work', '--workers', '1');
  const again = await until(
    async () => {
      const { json } = await a.get(running.url);
      return json.state === 'running' && json.attempt !== running.attempt && json;
    },
    'the other node runs it',
    60,
  );
  assert.equal(await c.runner(again), second);
  assert.deepEqual([running.attempt, again.attempt], [1, 2]);
  assert.equal(c.sql(`SELECT suspect, alone, crashes FROM job WHERE id='${again.id}'`), '1|1|0'); // it was not alone
  assert.equal((await b.delete(running.url)).json.state, 'cancelled');
  assert.equal((await a.delete(running.url)).json.state, 'cancelled'); // again, on another node
});

test('a node that was paused beyond its lease drops what it made; others have made it', async (t) => {
  const c = new Cluster(t);
  const serve = await c.node('--role', 'serve');
  const works = [await c.node('--role', 'work'), await c.node('--role', 'work')];
  for (const work of works) assert.match(work.out, /works without a port/);
  const ids = [];
  for (const name of ['dog.obj', 'giraffe.off']) ids.push((await serve.mesh(path.join(samples, name))).id);
  for (const mesh of ids) await serve.made('/v1/embeddings', { mesh });
  const { json } = await serve.post('/v1/supermeshes', { shapes: ids.map((mesh) => ({ mesh })) });
  const paused = await c.runner(json);
  paused.child.kill('SIGSTOP');
  const done = await serve.ended(json);
  assert.equal(done.state, 'succeeded');
  assert.equal(done.attempt, 2);
  assert.equal(c.sql(`SELECT crashes FROM job WHERE id='${json.id}'`), '0'); // it was not alone on the node that fell silent
  const asset = await serve.get(`${done.result}/asset.glb`);
  assert.equal(asset.status, 200);
  paused.child.kill('SIGCONT');
  await until(() => /has lost it/.test(paused.log), 'it finds that it has lost the job', 120);
  sameEnd((await serve.get(json.url)).json, done);
  const ends = c.sql(
    `SELECT count(*) FROM event WHERE job='${json.id}' AND type IN ('succeeded','failed','cancelled')`,
  );
  assert.equal(ends, '1');
  await serve.made('/v1/embeddings', { mesh: (await serve.upload(newMesh())).json.id });
  assert.equal(works.length, 2);
  await c.check();
});

test('while PostgreSQL is unreachable, requests get 503 and running jobs lose nothing', async (t) => {
  const c = new Cluster(t);
  const a = await c.node();
  const ids = [];
  for (const name of ['dog.obj', 'giraffe.off']) ids.push((await a.mesh(path.join(samples, name))).id);
  for (const mesh of ids) await a.made('/v1/embeddings', { mesh });
  const { json } = await a.post('/v1/supermeshes', { shapes: ids.map((mesh) => ({ mesh })) });
  await c.runner(json);
  const file = `/v1/meshes/${ids[0]}/file`;
  const known = await a.get(file);
  assert.equal(known.status, 200);
  postgresql('stop');
  const reply = await a.upload(newMesh());
  assertProblem(reply, 503, 'unavailable');
  assert.ok(Number(reply.headers.get('retry-after')) > 0);
  const ready = await until(async () => {
    const found = await a.get('/readyz');
    return found.status === 503 && found;
  }, 'it is not ready');
  assert.match(ready.json.detail, /PostgreSQL/);
  const still = await a.get(file); // from the memory and the cache of the node
  assert.equal(still.status, 200, still.bytes.toString());
  assert.ok(still.bytes.equals(known.bytes));
  await until(() => /supermesh job (done|did not succeed)/.test(a.log), 'the job has run', 300);
  postgresql('start');
  await until(async () => (await a.get('/readyz')).status === 200, 'it is ready', 60);
  const done = await a.ended(json);
  assert.equal(done.state, 'succeeded');
  assert.equal(done.attempt, 1);
  assert.equal(a.log.match(/supermesh job done/g).length, 1); // its results were not computed again
  c.cut();
  assert.equal((await a.upload(newMesh())).status, 201);
  await c.check();
});

test('a deletion that comes to S3 late deletes nothing that another node has published since', async (t) => {
  const c = new Cluster(t);
  const proxy = await s3Proxy(t, process.env.ORB_S3, () => pass);
  const b = await c.node('--role', 'serve');
  c.objects = c.bucket.replace(process.env.ORB_S3, proxy.url);
  const a = await c.node('--role', 'serve');
  const body = newMesh();
  const mesh = (await a.upload(body)).json;
  let release;
  let sent;
  const held = new Promise((resolve) => (release = resolve));
  t.after(() => release(pass));
  const came = new Promise((resolve) => (sent = resolve));
  proxy.decide = ({ method }) => {
    if (method !== 'DELETE') return pass;
    sent();
    return held; // as if the node had been stopped before it sent it
  };
  const deleted = a.delete(mesh.url);
  await came;
  assert.equal(c.cutLock(), '1');
  const again = await b.upload(body);
  assert.equal(again.status, 201);
  assert.equal(again.json.id, mesh.id);
  release(pass);
  assert.equal((await deleted).status, 204);
  assert.match(await c.check(), /^1 rows and 1 objects checked: 0 wrong, 0 objects without a row/);
  assert.match(a.log, /request came too late/);
});

test('a download whose node loses its lock again and again runs again', async (t) => {
  const c = new Cluster(t);
  const proxy = await s3Proxy(t, process.env.ORB_S3, () => pass);
  c.objects = c.bucket.replace(process.env.ORB_S3, proxy.url);
  const node = await c.node('--fetch-allow', '127.0.0.1');
  const body = newMesh();
  const { url } = await origin(t, (_, response) => response.end(body));
  let cuts = 0;
  // Between publishing and the commit of the row: at the upload, and whenever the node checks that the object still
  // exists.
  proxy.decide = ({ method, path: at }) => {
    if (cuts < 5 && /mesh/.test(at) && (method === 'PUT' || method === 'HEAD')) {
      c.cutLock();
      cuts++;
    }
  };
  const job = await node.post('/v1/meshes', { url });
  assert.equal(job.status, 202);
  const done = await node.ended(job.json);
  assert.equal(done.state, 'succeeded', JSON.stringify(done));
  assert.equal(cuts, 5);
  assert.match(await c.check(), /^1 rows and 1 objects checked: 0 wrong/);
});

/** The promises made to clients of the cluster. */
class Ledger {
  jobs = new Map(); // url → job
  meshes = [];
  hashes = new Map(); // url of a result → its hash

  constructor(cluster) {
    this.cluster = cluster;
  }

  async submit(node) {
    const mesh = await node.upload(newMesh());
    if (mesh.status !== 201) return;
    this.meshes.push(mesh.json.id);
    await this.ask(node, '/v1/embeddings', { mesh: mesh.json.id });
    if (this.meshes.length % 3) return;
    const shapes = [this.meshes.at(-2), mesh.json.id].map((id) => ({ mesh: id }));
    await this.ask(node, '/v1/supermeshes', { shapes, align: { method: 'rotate' } });
  }

  async ask(node, target, request) {
    const reply = await node.post(target, request);
    if (reply.status === 202) this.jobs.set(reply.json.url, reply.json);
  }

  /** Clients give up on an error, and try the next node. */
  async client(nodes, until) {
    while (Date.now() < until) await this.submit(nodes[random(nodes.length)]).catch(() => sleep(20));
  }

  async settle(nodes) {
    for (const job of this.jobs.values()) {
      const done = await nodes[random(nodes.length)].ended(job, { seconds: 60 });
      assert.equal(done.state, 'succeeded', JSON.stringify(done));
      const url = `${done.result}/${done.kind === 'embedding' ? 'sphere.ply' : 'asset.glb'}`;
      const [one, other] = await Promise.all(nodes.slice(0, 2).map((node) => node.get(url)));
      assert.equal(one.status, 200, `${url}: ${one.bytes.toString().slice(0, 300)}`);
      const hash = createHash('sha256').update(one.bytes).digest('hex');
      assert.equal(createHash('sha256').update(other.bytes).digest('hex'), hash);
      assert.equal(this.hashes.get(url) ?? hash, hash, 'the bytes have changed');
      this.hashes.set(url, hash);
    }
  }
}

test('no chaos loses an accepted job, or changes what it made', async (t) => {
  const c = new Cluster(t);
  const proxy = await s3Proxy(t, process.env.ORB_S3, () => pass);
  c.objects = c.bucket.replace(process.env.ORB_S3, proxy.url);
  const serve = [await c.node('--workers', '1'), await c.node('--workers', '1')];
  const work = await c.node('--role', 'work', '--workers', '1');
  const all = [...serve, work];
  const ledger = new Ledger(c);
  const pauses = [];
  const actions = {
    async kill(node) {
      node.killed = true;
      await node.stop('SIGKILL');
      await node.start();
    },
    /** For longer than its lease, while the next rounds continue. */
    async pause(node) {
      const { child } = node;
      child.kill('SIGSTOP');
      pauses.push(sleep(1000 * LEASE + 500).then(() => child.kill('SIGCONT')));
    },
    async cut() {
      c.cut();
    },
    async database() {
      postgresql('stop');
      await sleep(300);
      postgresql('start');
    },
    async objects() {
      process.kill(s3, 'SIGKILL');
      await sleep(300);
      s3 = Number(execFileSync(process.env.ORB_S3_START, { encoding: 'utf8' }));
      await until(() => fetch(process.env.ORB_S3).catch(() => 0), 'S3 is back', 60);
    },
    async answers() {
      const troubles = [busy, half, lost, late, pass];
      proxy.decide = () => troubles[random(troubles.length)];
      await sleep(700);
      proxy.decide = () => pass;
    },
  };
  const order = Object.keys(actions);
  const first = random(order.length); // so that few rounds of another seed begin elsewhere
  const began = Date.now();
  for (let round = 0; round < rounds; round++) {
    const clients = [1, 2].map(() => ledger.client(serve, Date.now() + 300));
    await sleep(random(300));
    await actions[order[(first + round) % order.length]](all[random(all.length)]);
    await Promise.all(clients);
  }
  await Promise.all(pauses);
  const seconds = ((Date.now() - began) / 1000).toFixed(0);
  for (const node of serve) await until(async () => (await node.get('/readyz')).status === 200, 'a node is ready', 60);
  await ledger.settle(serve);
  assert.ok(ledger.jobs.size >= rounds, `${ledger.jobs.size} jobs`);
  const twice = c.sql(
    "SELECT count(*) FROM (SELECT job FROM event WHERE type IN ('succeeded','failed','cancelled') GROUP BY job HAVING count(*)>1) AS x",
  );
  assert.equal(twice, '0');
  assert.equal(c.sql('SELECT count(*) FROM job WHERE state<2'), '0');
  const again = c.sql('SELECT count(*) FROM job WHERE attempt>1');
  const found = await c.check();
  t.diagnostic(
    `${rounds} rounds in ${seconds} s: ${ledger.jobs.size} jobs, ${again} ran again; ${found.split('\n')[0]}`,
  );
});
