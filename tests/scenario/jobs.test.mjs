// Jobs: waiting, events, cancelling, lists, and at most one unfinished job for each key.
import assert from 'node:assert/strict';
import path from 'node:path';
import test from 'node:test';
import { setTimeout as sleep } from 'node:timers/promises';
import { daemon, endless, samples, assertProblem, patience, until } from './support/daemon.mjs';
import * as shapes from './support/shapes.mjs';

/** A mesh that takes a while to embed, different for every seed. */
async function heavy(d, seed = 1, levels = 6) {
  const m = shapes.ball(levels, ([x, y, z]) => [
    x * (1 + 0.3 * Math.sin(7 * y + seed)),
    1.5 * y + 0.4 * Math.sin(5 * x),
    z * (1 + 0.2 * Math.cos(9 * x)),
  ]);
  const reply = await d.upload(shapes.binaryPly(m), { name: `heavy${seed}` });
  assert.equal(reply.status, 201, reply.bytes.toString());
  return reply.json;
}

test('a job can be waited for', async (t) => {
  const d = await daemon(t);
  const mesh = await d.mesh(path.join(samples, 'dog.obj'));
  const accepted = await d.post('/v1/embeddings', { mesh: mesh.id });
  assert.equal(accepted.status, 202);
  assert.ok(accepted.headers.get('location').endsWith(accepted.json.url));
  assert.ok(Number(accepted.headers.get('retry-after')) >= 0);
  for (const field of ['id', 'url', 'kind', 'state', 'progress', 'created']) assert.ok(field in accepted.json, field);
  let done;
  do done = await d.get(accepted.json.url, { query: { wait: 60 } });
  while (done.json.finished === null);
  assert.equal(done.json.state, 'succeeded');
  assert.equal(done.json.progress, 1);
  assert.equal(done.json.seconds_left, null);
  assert.equal(done.json.problem, null);
  assert.ok(Date.parse(done.json.finished) >= Date.parse(done.json.started));
  assert.equal((await d.get(done.json.result)).status, 200);

  const prefer = await d.post(
    '/v1/embeddings',
    { mesh: (await d.upload(shapes.obj(shapes.egg(2)))).json.id },
    { headers: { prefer: 'wait=30' } },
  );
  assert.equal(prefer.status, 200, 'Prefer: wait on the request itself brings the result');
  assert.equal(prefer.json.certificate.valid, true);
  assert.equal(prefer.headers.get('preference-applied'), 'wait=30');
  const header = await d.get(accepted.json.url, { headers: { prefer: 'respond-async, wait=5' } });
  assert.equal(header.json.state, 'succeeded');
  assert.equal(header.headers.get('preference-applied'), 'wait=5');
  for (const reply of [accepted, done]) assert.equal(reply.headers.get('preference-applied'), null, 'none was sent');
  assert.equal(
    (await d.get(accepted.json.url, { query: { wait: 999999 } })).status,
    200,
    'wait is clamped, not refused',
  );
});

test('events report progress and the end, and resume', async (t) => {
  const d = await daemon(t);
  const mesh = await heavy(d);
  const { json: job } = await d.post('/v1/embeddings', { mesh: mesh.id });
  const events = await d.get(`${job.url}/events`, { headers: { accept: 'text/event-stream' } });
  assert.equal(events.status, 200);
  assert.equal(events.type.split(';')[0], 'text/event-stream');
  const list = events.bytes
    .toString()
    .split('\n\n')
    .filter((e) => /^event:/m.test(e));
  const names = list.map((e) => /^event: ?(\w+)/m.exec(e)[1]);
  assert.equal(names.at(-1), 'succeeded', names.join());
  assert.ok(names.slice(0, -1).every((n) => n === 'progress'));
  const last = JSON.parse(/^data: ?(.*)/m.exec(list.at(-1))[1]);
  assert.equal(last.state ?? 'succeeded', 'succeeded');
  const ids = list.map((e) => /^id: ?(.+)/m.exec(e)?.[1]);
  assert.ok(ids.every(Boolean) && new Set(ids).size === ids.length, `ids: ${ids}`);
  const resumed = await d.get(`${job.url}/events`, { headers: { 'last-event-id': ids.at(-2) ?? '0' } });
  assert.match(resumed.bytes.toString(), /^event: ?succeeded/m);
});

// If several nodes answer in turn, the one that runs the job is ahead of the others by up to a second.
const together = { skip: process.env.ORB_NODES && 'nodes know the progress of the job at different times' };
test('progress moves at least once a second while a job runs, and never back', together, async (t) => {
  const d = await daemon(t);
  const mesh = await heavy(d, 1, 5);
  const job = (await d.post('/v1/embeddings', { mesh: mesh.id, ...endless })).json;
  const now = async () => (await d.get(job.url)).json;
  await until(async () => (await now()).stage, 'it has read its mesh and reports a stage');
  const seen = [];
  let left = null;
  for (const end = Date.now() + 6000 * patience; Date.now() < end; await sleep(50)) {
    const { progress, stage, state, seconds_left } = await now();
    assert.equal(state, 'running');
    assert.ok(seconds_left === null ? left === null : Number.isInteger(seconds_left) && seconds_left > 0, seconds_left);
    left = seconds_left;
    assert.ok(stage && progress < 1, `${stage} ${progress}`);
    if (progress !== seen.at(-1)) seen.push(progress);
  }
  assert.ok(seen.length >= 6, `${seen}`);
  assert.deepEqual(
    seen,
    [...seen].sort((a, b) => a - b),
  );
  assert.ok(left > 0, 'it estimates the time that is left');
  assert.equal((await d.delete(job.url)).status, 200);
  assert.equal((await now()).seconds_left, null);
});

test('a job can be cancelled while it waits and while it runs', async (t) => {
  const d = await daemon(t, { args: ['--workers', '1'] });
  const [first, second] = [await heavy(d, 1, 5), await heavy(d, 2, 5)];
  const running = (await d.post('/v1/embeddings', { mesh: first.id, ...endless })).json;
  const queued = (await d.post('/v1/embeddings', { mesh: second.id })).json;
  await until(async () => (await d.get(running.url)).json.state === 'running', 'it runs');
  for (const job of [queued, running]) {
    const reply = await d.delete(job.url);
    assert.ok([200, 202, 204].includes(reply.status), reply.bytes.toString());
    const end = await d.ended(job);
    assert.equal(end.state, 'cancelled');
    assert.ok(!end.result);
  }
  const again = await d.make('/v1/embeddings', { mesh: (await d.mesh(path.join(samples, 'dog.obj'))).id });
  assert.ok(again.resource, 'the worker is free for the next job');
  const anew = await d.make('/v1/embeddings', { mesh: second.id });
  assert.ok(anew.resource, 'what was cancelled can be asked for again');
  const next = await d.post('/v1/embeddings', { mesh: first.id, ...endless });
  assert.deepEqual([next.status, next.json.id === running.id], [202, false], 'also what ran');
  assert.equal((await d.delete(next.json.url)).status, 200);
});

test('cancelling a job also cancels the jobs that only it needs, at any moment', async (t) => {
  const d = await daemon(t, { args: ['--workers', '2'] });
  const [first, second] = [await heavy(d, 1, 5), await heavy(d, 2, 5)];
  // Counts the jobs of all nodes, if there are several: /readyz?verbose shows only those that one of them runs.
  const usage = async () => (await d.get('/v1/usage')).json.tenants[0];
  const work = async () => (({ queued, running }) => queued + running)(await usage());
  const merge = { shapes: [first, second].map(({ id }) => ({ mesh: id })), embedding: endless };
  for (let i = 0; i < 24; i++) {
    const job = (await d.post('/v1/supermeshes', merge)).json;
    if (i % 4 === 3) await until(async () => (await usage()).running === 2, 'both embeddings are made', 60);
    else for (const end = performance.now() + (i % 12) / 2; performance.now() < end; ); // while it is taken, planned, put to wait
    const reply = await d.delete(job.url);
    assert.deepEqual([reply.status, reply.json.state], [200, 'cancelled']);
    await until(async () => (await work()) === 0, `nothing is left to do (${i})`, 60);
  }
  const asked = (await d.post('/v1/embeddings', { mesh: first.id, ...endless })).json;
  const job = (await d.post('/v1/supermeshes', merge)).json;
  await until(async () => (await work()) === 3, 'it waits for both');
  assert.equal((await d.delete(job.url)).status, 200);
  await until(async () => (await work()) === 1, 'one of them is stopped');
  assert.equal((await d.get(asked.url)).json.state, 'running');
  assert.equal((await d.delete(asked.url)).status, 200);
});

test('repeating a request while its job runs returns that job', async (t) => {
  const d = await daemon(t);
  const mesh = await heavy(d);
  const replies = await Promise.all(Array.from({ length: 8 }, () => d.post('/v1/embeddings', { mesh: mesh.id })));
  const jobs = new Set(replies.filter((r) => r.status === 202).map((r) => r.json.id));
  assert.ok(jobs.size <= 1, `${jobs.size} jobs`);
  const list = Object.values((await d.get('/v1/jobs')).json).find(Array.isArray);
  assert.equal(list.length, 1);
  await d.ended(list[0]);
});

test('jobs are listed by state', async (t) => {
  const d = await daemon(t);
  const mesh = await d.mesh(path.join(samples, 'dog.obj'));
  await d.made('/v1/embeddings', { mesh: mesh.id });
  const items = async (state) =>
    Object.values((await d.get('/v1/jobs', { query: { state } })).json).find(Array.isArray);
  assert.equal((await items('succeeded')).length, 1);
  assert.equal((await items('failed')).length, 0);
  assertProblem(await d.get('/v1/jobs/nothing'), 404, 'not-found');
});

const long = (mesh) => ({ mesh: mesh.id, ...endless });

test('a wait that is too short returns the job', async (t) => {
  const d = await daemon(t, { args: ['--workers', '1'] });
  const mesh = await heavy(d, 1, 5);
  const reply = await d.post('/v1/embeddings', long(mesh), { headers: { prefer: 'wait=1' } });
  assert.equal(reply.status, 202);
  assert.equal(reply.headers.get('preference-applied'), 'wait=1');
  const polled = await d.get(reply.json.url, { headers: { prefer: 'wait=1' } });
  assert.deepEqual([polled.json.state, polled.headers.get('preference-applied')], ['running', 'wait=1']);
  for (const prefer of ['respond-async', 'wait=soon', 'wait', 'waiting=3']) {
    const plain = await d.get(reply.json.url, { headers: { prefer } });
    assert.deepEqual([plain.status, plain.headers.get('preference-applied')], [200, null], prefer);
  }
  const refused = await d.post('/v1/embeddings', { mesh: 'none' }, { headers: { prefer: 'wait=1' } });
  assertProblem(refused, 404, 'not-found');
  assert.equal(refused.headers.get('preference-applied'), null);
  await d.delete(reply.json.url);
});

test('a full queue refuses new jobs and nothing else', async (t) => {
  const d = await daemon(t, { args: ['--workers', '1', '--queue-limit', '2'] });
  const meshes = [await heavy(d, 1, 5), await heavy(d, 2, 5), await heavy(d, 3, 5)];
  const jobs = [];
  for (const mesh of meshes.slice(0, 2)) {
    const reply = await d.post('/v1/embeddings', long(mesh));
    assert.equal(reply.status, 202, reply.bytes.toString());
    jobs.push(reply.json);
  }
  for (let i = 0; i < 3; i++) {
    const refused = await d.post('/v1/embeddings', long(meshes[2]));
    assertProblem(refused, 429, 'queue-full');
    assert.match(refused.headers.get('retry-after'), /^[1-9]\d*$/);
  }
  const waiting = await d.post('/v1/embeddings', long(meshes[2]), { headers: { prefer: 'wait=30' } });
  assertProblem(waiting, 429, 'queue-full');
  assert.equal((await d.get('/v1/jobs')).json.jobs.length, 2, 'no trace of what was refused');
  // Queued requests are still answered, as are uploads and reads.
  assert.equal((await d.post('/v1/embeddings', long(meshes[1]))).json.id, jobs[1].id);
  assert.equal((await d.upload(shapes.tetrahedron)).status, 201);
  assert.equal((await d.get(meshes[2].url)).status, 200);
  assert.equal((await d.delete(jobs[1].url)).status, 200);
  await d.ended(jobs[1]);
  const third = await d.post('/v1/embeddings', long(meshes[2]));
  assert.equal(third.status, 202, third.bytes.toString());
  for (const job of [jobs[0], third.json]) await d.delete(job.url);
});

test('the list of a state has exactly the jobs in it, also those that wait for a running job', async (t) => {
  const d = await daemon(t, { args: ['--workers', '1'] });
  const meshes = [await heavy(d, 1, 5), await heavy(d, 2, 5), await heavy(d, 3, 5)];
  const merge = (
    await d.post('/v1/supermeshes', { shapes: meshes.slice(0, 2).map(({ id }) => ({ mesh: id })), embedding: endless })
  ).json;
  await until(async () => (await d.get(merge.url)).json.state === 'running', 'what the merge needs runs');
  const behind = []; // requested only now: the queue chooses which of several jobs begins first
  for (let i = 0; i < 3; i++)
    behind.push(
      (
        await d.post('/v1/embeddings', {
          mesh: meshes[2].id,
          ...endless,
          options: { ...endless.options, step: 0.01 + i / 1000 },
        })
      ).json,
    );
  const list = async (state, limit) => {
    const found = [];
    for (let token; ; ) {
      const { json } = await d.get('/v1/jobs', { query: { state, limit, ...(token && { page_token: token }) } });
      for (const job of json.jobs) assert.equal(job.state, state);
      found.push(...json.jobs.map(({ id }) => id));
      token = json.next_page_token;
      if (!token) return found;
      assert.equal(json.jobs.length, limit, 'a page that others follow is full');
    }
  };
  for (const limit of [1, 2, 100]) {
    assert.deepEqual(await list('running', limit), [merge.id], `in pages of ${limit}`);
    assert.deepEqual(await list('queued', limit), behind.map(({ id }) => id).reverse(), `in pages of ${limit}`);
  }
  for (const job of [...behind, merge]) assert.equal((await d.delete(job.url)).status, 200);
});

test('a job that was cancelled may be cancelled again, also after a restart', async (t) => {
  const d = await daemon(t, { args: ['--workers', '1'] });
  const mesh = await heavy(d, 1, 5);
  const job = (await d.post('/v1/embeddings', { mesh: mesh.id, ...endless })).json;
  for (let i = 0; i < 3; i++) {
    const reply = await d.delete(job.url);
    assert.deepEqual([reply.status, reply.json.state, reply.json.id], [200, 'cancelled', job.id]);
    if (i === 1) {
      await d.stop();
      await d.start();
    }
  }
});
