// Measures the service under load, and nginx in the same run for comparison.
//
//   node tests/bench/load.mjs [asset|job|jobs|streams|uploads]…     (default: all)
//
// Needs wrk and nginx (Debian packages). ORBMORPHD names the daemon (build/bin/orbmorphd), ORB_LOAD_SECONDS (5) the
// duration of each measurement. Prints a table, explained in docs/bench-service.md. Exit status 1 if a goal is missed.
import { execFileSync, spawn, spawnSync } from 'node:child_process';
import { mkdirSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import http from 'node:http';
import net from 'node:net';
import os from 'node:os';
import path from 'node:path';
import { setTimeout as sleep } from 'node:timers/promises';
import { Daemon } from '../scenario/support/daemon.mjs';
import * as shapes from '../scenario/support/shapes.mjs';

const seconds = Number(process.env.ORB_LOAD_SECONDS ?? 5);
const parts = process.argv.length > 2 ? process.argv.slice(2) : ['asset', 'job', 'jobs', 'streams', 'uploads'];
const scratch = mkdtempSync(path.join(os.tmpdir(), 'orbmorph-load-'));
const rows = [];
let missed = 0;
function report(what, value, goal, met) {
  missed += !met;
  rows.push([what, value, goal, met ? 'met' : 'MISSED']);
  console.log(`${what}: ${value} (goal: ${goal}) ${met ? 'met' : 'MISSED'}`);
}

const freePort = () =>
  new Promise((resolve) => {
    const server = net.createServer().listen(0, '127.0.0.1', () => {
      const { port } = server.address();
      server.close(() => resolve(port));
    });
  });

/** Starts nginx on one folder, with sendfile and as many workers as the daemon has connection threads. */
async function nginx(root) {
  const port = await freePort();
  const conf = path.join(scratch, 'nginx.conf');
  writeFileSync(
    conf,
    `daemon off; worker_processes 2; pid ${scratch}/nginx.pid; error_log /dev/null;
user root;
events { worker_connections 4096; }
http { access_log off; sendfile on; tcp_nopush on; keepalive_requests 100000000; default_type application/json;
  client_body_temp_path ${scratch}/t1; proxy_temp_path ${scratch}/t2; fastcgi_temp_path ${scratch}/t3;
  uwsgi_temp_path ${scratch}/t4; scgi_temp_path ${scratch}/t5;
  server { listen 127.0.0.1:${port}; root ${root}; } }\n`,
  );
  const child = spawn('nginx', ['-c', conf, '-e', '/dev/null'], { stdio: 'inherit' });
  for (let i = 0; i < 100; i++) {
    if (
      await fetch(`http://127.0.0.1:${port}/`).then(
        () => true,
        () => false,
      )
    )
      break;
    await sleep(50);
  }
  return { url: `http://127.0.0.1:${port}`, stop: () => child.kill() };
}

function wrk(url, connections) {
  const text = execFileSync('wrk', ['-t2', `-c${connections}`, `-d${seconds}s`, '--latency', url], {
    encoding: 'utf8',
  });
  const unit = { us: 1e-3, ms: 1, s: 1e3, m: 6e4 };
  const [, p99, of] = /99%\s+([\d.]+)(us|ms|s|m)\b/.exec(text);
  const bad = /Non-2xx or 3xx responses: (\d+)/.exec(text)?.[1] ?? /Socket errors: (.*)/.exec(text)?.[1];
  if (bad) console.log(`  wrk: ${bad}`);
  return { rate: Number(/Requests\/sec:\s+([\d.]+)/.exec(text)[1]), p99: Number(p99) * unit[of] };
}
const show = ({ rate, p99 }) => `${rate.toFixed(0)} requests/s, p99 ${p99.toFixed(1)} ms`;

/** Measures both alternately, twice, and returns the better of each: a busy moment of the machine does not decide. */
function compare(a, b, connections) {
  const best = (x, y) => (x.rate > y.rate ? x : y);
  const [a1, b1, a2, b2] = [wrk(a, connections), wrk(b, connections), wrk(a, connections), wrk(b, connections)];
  return [best(a1, a2), best(b1, b2)];
}

const status = (d, field) =>
  Number(new RegExp(`${field}:\\s+(\\d+) kB`).exec(readFileSync(`/proc/${d.child.pid}/status`, 'utf8'))[1]) / 1024;

async function start(args = []) {
  mkdirSync(path.join(scratch, 'data'), { recursive: true });
  return new Daemon(mkdtempSync(path.join(scratch, 'data/')), ['--workers', '2', ...args], {}).start();
}
const mesh = async (d, levels, n) =>
  (
    await d.upload(
      shapes.binaryPly(shapes.ball(levels, ([x, y, z]) => [x * (1 + 0.1 * Math.sin(3 * y + n)), y, z + 0.1 * n])),
      { name: `m${n}` },
    )
  ).json;

async function asset() {
  const d = await start();
  const [a, b] = [await mesh(d, 5, 1), await mesh(d, 4, 2)];
  const made = await d.made('/v1/supermeshes', {
    shapes: [{ mesh: a.id }, { mesh: b.id }],
    align: { method: 'rotate' },
    remesh: { method: 'overlay' },
  });
  const file = await d.get(made.asset);
  mkdirSync(`${scratch}/www`, { recursive: true });
  writeFileSync(`${scratch}/www/asset.glb`, file.bytes);
  const other = await nginx(`${scratch}/www`);
  const [ours, theirs] = compare(d.url + made.asset, `${other.url}/asset.glb`, 64);
  other.stop();
  await d.stop();
  const ratio = ours.rate / theirs.rate;
  report(
    `GET asset.glb, ${(file.bytes.length / 1e6).toFixed(2)} MB, 64 connections`,
    `${show(ours)}; nginx ${show(theirs)}; ratio ${ratio.toFixed(2)}`,
    'ratio >= 0.8',
    ratio >= 0.8,
  );
}

async function job() {
  const d = await start();
  const a = await mesh(d, 3, 1);
  const reply = await d.post('/v1/embeddings', { mesh: a.id });
  await d.ended(reply.json);
  mkdirSync(`${scratch}/www`, { recursive: true });
  writeFileSync(`${scratch}/www/job`, (await d.get(reply.json.url)).bytes);
  const other = await nginx(`${scratch}/www`);
  const [ours, theirs] = compare(d.url + reply.json.url, `${other.url}/job`, 64);
  other.stop();
  await d.stop();
  const ratio = ours.rate / theirs.rate;
  report(
    'GET /v1/jobs/{id}, no job running, 64 connections',
    `${show(ours)}; nginx ${show(theirs)}; ratio ${ratio.toFixed(2)}`,
    'ratio >= 0.5',
    ratio >= 0.5,
  );
}

/** Submits two jobs that take minutes and one that waits behind them. */
async function busy(d) {
  const made = [];
  for (let i = 0; i < 3; i++) {
    const m = await mesh(d, 7, i);
    made.push((await d.post('/v1/embeddings', { mesh: m.id, method: 'kernel-sampling' })).json);
  }
  while ((await d.get('/readyz', { query: { verbose: '1' } })).json.running < 2) await sleep(50);
  return made;
}
async function running(d) {
  return (await d.get('/readyz', { query: { verbose: '1' } })).json.running;
}

async function jobs() {
  const d = await start();
  const [first] = await busy(d);
  const got = wrk(d.url + first.url, 64);
  const still = await running(d);
  await d.stop('SIGKILL');
  report(
    `GET /v1/jobs/{id} while ${still} jobs run, 64 connections`,
    show(got),
    '>= 15000 requests/s, p99 < 20 ms, 2 jobs running',
    got.rate >= 15000 && got.p99 < 20 && still === 2,
  );
}

async function streams() {
  const clients = 10_000;
  const d = await start();
  const [first, , last] = await busy(d);
  const before = wrk(d.url + first.url, 16);
  const memory = status(d, 'VmRSS');
  // The clients run in separate processes, so the limit of open files does not stop them.
  const child = spawn(
    process.execPath,
    [new URL(import.meta.url).pathname, '--streams', d.url + last.url + '/events', String(clients)],
    { stdio: ['ignore', 'pipe', 'inherit'] },
  );
  const opened = await new Promise((resolve) => child.stdout.once('data', (chunk) => resolve(Number(chunk))));
  await sleep(1000);
  const grown = status(d, 'VmRSS') - memory;
  const after = wrk(d.url + first.url, 16);
  child.kill();
  await d.stop('SIGKILL');
  report(
    `${opened} idle event streams`,
    `${grown.toFixed(0)} MB`,
    `${clients} use < 200 MB`,
    opened === clients && grown < 200,
  );
  report(
    'p99 of GET /v1/jobs/{id} with them',
    `${after.p99.toFixed(1)} ms, before ${before.p99.toFixed(1)} ms`,
    'unchanged (at most 1.5 times and 5 ms)',
    after.p99 <= Math.max(1.5 * before.p99, before.p99 + 5),
  );
}

async function openStreams(url, count) {
  let open = 0;
  let failed = 0;
  const agent = new http.Agent({ maxSockets: Infinity, keepAlive: false });
  for (let i = 0; i < count; i++) {
    http
      .get(url, { agent }, (response) => {
        response.on('data', () => {}).on('error', () => {});
        open += response.statusCode === 200;
      })
      .on('error', () => failed++);
    if (i % 200 === 199) await sleep(5);
  }
  for (let i = 0; i < 600 && open + failed < count; i++) await sleep(50);
  console.log(open);
  await sleep(600_000);
}

async function uploads() {
  const limit = 1024;
  const count = 100;
  const d = await start(['--job-memory', '512M']);
  const bytes = shapes.binaryPly(shapes.ball(8)); // 10 MB
  const text = bytes.subarray(0, 300).toString('latin1');
  const at = text.indexOf('\n', text.indexOf('format')) + 1;
  const began = Date.now();
  const codes = await Promise.all(
    Array.from({ length: count }, async (_, i) => {
      const body = Buffer.concat([bytes.subarray(0, at), Buffer.from(`comment ${i}\n`), bytes.subarray(at)]);
      return (await d.upload(body, { name: `u${i}` })).status;
    }),
  );
  const peak = status(d, 'VmHWM');
  const stored = codes.filter((code) => code === 201).length;
  await d.stop();
  report(
    `${count} uploads of ${(bytes.length / 1e6).toFixed(1)} MB at once`,
    `${stored} stored in ${((Date.now() - began) / 1000).toFixed(0)} s, peak memory ${peak.toFixed(0)} MB`,
    `all stored, < ${limit} MB (two checks of --job-memory 512M)`,
    stored === count && peak < limit,
  );
}

if (process.argv[2] === '--streams') {
  await openStreams(process.argv[3], Number(process.argv[4]));
} else {
  for (const tool of ['wrk', 'nginx']) {
    if (spawnSync('which', [tool]).status !== 0) throw new Error(`${tool} is not installed`);
  }
  try {
    for (const part of parts) await { asset, job, jobs, streams, uploads }[part]();
    console.log(
      `\n| what | measured | goal | |\n|---|---|---|---|\n${rows.map((row) => `| ${row.join(' | ')} |`).join('\n')}`,
    );
    console.log(
      `\n${os.cpus().length} cores, ${os.cpus()[0].model}, load ${os.loadavg()[0].toFixed(1)}, ${seconds} s a measurement`,
    );
  } finally {
    rmSync(scratch, { recursive: true, force: true });
  }
  process.exit(missed ? 1 : 0);
}
