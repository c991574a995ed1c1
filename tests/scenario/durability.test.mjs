// Accepted jobs and results survive kill -9, SIGTERM and many restarts.
import assert from 'node:assert/strict';
import path from 'node:path';
import test from 'node:test';
import { setTimeout as sleep } from 'node:timers/promises';
import { assertProblem, daemon, endless, samples, slow, until } from './support/daemon.mjs';
import * as shapes from './support/shapes.mjs';

const kills = Number(process.env.ORB_CRASHES ?? (slow ? 3 : 6));
const wobble = (seed, levels) =>
  shapes.ball(levels, ([x, y, z]) => [
    x * (1 + 0.2 * Math.sin(5 * y + seed)),
    1.3 * y,
    z + 0.2 * Math.cos(4 * x + seed),
  ]);

async function kill(d) {
  d.killed = true;
  await d.stop('SIGKILL');
  await d.start();
  d.killed = false;
}

test('accepted jobs survive kill -9', async (t) => {
  const d = await daemon(t, { args: ['--workers', '1'] });
  const jobs = [];
  for (let i = 0; i < 5; i++) {
    const { json: mesh } = await d.upload(shapes.binaryPly(wobble(i, slow ? 4 : 6)), { name: `m${i}` });
    const reply = await d.post('/v1/embeddings', { mesh: mesh.id });
    assert.equal(reply.status, 202, reply.bytes.toString());
    jobs.push({ job: reply.json, mesh });
  }
  await kill(d);
  assert.ok(d.start_cpu_ms < 10_000, `${d.start_cpu_ms} ms of processor time to start again`);
  for (const { job, mesh } of jobs) {
    assert.equal((await d.get(mesh.url)).status, 200);
    const now = await d.get(job.url);
    assert.equal(now.status, 200, 'the job is known');
    const end = await d.ended(now.json);
    assert.equal(end.state, 'succeeded', JSON.stringify(end.problem));
    assert.equal((await d.get(end.result)).json.certificate.valid, true);
  }
});

test('after every kill the daemon starts and continues', async (t) => {
  const d = await daemon(t);
  const first = await d.mesh(path.join(samples, 'dog.obj'));
  for (let i = 0; i < kills; i++) {
    const { json: mesh } = await d.upload(shapes.obj(wobble(i, 3)), { name: `r${i}` });
    const reply = await d.post('/v1/supermeshes', { shapes: [{ mesh: first.id }, { mesh: mesh.id }] });
    assert.equal(reply.status, 202, reply.bytes.toString());
    await new Promise((resolve) => setTimeout(resolve, (37 * i) % 500)); // at a later stage of the job each time
    await kill(d);
    const end = await d.ended((await d.get(reply.json.url)).json);
    assert.equal(end.state, 'succeeded', JSON.stringify(end));
    assert.equal((await d.get(end.result)).json.certificate.closed, true);
  }
});

test('results survive an orderly stop', async (t) => {
  const d = await daemon(t, { args: ['--drain-seconds', '3600'] }); // nothing runs: it waits for nothing
  const mesh = await d.mesh(path.join(samples, 'dog.obj'));
  const embedding = await d.made('/v1/embeddings', { mesh: mesh.id });
  const { code } = await d.stop();
  assert.equal(code, 0, d.log);
  await d.start();
  assert.deepEqual((await d.get(embedding.url)).json, embedding);
  const again = await d.make('/v1/embeddings', { mesh: mesh.id });
  assert.equal(again.status, 200);
});

test('SIGTERM stops the daemon in time while a job runs, and the jobs are kept', async (t) => {
  const d = await daemon(t, { args: ['--workers', '1', '--drain-seconds', '1'] });
  const [large, small] = [
    (await d.upload(shapes.binaryPly(wobble(1, 5)))).json,
    (await d.upload(shapes.obj(wobble(2, 3)))).json,
  ];
  const { json: job } = await d.post('/v1/embeddings', { mesh: large.id, ...endless });
  await until(async () => (await d.get(job.url)).json.state === 'running', 'it runs');
  const { json: behind } = await d.post('/v1/embeddings', { mesh: small.id });
  const waiting = d.get(job.url, { query: { wait: 60 } }).catch((error) => ({ error }));
  const { code } = await d.stop(); // the job alone would take minutes
  assert.equal(code, 0, d.log);
  await waiting;
  await d.start();
  const again = await until(
    async () => ((job) => job.state === 'running' && job)((await d.get(job.url)).json),
    'it runs again',
  );
  assert.equal(again.id, job.id);
  assert.equal((await d.get(behind.url)).json.state, 'queued');
  assert.equal((await d.delete(job.url)).status, 200);
  const end = await d.ended(behind);
  assert.equal(end.state, 'succeeded', JSON.stringify(end.problem));
});

test('a job that SIGTERM interrupts finishes after the next start', async (t) => {
  const d = await daemon(t, { args: ['--workers', '1', '--drain-seconds', '0'] });
  const { json: mesh } = await d.upload(shapes.binaryPly(wobble(1, slow ? 5 : 7)));
  const { json: job } = await d.post('/v1/embeddings', { mesh: mesh.id });
  assert.equal((await d.stop()).code, 0, d.log);
  await d.start();
  const end = await d.ended((await d.get(job.url)).json);
  assert.equal(end.state, 'succeeded', JSON.stringify(end.problem));
});

test('a second SIGTERM stops a draining daemon at once, and the job is kept', async (t) => {
  const d = await daemon(t, { args: ['--workers', '1', '--drain-seconds', '3600'] });
  const { json: mesh } = await d.upload(shapes.binaryPly(wobble(1, 5)));
  const { json: job } = await d.post('/v1/embeddings', { mesh: mesh.id, ...endless });
  while ((await d.get(job.url)).json.state !== 'running') await sleep(20);
  d.child.kill('SIGTERM');
  let reply;
  do reply = await d.get('/readyz');
  while (reply.status === 200);
  assertProblem(reply, 503, 'unavailable');
  // The daemon drains: stored data can be read, new work is refused, and a reload does not stop it.
  d.child.kill('SIGHUP');
  assert.equal((await d.get('/livez')).status, 200);
  const { json: other } = await d.upload(shapes.tetrahedron);
  assertProblem(
    await d.post('/v1/embeddings', { mesh: (other.id ? other : mesh).id, method: 'kernel-sampling' }),
    503,
    'unavailable',
  );
  await sleep(1500);
  assert.deepEqual([d.child.exitCode, d.child.signalCode], [null, null], 'it gives the job its time');
  assert.equal((await d.get(job.url)).json.state, 'running');
  const { code } = await d.stop('SIGTERM'); // some seconds of the hour have passed
  assert.equal(code, 0, d.log);
  await d.start();
  const now = (await d.get(job.url)).json;
  assert.ok(['queued', 'running'].includes(now.state), JSON.stringify(now));
  assert.equal((await d.delete(job.url)).status, 200);
  assert.equal((await d.ended(now)).state, 'cancelled');
});

test('a job that crashes the service three times fails, and the queue goes on', async (t) => {
  // in a separate process the job does not die with the service: scenario.isolate
  const d = await daemon(t, { args: ['--workers', '1', '--isolate', 'off'] });
  const { json: mesh } = await d.upload(shapes.binaryPly(wobble(1, 5)), { name: 'poison' });
  const { json: small } = await d.upload(shapes.obj(wobble(2, 2)), { name: 'small' });
  const poison = (await d.post('/v1/embeddings', { mesh: mesh.id, ...endless })).json;
  const behind = (await d.post('/v1/embeddings', { mesh: small.id })).json;
  for (let crash = 1; crash <= 3; crash++) {
    let now;
    do now = (await d.get(poison.url)).json;
    while (now.state === 'queued' || now.stage === null);
    assert.equal(now.state, 'running', JSON.stringify(now));
    assert.equal(now.attempt, crash);
    await sleep(500); // an event is stored at most 20 ms after it happens, and a commit
    await kill(d);
  }
  const end = (await d.get(poison.url)).json;
  assert.equal(end.state, 'failed');
  assert.equal(end.problem.type, '/problems/crashed');
  assert.match(end.problem.detail, /crashed 3 times/);
  const events = await d.get(`${poison.url}/events`);
  assert.match(events.bytes.toString(), /^event: progress$/m);
  assert.equal((await d.ended((await d.get(behind.url)).json)).state, 'succeeded');
  const again = await d.post('/v1/embeddings', { mesh: mesh.id, ...endless });
  assert.equal(again.status, 202, 'repeating the request starts another try');
  assert.notEqual(again.json.id, poison.id);
  await d.delete(again.json.url);
});
