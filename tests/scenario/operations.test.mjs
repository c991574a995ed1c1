// What an operator can see and change while the daemon runs: counters, the log, SIGHUP.
import assert from 'node:assert/strict';
import { execFile } from 'node:child_process';
import { readFile, readdir, writeFile, mkdtemp, rm } from 'node:fs/promises';
import { tmpdir } from 'node:os';
import path from 'node:path';
import test from 'node:test';
import { setTimeout as sleep } from 'node:timers/promises';
import { promisify } from 'node:util';
import { assertProblem, binaries, daemon, endless, patience, root, until } from './support/daemon.mjs';
import * as shapes from './support/shapes.mjs';

const lines = (d) =>
  d.log
    .split('\n')
    .slice(0, -1)
    .filter((l) => l.startsWith('{'))
    .map((l) => JSON.parse(l));
async function logged(d, wanted) {
  const end = Date.now() + 120_000 * patience;
  for (;;) {
    const found = lines(d).find(wanted);
    if (found) return found;
    assert.ok(Date.now() < end, `not in the log:\n${d.log}`);
    await sleep(50);
  }
}

test('the counters count the bytes sent', async (t) => {
  const d = await daemon(t);
  const sent = async () =>
    Number(/^orbmorph_sent_bytes_total (\d+)$/m.exec((await d.get('/metrics')).bytes.toString())[1]);
  const text = shapes.obj(shapes.egg(3));
  const { url } = (await d.upload(text)).json;
  const before = await sent();
  for (let i = 0; i < 3; i++) assert.equal((await d.get(`${url}/file`)).bytes.toString(), text);
  assert.equal((await d.get(`${url}/file`, { headers: { range: 'bytes=0-99' } })).status, 206);
  assert.equal((await d.request('HEAD', `${url}/file`)).status, 200);
  const grown = (await sent()) - before;
  const files = 3 * text.length + 100;
  // Besides the files, only the first answer of /metrics itself was sent.
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
  assert.deepEqual(
    [plain.traceparent, plain.route, plain.method, plain.status],
    [undefined, '/v1/meshes/{id}', 'GET', 200],
  );
  for (const zeros of [
    `00-${'0'.repeat(32)}-b7ad6b7169203331-01`,
    `00-0af7651916cd43dd8448eb211c80319c-${'0'.repeat(16)}-01`,
  ]) {
    const reply = await d.get(url, { headers: { traceparent: zeros } });
    assert.equal(
      (await logged(d, (l) => l.request === reply.headers.get('x-request-id'))).traceparent,
      undefined,
      'zeros name no trace',
    );
  }
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
  await logged(d, (l) => /queue-limit changed/.test(l.message));
  await logged(d, (l) => /max-body .*after a restart/.test(l.message));
  const reply = await d.upload(shapes.obj(shapes.egg(3)));
  assert.equal(reply.status, 201, 'the limit of a body needs a restart');
  await logged(d, (l) => l.level === 'debug' && l.request === reply.headers.get('x-request-id'));
  await hup('log-level = warn\nnonsense = 1\n');
  await logged(
    d,
    (l) => l.level === 'error' && /^SIGHUP: config file, line 2: unknown name "nonsense"/.test(l.message),
  );
  await logged(d, (l) => /is not valid; the previous one stays in effect/.test(l.message));
  assertProblem(await d.get('/v1/nothing'), 404, 'not-found');
  await logged(d, (l) => l.level === 'debug');
});

test('SIGHUP reads limits and quotas that take effect', async (t) => {
  const folder = await mkdtemp(path.join(tmpdir(), 'orbmorph-test-'));
  t.after(() => rm(folder, { recursive: true, force: true }));
  const file = path.join(folder, 'conf');
  await writeFile(file, 'queue-limit = 1\n');
  const d = await daemon(t, { args: ['--config', file, '--auth', 'on', '--workers', '1'] });
  const run = promisify(execFile);
  const { stdout } = await run(binaries.daemon, [
    'token',
    'add',
    'web',
    '--scope',
    'admin',
    '--quota',
    '50M',
    '--data',
    d.data,
  ]);
  const web = { headers: { authorization: `Bearer ${stdout.trim()}` } };
  const hup = async () => {
    d.log = '';
    d.child.kill('SIGHUP');
    await logged(d, (l) => l.message === 'SIGHUP: the configuration was read again');
  };
  const upload = (text) => d.post('/v1/meshes', text, web);
  const wave = (levels, k) =>
    shapes.binaryPly(shapes.ball(levels, ([x, y, z]) => [x * (1 + 0.3 * Math.sin(7 * y + k)), 1.5 * y, z]));
  const large = (await upload(wave(5, 1))).json;
  const small = (await upload(wave(3, 2))).json;
  const job = (mesh) => d.post('/v1/embeddings', { mesh: mesh.id, ...endless }, web);
  const first = await job(large);
  assert.equal(first.status, 202);
  assertProblem(await job(small), 429, 'queue-full');
  await writeFile(file, 'queue-limit = 2\n');
  await hup();
  const second = await job(small);
  assert.equal(second.status, 202, second.bytes.toString());
  for (const { json } of [first, second]) await d.delete(json.url, web);

  // The catalogue may change by other means than the command, for example by a restored copy.
  const set = (quota) =>
    run('sqlite3', [
      '-cmd',
      '.timeout 10000',
      path.join(d.data, 'catalogue.sqlite'),
      `UPDATE token SET quota_bytes = ${quota} WHERE name = 'web'`,
    ]);
  await set(1000);
  assert.equal((await upload(shapes.tetrahedron)).status, 201, 'the old quota holds until SIGHUP');
  await hup();
  assertProblem(await upload(`${shapes.tetrahedron}# 2\n`), 429, 'quota-exceeded');
  await set(100_000_000);
  await hup();
  const reply = await upload(`${shapes.tetrahedron}# 2\n`);
  assert.equal(reply.status, 201, reply.bytes.toString());
  assert.match(reply.headers.get('ratelimit-policy'), /"upload";q=100000000;/);
});

test('worker-nice lowers the priority of workers and of the threads of their jobs', async (t) => {
  const levels = async (d) => {
    const found = {};
    for (const thread of await readdir(`/proc/${d.child.pid}/task`)) {
      const text = await readFile(`/proc/${d.child.pid}/task/${thread}/stat`, 'latin1').catch(() => null);
      const level = text?.slice(text.lastIndexOf(')') + 2).split(' ')[16]; // field 19; the name may hold spaces
      if (level !== undefined) found[level] = (found[level] ?? 0) + 1;
    }
    return found;
  };
  const own = Number((await readFile('/proc/self/stat', 'latin1')).split(') ')[1].split(' ')[16]);
  for (const [more, level] of [
    [{}, 5],
    [{ args: ['--worker-nice', '12'] }, 12],
    [{ env: { ORBMORPH_WORKER_NICE: '9' } }, 9],
  ]) {
    if (level <= own) continue; // these tests themselves run at a priority that a process cannot leave
    const args = ['--workers', '2', '--scrub-rate', '0', ...(more.args ?? [])]; // the scrub has its own priority
    const d = await daemon(t, { ...more, args });
    const { json } = await d.upload(shapes.obj(shapes.ball(5, ([x, y, z]) => [x, 1.2 * y, z])));
    const job = (await d.post('/v1/embeddings', { mesh: json.id })).json;
    await until(async () => (await levels(d))[level] >= 2, 'two workers are at their level');
    for (let state = 'queued'; !['succeeded', 'failed'].includes(state); ) {
      const found = await levels(d);
      assert.deepEqual(
        Object.keys(found).sort(),
        [String(own), String(level)].sort(),
        'every thread is at one of the two levels',
      );
      ({ state } = (await d.get(job.url)).json);
    }
  }
  await assert.rejects(promisify(execFile)(binaries.daemon, ['--check-config', '--worker-nice', '20']), {
    stderr: /from 0 to 19/,
  });
});

test('the counters cover jobs, stages and the process', async (t) => {
  const d = await daemon(t);
  const { id } = (await d.upload(shapes.obj(shapes.egg(4)))).json;
  await d.made('/v1/embeddings', { mesh: id });
  const text = (await d.get('/metrics')).bytes.toString();
  const value = (name) => Number(new RegExp(`^${name.replace(/[{}"]/g, '\\$&')} (\\S+)$`, 'm').exec(text)?.[1] ?? NaN);
  for (const name of [
    'orbmorph_jobs{state="queued"}',
    'orbmorph_jobs{state="running"}',
    'orbmorph_queue_oldest_seconds',
    'orbmorph_flips_total',
  ])
    assert.equal(value(name), 0, name);
  assert.equal(value('orbmorph_jobs_ended_total{state="succeeded"}'), 1);
  for (const stage of ['read', 'embed', 'certify', 'store'])
    assert.equal(value(`orbmorph_stage_seconds_count{kind="embedding",stage="${stage}"}`), 1, `${stage}\n${text}`);
  assert.equal(value('orbmorph_job_seconds_count{kind="embedding"}'), 1);
  for (const name of [
    'orbmorph_cache_hits_total',
    'orbmorph_connections',
    'orbmorph_received_bytes_total',
    'orbmorph_stored_bytes',
    'process_resident_memory_bytes',
    'process_open_fds',
    'process_threads',
  ])
    assert.ok(value(name) > 0, name);
  const ready = (await d.get('/readyz', { query: { verbose: '' } })).json;
  assert.deepEqual(
    [ready.queued, ready.waiting, ready.running, ready.queue_limit, ready.oldest_ms],
    [0, 0, 0, 10000, 0],
  );
  assert.deepEqual((await d.get('/readyz')).json, { status: 'ready' });
});

test('the dashboard shows every metric family and no unknown one', async (t) => {
  const d = await daemon(t);
  const { id } = (await d.upload(shapes.obj(shapes.egg(2)))).json;
  await d.made('/v1/embeddings', { mesh: id });
  const text = (await d.get('/metrics')).bytes.toString();
  const families = new Map([...text.matchAll(/^# TYPE (\S+) (\S+)$/gm)].map(([, name, type]) => [name, type]));
  const series = new Set();
  const labels = new Map();
  for (const [, name, list = ''] of text.matchAll(/^([a-z_]+)(?:\{(.*)\})? \S+$/gm)) {
    series.add(name);
    labels.set(name, new Set([...(labels.get(name) ?? []), ...[...list.matchAll(/(\w+)=/g)].map((m) => m[1])]));
  }
  const familyOf = (name) => (families.has(name) ? name : name.replace(/_(bucket|sum|count)$/, ''));
  for (const name of series) assert.ok(families.has(familyOf(name)), `${name} has a type`);
  const { panels } = JSON.parse(await readFile(path.join(root, 'deploy/grafana/orbmorph.json'), 'utf8'));
  const shown = new Set();
  for (const { title, targets } of panels)
    for (const { expr, legendFormat } of targets) {
      const names = [...expr.matchAll(/\b(?:orbmorph|process)_[a-z_]+/g)].map((m) => m[0]);
      assert.ok(names.length > 0, `${title}: ${expr}`);
      for (const name of names) {
        const family = familyOf(name);
        const type = families.get(family);
        assert.ok(type && (series.has(name) || name === 'orbmorph_jobs_running'), `${title}: ${name} is exported`); // by stage: only while one runs
        assert.equal(type === 'histogram', name !== family, `${title}: ${name}`);
        if (type === 'gauge') assert.ok(!expr.includes('rate('), `${title}: no rate of a gauge`);
        for (const [, label] of legendFormat.matchAll(/\{\{(\w+)\}\}/g))
          if (label !== 'instance')
            // Prometheus itself adds it
            assert.ok(
              labels.get(name)?.has(label) || name === 'orbmorph_jobs_running',
              `${title}: ${name} has ${label}`,
            );
        shown.add(family);
      }
    }
  assert.deepEqual(
    [...families.keys()].filter((name) => !shown.has(name)),
    [],
    'families without a panel',
  );
  assert.equal(new Set(panels.map((p) => p.id)).size, panels.length);
  const places = panels.map(({ gridPos }) => `${gridPos.x},${gridPos.y}`);
  assert.equal(new Set(places).size, panels.length, 'none lies on another');
});

test('slow requests are in the log', async (t) => {
  const d = await daemon(t, { args: ['--slow-ms', '1'] });
  const { headers } = await d.upload(shapes.binaryPly(shapes.ball(6)));
  const line = await logged(d, (l) => l.message === 'slow request');
  assert.deepEqual(
    [line.level, line.request, line.route, line.status],
    ['warn', headers.get('x-request-id'), '/v1/meshes', 201],
  );
  assert.ok(line.ms >= 1);
});
