// What an operator sees and changes while the daemon runs: counters, the log, SIGHUP.
import assert from 'node:assert/strict';
import { writeFile, mkdtemp, rm } from 'node:fs/promises';
import { tmpdir } from 'node:os';
import path from 'node:path';
import test from 'node:test';
import { setTimeout as sleep } from 'node:timers/promises';
import { assertProblem, daemon } from './support/daemon.mjs';
import * as shapes from './support/shapes.mjs';

const lines = (d) => d.log.split('\n').filter((l) => l.startsWith('{')).map((l) => JSON.parse(l));
async function logged(d, wanted) {
  const until = Date.now() + 10_000;
  for (;;) {
    const found = lines(d).find(wanted);
    if (found) return found;
    assert.ok(Date.now() < until, `not in the log:\n${d.log}`);
    await sleep(50);
  }
}

test('bytes that were sent are counted', async (t) => {
  const d = await daemon(t);
  const sent = async () => Number(/^orbmorph_sent_bytes_total (\d+)$/m.exec((await d.get('/metrics')).bytes.toString())[1]);
  const text = shapes.obj(shapes.egg(3));
  const { url } = (await d.upload(text)).json;
  const before = await sent();
  for (let i = 0; i < 3; i++) assert.equal((await d.get(`${url}/file`)).bytes.toString(), text);
  assert.equal((await d.get(`${url}/file`, { headers: { range: 'bytes=0-99' } })).status, 206);
  assert.equal((await d.request('HEAD', `${url}/file`)).status, 200);
  const grown = (await sent()) - before, files = 3 * text.length + 100;
  // Beside the files only the first answer of /metrics itself was sent.
  assert.ok(grown > files && grown < files + 10_000, `${grown} for ${files}`);
});

test('requests and their traces are in the log', async (t) => {
  const d = await daemon(t, { args: ['--log-level', 'debug'] });
  const { id, url } = (await d.upload(shapes.obj(shapes.egg(2)))).json;
  const trace = '00-0af7651916cd43dd8448eb211c80319c-b7ad6b7169203331-01';
  const reply = await d.post('/v1/embeddings', { mesh: id }, { headers: { traceparent: trace } });
  assert.equal(reply.status, 202);
  const accepted = await logged(d, (l) => l.message === 'job accepted');
  assert.equal(accepted.traceparent, trace);
  assert.equal(accepted.request, reply.headers.get('x-request-id'));
  assert.equal(accepted.job, reply.json.id);
  const bad = await d.get(url, { headers: { traceparent: '00-","x":"-b7ad6b7169203331-01' } });
  const plain = await logged(d, (l) => l.request === bad.headers.get('x-request-id'));
  assert.deepEqual([plain.traceparent, plain.route, plain.method, plain.status], [undefined, '/v1/meshes/{id}', 'GET', 200]);
});

test('SIGHUP reads the configuration again', async (t) => {
  const folder = await mkdtemp(path.join(tmpdir(), 'orbmorph-test-'));
  t.after(() => rm(folder, { recursive: true, force: true }));
  const file = path.join(folder, 'conf');
  await writeFile(file, 'log-level = info\nmax-body = 1M\n');
  const d = await daemon(t, { args: ['--config', file] });
  const hup = async (text) => {
    d.log = '';
    await writeFile(file, text);
    d.child.kill('SIGHUP');
  };
  await hup('log-level = debug\nmax-body = 2048\nqueue-limit = 7\n');
  await logged(d, (l) => l.message === 'SIGHUP: the configuration was read again');
  await logged(d, (l) => /queue-limit is changed/.test(l.message));
  await logged(d, (l) => /max-body .*needs a restart/.test(l.message));
  const reply = await d.upload(shapes.obj(shapes.egg(3)));
  assert.equal(reply.status, 201, 'the limit of a body needs a restart');
  await logged(d, (l) => l.level === 'debug' && l.request === reply.headers.get('x-request-id'));
  await hup('log-level = warn\nnonsense = 1\n');
  await logged(d, (l) => /is not valid and stays as it was/.test(l.message));
  assertProblem(await d.get('/v1/nothing'), 404, 'not-found');
  await logged(d, (l) => l.level === 'debug');
});

test('the counters tell of jobs, stages and the process', async (t) => {
  const d = await daemon(t);
  const { id } = (await d.upload(shapes.obj(shapes.egg(4)))).json;
  await d.made('/v1/embeddings', { mesh: id });
  const text = (await d.get('/metrics')).bytes.toString();
  const value = (name) => Number(new RegExp(`^${name.replace(/[{}"]/g, '\\$&')} (\\S+)$`, 'm').exec(text)?.[1] ?? NaN);
  for (const name of ['orbmorph_jobs{state="queued"}', 'orbmorph_jobs{state="running"}', 'orbmorph_queue_oldest_seconds', 'orbmorph_flips_total']) assert.equal(value(name), 0, name);
  assert.equal(value('orbmorph_jobs_ended_total{state="succeeded"}'), 1);
  for (const stage of ['read', 'embed', 'certify', 'store']) assert.equal(value(`orbmorph_stage_seconds_count{kind="embedding",stage="${stage}"}`), 1, `${stage}\n${text}`);
  assert.equal(value('orbmorph_job_seconds_count{kind="embedding"}'), 1);
  for (const name of ['orbmorph_cache_hits_total', 'orbmorph_connections', 'orbmorph_received_bytes_total', 'orbmorph_stored_bytes', 'process_resident_memory_bytes', 'process_open_fds', 'process_threads'])
    assert.ok(value(name) > 0, name);
  const ready = (await d.get('/readyz', { query: { verbose: '' } })).json;
  assert.deepEqual([ready.queued, ready.waiting, ready.running, ready.queue_limit, ready.oldest_ms], [0, 0, 0, 10000, 0]);
  assert.deepEqual((await d.get('/readyz')).json, { status: 'ready' });
});

test('slow requests are in the log', async (t) => {
  const d = await daemon(t, { args: ['--slow-ms', '1'] });
  const { headers } = await d.upload(shapes.binaryPly(shapes.ball(6)));
  const line = await logged(d, (l) => l.message === 'slow request');
  assert.deepEqual([line.level, line.request, line.route, line.status], ['warn', headers.get('x-request-id'), '/v1/meshes', 201]);
  assert.ok(line.ms >= 1);
});
