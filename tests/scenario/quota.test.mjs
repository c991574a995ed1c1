// The quota of derived bytes: the results of a tenant's jobs count, are refused beyond the quota, and stop counting
// when they are deleted.
import assert from 'node:assert/strict';
import { execFile } from 'node:child_process';
import test from 'node:test';
import { promisify } from 'node:util';
import { assertProblem, binaries, daemon, endless, slow } from './support/daemon.mjs';
import { ownMegabytes } from './support/processes.mjs';
import * as shapes from './support/shapes.mjs';

const QUOTA = 100 << 10;
const ball = (k, level = 2) =>
  Buffer.from(shapes.obj(shapes.ball(level, ([x, y, z]) => [x * (1 + 0.2 * Math.sin(5 * y + k)), y, z])));
const vary = (mesh, k) => ({ mesh, method: 'newton', options: { energy_weight: 0.5 + k / 1000 } });

async function tenants(t, ...args) {
  const d = await daemon(t, { args: ['--auth', 'on', ...args] });
  const token = async (...words) =>
    (await promisify(execFile)(binaries.daemon, ['token', ...words, '--data', d.data])).stdout.trim();
  const add = async (name, ...more) => ({
    headers: { authorization: `Bearer ${await token('add', name, '--scope', 'read,write', ...more)}` },
  });
  const upload = async (who, k, level) => (await d.post('/v1/meshes', ball(k, level), who)).json.id;
  const embed = async (who, mesh, k, wait = 30) =>
    d.post('/v1/embeddings', vary(mesh, k), { headers: { ...who.headers, prefer: `wait=${wait}` } });
  /** The bytes of all spheres of a tenant: the sum of the lengths of the served files. */
  const stored = async (who) => {
    let sum = 0;
    const { embeddings } = (await d.get('/v1/embeddings', { ...who, query: { limit: 200 } })).json;
    for (const { url } of embeddings) sum += (await d.get(`${url}/sphere.ply`, who)).bytes.length;
    return { sum, count: embeddings.length, embeddings };
  };
  return { d, token, add, upload, embed, stored };
}

test('embeddings that only differ in an option are refused after the quota', async (t) => {
  const { d, token, add, upload, embed, stored } = await tenants(t);
  const ann = await add('ann', '--quota', '1M', '--quota-derived', '100K');
  const bob = await add('bob');
  const [mesh, same] = [await upload(ann, 1), await upload(bob, 1)];
  assert.equal(mesh, same);
  let refused;
  for (let k = 0; k < 40 && !refused; k++) {
    const reply = await embed(ann, mesh, k);
    if (reply.status !== 200) refused = reply;
  }
  assertProblem(refused, 429, 'quota-exceeded');
  const { sum, count, embeddings } = await stored(ann);
  const one = sum / count;
  assert.ok(sum <= QUOTA && sum > QUOTA - 1.1 * one, `${count} embeddings of ${one} bytes`);
  assert.equal(refused.json.quota, QUOTA);
  assert.equal(refused.json.used, sum);
  assert.equal(refused.json.pending, 0);
  assert.match(refused.json.detail, /Delete results that are not needed, or ask the operator/);
  assert.match(await token('list'), new RegExp(`^ann .* derived=${sum} quota-derived=${QUOTA}$`, 'm'));

  assert.equal((await embed(ann, mesh, 0)).status, 200, 'what is there costs nothing');
  const pair = { shapes: [{ mesh }, { mesh: await upload(ann, 2) }], align: { method: 'rotate' } };
  assertProblem(await d.post('/v1/supermeshes', pair, ann), 429, 'quota-exceeded');
  const query = { shapes: pair.shapes.map((s) => s.mesh).join(), align: 'rotate' };
  assertProblem(await d.get('/v1/morph.glb', { ...ann, query }), 429, 'quota-exceeded');
  for (let k = 0; k < count + 1; k++) assert.equal((await embed(bob, same, k)).status, 200, 'of another tenant');
  assertProblem(
    await embed(ann, mesh, count),
    429,
    'quota-exceeded',
    "what another tenant has counts, too, for one's own",
  );

  assert.equal((await d.delete(embeddings[0].url, ann)).status, 204);
  assert.equal((await embed(ann, mesh, 100)).status, 200, 'deleting makes room');
  assertProblem(await embed(ann, mesh, 101), 429, 'quota-exceeded');
  await d.stop();
  await d.start();
  assertProblem(await embed(ann, mesh, 101), 429, 'quota-exceeded', 'a restart forgets nothing');
  await token('set', 'ann', '--quota-derived', '200K');
  assert.equal((await embed(ann, mesh, 101)).status, 200, 'a larger quota holds from the next request on');
  await d.stop();
  await promisify(execFile)(binaries.daemon, ['--check-data', '--data', d.data]);
});

test('jobs that have not ended count, so that many requests at once do not pass', async (t) => {
  const { d, add, upload, embed, stored } = await tenants(t, '--quota-derived', '100K', '--workers', '1');
  const [ann, root] = [await add('ann'), await add('root', '--tenant', 'other')];
  const [mesh, theirs] = [await upload(ann, 1), await upload(root, 3, 5)];
  const long = (await d.post('/v1/embeddings', { mesh: theirs, ...endless }, root)).json;
  const replies = await Promise.all(Array.from({ length: 60 }, (_, k) => embed(ann, mesh, k, 0)));
  const jobs = replies.filter((r) => r.status === 202);
  const refused = replies.filter((r) => r.status !== 202);
  for (const reply of refused) assertProblem(reply, 429, 'quota-exceeded');
  assert.ok(jobs.length > 0 && refused.length > 0);
  assert.ok(refused.at(-1).json.pending + refused.at(-1).json.used > QUOTA / 2, 'unfinished jobs are told');
  await d.delete(long.url, root);
  for (const { json } of jobs) {
    let job = json;
    while (!job.finished) job = (await d.get(json.url, { ...ann, query: { wait: 30 } })).json;
    assert.equal(job.state, 'succeeded', JSON.stringify(job.problem));
  }
  const { sum, count } = await stored(ann);
  assert.equal(count, jobs.length);
  // A job that is ending counts twice for a moment.
  assert.ok(sum <= QUOTA && sum > QUOTA - (4 * sum) / count, `${count} embeddings, ${sum} bytes`);
});

/** A set of landmarks whose places have about a megabyte, and sixteen tetrahedra that it is for. */
async function manyLandmarks(d, who) {
  const shapes_ = [];
  for (let i = 0; i < 16; i++) {
    const text = `v 0 0 0\nv ${1 + i / 100} 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n`;
    shapes_.push({ mesh: (await d.post('/v1/meshes', Buffer.from(text), who)).json.id });
  }
  const place = (i, s) => {
    const [a, b] = [(0.5 * (i + 1)) / 700, (0.4 * (s + 1)) / 17];
    return { triangle: (i + s) % 4, barycentric: [a, b, 1 - a - b] };
  };
  const landmarks = Array.from({ length: 600 }, (_, i) => ({
    name: `n${i}`,
    at: Array.from({ length: 16 }, (_, s) => place(i, s)),
  }));
  const set = await d.post('/v1/landmarks', { landmarks }, who);
  assert.equal(set.status, 201, set.bytes.toString().slice(0, 500));
  return (k) => ({
    shapes: shapes_,
    landmarks: { id: set.json.id },
    remesh: { method: 'adaptive', tolerance: 0.01 + k / 1e6 },
  });
}

test('the requests of unfinished jobs count, with the landmarks that they name, and wait in the catalogue', async (t) => {
  const { d, token, add, upload } = await tenants(t, '--workers', '1', '--limits', 'off', '--drain-seconds', '0');
  const fresh = ownMegabytes(d, '_Anon');
  const ann = await add('ann', '--quota', '3M', '--quota-derived', '3M');
  const derived = async () => (await d.get('/v1/usage', ann)).json.tenants[0].derived_bytes;
  const wanted = await manyLandmarks(d, ann);
  const submit = (k) => d.post('/v1/supermeshes', wanted(k), ann);
  await d.post('/v1/embeddings', { mesh: await upload(ann, 1, 5), ...endless }, ann);
  const before = await derived();
  assert.ok(before > 0 && before < 2000, 'the request of the job that runs');
  const jobs = [];
  let refused;
  for (let k = 0; !refused && k < 20; k++) {
    const reply = await submit(k);
    if (reply.status === 202) jobs.push(reply.json);
    else refused = reply;
  }
  assertProblem(refused, 429, 'quota-exceeded');
  assert.match(refused.json.detail, /requests of unfinished jobs/);
  const each = ((await derived()) - before) / jobs.length;
  assert.ok(each > 600 * 16 * 50, `${each} bytes a request: triangle and three numbers for each of 600 places of 16`);
  const other = refused.json.pending - jobs.length * each;
  assert.ok(other >= before && other < 500e3, `${other} bytes for the job that runs, with its result`);
  assert.equal(jobs.length, Math.floor(((3 << 20) - other) / each));
  const full = await derived();
  assert.match(await token('list'), new RegExp(`^ann .* derived=${full} `, 'm'));

  assert.equal((await d.delete(jobs[0].url, ann)).status, 200);
  const given = full - (await derived());
  assert.ok(Math.abs(given - each) < 20, `a cancelled job gives ${given} bytes back`);
  assert.equal((await submit(0)).status, 202, 'so that another one fits');

  await token('set', 'ann', '--quota-derived', '1G');
  for (let k = jobs.length; k < (slow ? 6 : 20); k++) assert.equal((await submit(k)).status, 202);
  const all = await derived();
  await d.stop();
  await d.start();
  assert.equal(await derived(), all, 'a restart forgets none');
  const more = ownMegabytes(d, '_Anon') - fresh;
  if (!slow) assert.ok(more < all / 2e6, `and reads none before its job runs: ${more} MB for ${all} bytes`);
  await d.stop();
  await promisify(execFile)(binaries.daemon, ['--check-data', '--data', d.data]);
});

test('kept alignments count, and give way to results', async (t) => {
  const { d, token, add, upload } = await tenants(t);
  const ann = await add('ann', '--quota-derived', '10M');
  const shapes_ = [{ mesh: await upload(ann, 1) }, { mesh: await upload(ann, 2) }];
  const body = { shapes: shapes_, align: { method: 'rotate' }, remesh: { method: 'overlay' } };
  const make = (more) =>
    d.post('/v1/supermeshes', { ...body, ...more }, { headers: { ...ann.headers, prefer: 'wait=60' } });
  assert.equal((await make({})).status, 200);
  const derived = async () => Number(/derived=(\d+)/.exec(await token('list'))[1]);
  const all = await derived();
  let [served, sphere] = [0, 0];
  for (const kind of ['embeddings', 'supermeshes'])
    for (const { url } of (await d.get(`/v1/${kind}`, ann)).json[kind])
      for (const file of kind === 'embeddings'
        ? ['sphere.ply']
        : ['asset.glb', 'places', 'spheres/0.ply', 'spheres/1.ply']) {
        const { length } = (await d.get(`${url}/${file}`, ann)).bytes;
        served += length;
        if (file === 'sphere.ply') sphere = length;
      }
  const kept = all - served;
  assert.ok(kept > 1000, `${all} bytes are counted, ${served} are served`);
  await token('set', 'ann', '--quota-derived', String(all + sphere + 512 - Math.floor(kept / 2)));
  const small = await upload(ann, 3);
  const reply = await d.post('/v1/embeddings', { mesh: small }, { headers: { ...ann.headers, prefer: 'wait=60' } });
  assert.equal(reply.status, 200, `the alignment of ${kept} bytes made room: ${reply.bytes}`);
  assert.ok(Math.abs((await derived()) - (all + sphere - kept)) < 200, 'and is gone');
});

test('usage: what a tenant stores, may store, runs and has used', async (t) => {
  const { d, token, add, upload, embed, stored } = await tenants(t, '--workers', '1', '--quota-derived', '7M');
  const [ann, bob] = [
    await add('ann', '--quota', '1M', '--quota-derived', '5M', '--quota-jobs', '9'),
    await add('bob'),
  ];
  const root = { headers: { authorization: `Bearer ${await token('add', 'root', '--scope', 'admin')}` } };
  const text = await token('add', 'cli', '--scope', 'read', '--tenant', 'ann');
  const usage = async (who, query) => (await d.get('/v1/usage', { ...who, query })).json;
  const mesh = await upload(ann, 1);
  for (let k = 0; k < 3; k++) assert.equal((await embed(ann, mesh, k)).status, 200);
  const began = performance.now();
  const long = (await d.post('/v1/embeddings', { mesh, ...endless }, ann)).json;
  const next = (await embed(ann, mesh, 4, 0)).json;
  await new Promise((resolve) => setTimeout(resolve, 300));
  let mine = (await usage(ann)).tenants;
  assert.equal(mine.length, 1, 'only its own');
  const { sum } = await stored(ann);
  const requests = mine[0].derived_bytes - sum;
  assert.ok(requests > 2 * mesh.length && requests < 2000, `${requests} bytes of two requests that name the mesh`);
  assert.deepEqual(
    { ...mine[0], worker_seconds: 0, derived_bytes: sum },
    {
      tenant: 'ann',
      meshes: 1,
      bytes: ball(1).length,
      derived_bytes: sum,
      quotas: { bytes: 1 << 20, derived_bytes: 5 << 20, jobs: 9 },
      running: 1,
      queued: 1,
      worker_seconds: 0,
      crashes: 0,
    },
  );
  const before = mine[0].worker_seconds;
  await d.delete(long.url, ann);
  for (let job = next; !job.finished; ) job = (await d.get(next.url, { ...ann, query: { wait: 30 } })).json;
  [mine] = (await usage(ann)).tenants;
  const spent = mine.worker_seconds - before;
  assert.ok(spent >= 0.3 && spent <= (performance.now() - began) / 1000, `${spent} s`);
  assert.equal(mine.running + mine.queued, 0);
  assert.deepEqual((await usage(bob)).tenants[0].quotas, { bytes: 0, derived_bytes: 7 << 20, jobs: 0 });

  const all = await usage(root);
  assert.deepEqual(
    all.tenants.map((u) => u.tenant),
    ['ann', 'bob', 'root'],
  );
  assert.deepEqual(all.tenants[0].quotas, { bytes: 1 << 20, derived_bytes: 5 << 20, jobs: 9 });
  const paged = [];
  for (let query = { limit: 2 }; query; ) {
    const page = await usage(root, query);
    paged.push(...page.tenants.map((u) => u.tenant));
    query = page.next_page_token && { limit: 2, page_token: page.next_page_token };
  }
  assert.deepEqual(paged, ['ann', 'bob', 'root']);

  const metrics = (await d.get('/metrics', root)).bytes.toString();
  const value = (name) => Number(new RegExp(`^${name}\\{tenant="ann"\\} (\\S+)$`, 'm').exec(metrics)[1]);
  assert.equal(value('orbmorph_tenant_bytes'), mine.bytes);
  assert.equal(value('orbmorph_tenant_derived_bytes'), mine.derived_bytes);
  assert.equal(value('orbmorph_tenant_worker_seconds_total'), mine.worker_seconds);

  const env = { ORBMORPH_SERVER: d.url, ORBMORPH_TOKEN: text };
  const { stdout } = await promisify(execFile)(binaries.client, ['usage'], { env: { ...process.env, ...env } });
  assert.match(
    stdout,
    /^ann: [\d,]+ bytes in 1 mesh, [\d,]+ of 7,340,032 bytes of results, 0 jobs running and 0 queued, \d+\.\d worker seconds, 0 crashes\n$/,
  );

  // For any number of tenants, the metrics name 50 of them and add up the others.
  const { id } = (await d.post('/v1/meshes', ball(1), bob)).json;
  assert.equal(id, mesh);
  for (let k = 0; k < 52; k++) {
    const who = await add(`many${k}`);
    await d.post('/v1/meshes', ball(1), who);
  }
  const lines = (await d.get('/metrics', root)).bytes.toString().split('\n');
  const bytes = lines.filter((line) => line.startsWith('orbmorph_tenant_bytes{'));
  assert.equal(bytes.length, 51);
  assert.ok(
    bytes.some((line) => line.startsWith(`orbmorph_tenant_bytes{tenant="(others)"} ${4 * ball(1).length}`)),
    bytes.at(-1),
  );
});
