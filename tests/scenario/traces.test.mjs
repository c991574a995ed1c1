// Traces for OpenTelemetry: spans of a request and its jobs at a collector, and what happens without the collector.
import assert from 'node:assert/strict';
import test from 'node:test';
import { runProgram } from './support/cli.mjs';
import { Collector } from './support/collector.mjs';
import { binaries, daemon, until } from './support/daemon.mjs';
import * as shapes from './support/shapes.mjs';

const CALLER = { trace: '4bf92f3577b34da6a3ce929d0e0e4736', span: '00f067aa0ba902b7' };
const traceparent = (flags = '01') => ({ headers: { traceparent: `00-${CALLER.trace}-${CALLER.span}-${flags}` } });
const upload = async (d) => (await d.upload(shapes.tetrahedron)).json;
const CLOCK = 2; // ms: the time at which a job became ready is in whole milliseconds

async function count(d, result) {
  const text = (await d.get('/metrics')).bytes.toString();
  return Number(new RegExp(`^orbmorph_spans_total\\{result="${result}"\\} (\\d+)$`, 'm').exec(text)[1]);
}

test('a request is the parent of its jobs, and they of their stages', async (t) => {
  const c = await Collector.start(t);
  const d = await daemon(t, { args: ['--traces', c.url] });
  const meshes = [];
  for (const wide of [1, 1.5])
    meshes.push((await d.upload(shapes.obj(shapes.ball(2, ([x, y, z]) => [x * wide, y, z])))).json.id);
  const before = Date.now();
  const body = { shapes: meshes.map((mesh) => ({ mesh })) };
  const asked = await d.post('/v1/supermeshes', body, traceparent());
  assert.equal(asked.status, 202);
  const done = await d.ended(asked.json);
  assert.equal(done.state, 'succeeded');
  const of = ({ trace }) => trace === CALLER.trace;
  const recorded = () => ['POST /v1/supermeshes', 'supermesh job'].every((name) => c.named(name, of).length > 0);
  await until(recorded, 'the spans of request and job');
  const after = Date.now();

  const [request, ...others] = c.named('POST /v1/supermeshes', of);
  assert.equal(others.length, 0);
  assert.equal(request.parent, CALLER.span);
  assert.equal(request.kind, 2); // SERVER
  assert.equal(request['http.request.method'], 'POST');
  assert.equal(request['http.route'], '/v1/supermeshes');
  assert.equal(request['http.response.status_code'], 202);
  assert.equal(request['orbmorph.request'], asked.headers.get('x-request-id'));
  assert.equal(request['orbmorph.job'], asked.json.id);
  assert.equal(request.resource['service.name'], 'orbmorphd');

  const inside = (span, parent) => {
    assert.equal(span.parent, parent.id);
    assert.ok(span.start >= parent.start - CLOCK && span.start <= span.end, span.name);
  };
  const stages = (job) => {
    const found = c.spans.filter((span) => span.parent === job.id).sort((a, b) => a.start - b.start);
    for (const [i, stage] of found.entries()) {
      inside(stage, job);
      assert.ok(stage.end <= job.end + CLOCK);
      assert.ok(i === 0 || stage.start >= found[i - 1].end - CLOCK, 'one after another');
    }
    return found.map(({ name }) => name);
  };
  const [merge] = c.named('supermesh job', of);
  assert.equal(merge['orbmorph.job'], asked.json.id);
  assert.equal(merge['orbmorph.attempt'], 1);
  assert.equal(merge.error, undefined);
  inside(merge, request);
  const merging = stages(merge);
  for (const name of ['align', 'remesh', 'transfer', 'store']) assert.ok(merging.includes(name), `${merging}`);
  const embeddings = c.named('embedding job', of);
  assert.equal(embeddings.length, 2); // that the supermesh needed
  for (const job of embeddings) {
    inside(job, request);
    assert.ok(job.end <= merge.start + CLOCK);
    assert.ok(stages(job).includes('embed'));
  }
  // Each job was in the queue until a worker took it; the job of the supermesh was there a second time, after its
  // embeddings.
  for (const job of [merge, ...embeddings]) {
    const waits = c.named('queue', (span) => span['orbmorph.job'] === job['orbmorph.job']);
    assert.equal(waits.length, job === merge ? 2 : 1);
    for (const wait of waits) inside(wait, request);
    const last = Math.max(...waits.map(({ end }) => end));
    assert.ok(Math.abs(last - job.start) <= CLOCK, 'the worker took it then');
  }
  for (const span of c.spans.filter(of)) assert.ok(span.start >= before - CLOCK && span.end <= after + CLOCK);
  assert.equal(new Set(c.spans.map(({ id }) => id)).size, c.spans.length);
  assert.equal(new Set(c.spans.map(({ resource }) => resource['service.instance.id'])).size, 1);
});

test('callers decide whether they are recorded; health checks never are', async (t) => {
  const c = await Collector.start(t);
  const d = await daemon(t, { args: ['--traces', `${c.url}/v1/traces`] });
  const mesh = await upload(d);
  for (const quiet of ['/livez', '/readyz', '/metrics']) await d.get(quiet, traceparent());
  const silent = await d.post('/v1/embeddings', { mesh: mesh.id }, traceparent('00'));
  await d.ended(silent.json);
  await d.get('/v1/nowhere', { headers: { traceparent: 'none' } }); // not well-formed: treated as missing
  await d.get(`/v1/embeddings/${'0'.repeat(64)}`);
  await until(() => c.named('GET /v1/embeddings/{id}').length === 1, 'the last one');
  const [missing] = c.named('GET /v1/embeddings/{id}');
  assert.equal(missing['http.response.status_code'], 404);
  assert.equal(missing.error, undefined); // of the caller
  assert.equal(missing.parent, undefined);
  assert.equal(c.named('GET', (span) => span['http.response.status_code'] === 404).length, 1);
  assert.ok(c.spans.every(({ name, trace }) => trace !== CALLER.trace && !/livez|readyz|metrics| job$/.test(name)));
  const polls = c.spans.map(({ trace }) => trace);
  assert.equal(new Set(polls).size, polls.length); // each begins a trace
  assert.equal(await count(d, 'dropped'), 0);
});

test('without its collector the daemon serves, sends later what it kept, and ends', async (t) => {
  const gone = await Collector.start(t);
  const { port } = gone.server.address();
  await gone.stop();
  const d = await daemon(t, { args: ['--traces', gone.url, '--log-format', 'text'] });
  const mesh = await upload(d);
  await d.made('/v1/embeddings', { mesh: mesh.id });
  await until(() => /spans cannot be sent/.test(d.log), 'the log says so');
  let refused = 0;
  let refuses = true;
  const c = await Collector.start(t, (_, response) => refuses && ++refused && response.writeHead(503).end(), port);
  await until(() => refused > 0, 'it is asked again');
  refuses = false;
  await until(() => c.named('embedding job').length === 1, 'what was kept');
  await until(() => /spans are sent again/.test(d.log), 'the log says so');
  await until(async () => (await count(d, 'sent')) >= c.spans.length, 'they are counted');
  assert.equal(await count(d, 'dropped'), 0);

  // Spans that the collector refuses permanently are dropped and counted.
  const strict = await Collector.start(t, (_, response) => response.writeHead(400).end());
  const other = await daemon(t, { args: ['--traces', strict.url] });
  await other.get('/v1/meshes');
  await until(async () => (await count(other, 'dropped')) > 0, 'a refused span is dropped');

  // A collector that never answers delays nobody, not even at the end.
  let asked = 0;
  const silent = await Collector.start(t, () => ++asked);
  const last = await daemon(t, { args: ['--traces', silent.url] });
  assert.equal((await last.get('/v1/meshes')).status, 200);
  await until(() => asked > 0, 'it was asked');
  for (let i = 0; i < 20; i++) assert.equal((await last.get('/v1/meshes')).status, 200);
  assert.equal((await last.stop()).code, 0);
});

test('a URL that cannot be one of a collector is refused', async () => {
  for (const url of ['localhost:4318', 'ftp://localhost', 'http://', 'http://user@localhost:4318']) {
    const refused = await runProgram(binaries.daemon, ['--traces', url, '--check-config']);
    assert.equal(refused.code, 2, url);
    assert.match(refused.err, /traces must be a URL/);
  }
});
